"""What velocities may miss: less at rest, more where bodies are pressed."""

import numpy as np
import pytest

import turnbuckle
from turnbuckle.step.contact_step import ContactStepper
from turnbuckle.step.contact_tolerance import FAST, LEAST, PUSHED, REST, median_push, solver_tolerance

G, DT = 9.81, 0.01


def stack(count: int, gravity: float = G, **contact: object) -> tuple[turnbuckle.Simulation, ContactStepper]:
    """Boxes of 1 kg on each other."""
    scene = turnbuckle.Scene("stack", dt=DT, gravity=[0, 0, -gravity], contact={"friction": 0.5, **contact})
    scene.add_obstacle("floor", plane=[2, 2])
    for k in range(count):
        scene.add_rigid(f"b{k}", box=[0.2, 0.2, 0.1], mass=1.0, position=[0, 0, 0.0502 + 0.1002 * k])
    sim = turnbuckle.Simulation(scene)
    assert isinstance(sim.stepper, ContactStepper)
    return sim, sim.stepper


def test_bodies_are_pushed_by_what_lies_on_them_and_what_they_lie_on() -> None:
    """Of three boxes the lowest by 3 + 2 weights, the next by 2 + 1, the last by 1."""
    for count, weights in ((1, 1.0), (3, 3.0)):
        sim, stepper = stack(count)
        assert median_push(stepper) == 0.0
        for _ in range(100):
            sim.step()
        assert median_push(stepper) == pytest.approx(weights * G, rel=1e-3)


def test_a_body_does_not_push_itself() -> None:
    scene = turnbuckle.Scene("fold", dt=DT, gravity=[0, 0, -G], contact=True)
    scene.add_obstacle("floor", plane=[2, 2])
    scene.add_cloth("cloth", size=[0.2, 0.2], cells=[4, 4], density=0.2, position=[0, 0, 0.01])
    sim = turnbuckle.Simulation(scene)
    assert isinstance(sim.stepper, ContactStepper)
    for _ in range(60):
        sim.step()
    lies = median_push(sim.stepper)
    assert lies == pytest.approx(G, rel=0.02)
    state, surfaces = sim.state, sim.model.surfaces
    assert surfaces is not None
    span = max(len(surfaces.faces), len(surfaces.edges), surfaces.vertices)
    vertex, face = surfaces.vertices - 1, len(surfaces.faces) - 1  # both of the cloth
    state.contact_keys = np.append(state.contact_keys, vertex * span + face)
    state.contact_impulse = np.concatenate([state.contact_impulse, [[0.0, 0.0, 1e3]]])
    assert median_push(sim.stepper) == pytest.approx(lies, rel=1e-12)


def test_the_tolerance_follows_speeds_and_pushes() -> None:
    sim, stepper = stack(3, tolerance=1e-2)
    assert stepper.surfaces.delta.min() / DT * 0.25 < G * DT  # gravity is the scale here
    whole = 1e-2 * G * DT
    for speed, part in ((100.0, 1.0), (FAST * G * DT, 1.0), (FAST * G * DT / 4.0, 0.25), (0.0, REST)):
        assert solver_tolerance(stepper, np.array([0.0, speed]), DT) == pytest.approx(part * whole)
    for _ in range(100):
        sim.step()
    assert solver_tolerance(stepper, np.zeros(3), DT) == pytest.approx(3.0 * REST * whole, rel=1e-3)
    sim.state.contact_impulse = 1e4 * sim.state.contact_impulse
    assert solver_tolerance(stepper, np.zeros(3), DT) == pytest.approx(PUSHED * REST * whole)
    assert solver_tolerance(stepper, np.zeros(0), 1e-12) >= LEAST
