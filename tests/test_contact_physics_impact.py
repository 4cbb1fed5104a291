"""Falls and collisions: momentum, energy, rest; nothing passes, however fast."""

import numpy as np
import pytest
from contact_measures import centre, mass, momentum, pushes, speed, step_well

import turnbuckle

SOLID = {"size": [0.2, 0.2, 0.2], "cells": [2, 2, 2]}


def dropped(kind: str, dt: float, height: float = 0.05, **contact) -> turnbuckle.Simulation:
    """A body over a floor of two triangles."""
    scene = turnbuckle.Scene("drop", dt=dt, contact={"friction": 0.4, **contact})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    if kind == "box":
        scene.add_rigid("body", box=[0.2, 0.2, 0.2], position=[0.0, 0.0, 0.1 + height])
    elif kind == "ball":
        scene.add_rigid("body", sphere=0.1, position=[0.0, 0.0, 0.1 + height])
    elif kind == "cloth":
        scene.add_cloth("body", size=[0.4, 0.4], cells=[6, 6], position=[0.0, 0.0, height])
    else:
        e = {"soft": 1e5, "stiff": 1e7}[kind]
        scene.add_solid("body", box=SOLID, youngs_modulus=e, position=[0.0, 0.0, height])
    return turnbuckle.Simulation(scene)


def total(report: turnbuckle.StepReport) -> float:
    """Energy that the bodies have and have lost, less what they were given [J]."""
    e = report.energies
    return e["kinetic"] + e["elastic"] + e["gravity"] + e.get("dissipation", 0.0) - e.get("work", 0.0)


def stored(report: turnbuckle.StepReport) -> float:
    e = report.energies
    return e["kinetic"] + e["elastic"] + e["gravity"]


@pytest.mark.parametrize("dt", [0.002, 0.02])
@pytest.mark.parametrize("kind", ["box", "ball", "cloth"])
def test_what_falls_does_not_bounce(kind: str, dt: float) -> None:
    """It lands with 1 m/s, stays, within what surfaces keep apart, and does not move any more."""
    sim = dropped(kind, dt)
    height = []
    for _ in range(round(0.2 / dt)):
        report = step_well(sim, 1)[0]
        if report.touching:
            height.append(centre(sim, "body")[2])
    rest = height[-1]
    delta = float(sim.model.surfaces.delta.max())
    assert max(height[1:]) < rest + 0.3 * delta
    step_well(sim, round(0.1 / dt))
    assert abs(centre(sim, "body")[2] - rest) < 0.05 * delta
    lowest = sim.positions("body")[:, 2].min()
    assert 0.5 * delta < lowest < 1.05 * delta
    assert np.linalg.norm(speed(sim, "body")) < 2e-3


@pytest.mark.parametrize("dt", [0.008, 0.03])
@pytest.mark.parametrize("kind", ["box", "ball", "soft", "stiff", "cloth"])
def test_a_fall_never_gains_energy(kind: str, dt: float) -> None:
    """From step to step, with what was lost counted and without, but for the lift of what lies too near (0.3 delta)."""
    sim = dropped(kind, dt, tolerance=1e-6)
    weight = 9.81 * mass(sim, "body")
    lift = 0.2 * 0.3 * float(sim.model.surfaces.delta.max()) * weight
    first = step_well(sim, 1)[0]
    start, before, all_before = stored(first), stored(first), total(first)
    for _ in range(round(0.4 / dt)):
        report = step_well(sim, 1)[0]
        assert stored(report) <= before + lift + 1e-5 * start, f"t = {report.time}"
        assert total(report) <= all_before + 1e-5 * start, f"t = {report.time}"
        before, all_before = stored(report), total(report)
    assert before < 0.8 * start


@pytest.mark.parametrize("dt", [0.005, 0.02])
@pytest.mark.parametrize("kind", ["soft", "stiff"])
def test_a_fall_changes_momentum_by_weight_and_contact_alone(kind: str, dt: float) -> None:
    """In every step, however stiff: what the floor gives is what the body gets."""
    sim = dropped(kind, dt)
    m = float(np.maximum(sim.model.mass, 0.0).sum())
    weight = np.array([0.0, 0.0, -9.81 * m * dt])
    before = momentum(sim)[0]
    for _ in range(round(0.4 / dt)):
        report = step_well(sim, 1)[0]
        after = momentum(sim)[0]
        if report.halvings == 0:
            floor = pushes(sim).get(("floor", "body"), np.zeros(3)) * dt
            wrong = np.abs(after - before - weight - floor).max()
            assert wrong < 0.05 * np.abs(weight).max(), f"t = {report.time}"
        before = after


def bodies_that_meet(dt: float, mu: float, **contact) -> turnbuckle.Simulation:
    scene = turnbuckle.Scene("meet", dt=dt, gravity=[0.0, 0.0, 0.0], contact={"friction": mu, **contact})
    scene.add_rigid(
        "a",
        box=[0.2, 0.2, 0.2],
        position=[-0.25, 0.02, 0.03],
        velocity=[2.0, 0.0, 0.0],
        angular_velocity=[1.0, 2.0, 3.0],
    )
    scene.add_rigid("b", box=[0.3, 0.2, 0.2], position=[0.05, 0.0, 0.0], rotation=[0.1, 0.2, 0.3])
    solid = {"box": SOLID, "youngs_modulus": 2e4}
    scene.add_solid("c", **solid, position=[0.3, -0.05, -0.05], velocity=[-2.0, 0.3, 0.0])
    return turnbuckle.Simulation(scene)


@pytest.mark.parametrize(("dt", "mu"), [(0.002, 0.0), (0.002, 0.5), (0.01, 0.0), (0.01, 0.5)])
def test_collisions_keep_momentum(dt: float, mu: float) -> None:
    """Linear to what solvers are asked for; angular too but for points that are not yet together when they push."""
    sim = bodies_that_meet(dt, mu, tolerance=1e-6)
    linear, angular = momentum(sim)
    size = 16.0
    touched = 0
    for _ in range(round(0.3 / dt)):
        report = step_well(sim, 1)[0]
        touched += report.touching > 0
        assert report.status == "ok", report.messages
    now = momentum(sim)
    assert touched > 3
    assert np.abs(now[0] - linear).max() < 1e-6 * size
    assert np.abs(now[1] - angular).max() < 0.02 * 0.25 * size


@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_collisions_never_gain_energy(dt: float) -> None:
    sim = bodies_that_meet(dt, 0.3)
    before = start = stored(step_well(sim, 1)[0])
    for _ in range(round(0.3 / dt)):
        now = stored(step_well(sim, 1)[0])
        assert now <= before + 2e-4 * start
        before = now
    assert now < 0.9 * start


@pytest.mark.parametrize("velocity", [10.0, 1000.0])
@pytest.mark.parametrize("kind", ["rigid", "soft", "cloth"])
def test_nothing_passes_a_wall_of_two_triangles(kind: str, velocity: float) -> None:
    scene = turnbuckle.Scene("wall", dt=0.01, gravity=[0.0, 0.0, 0.0], contact=True)
    wall = [[0.0, -5.0, -5.0], [0.0, 5.0, -5.0], [0.0, 5.0, 5.0], [0.0, -5.0, 5.0]]
    scene.add_obstacle("wall", vertices=wall, triangles=[[0, 1, 2], [0, 2, 3]])
    at = {"position": [-0.3, 0.1, 0.2], "rotation": [0.3, 0.2, 0.1], "velocity": [velocity, 0.2 * velocity, 0.0]}
    if kind == "rigid":
        scene.add_rigid("body", box=[0.1, 0.1, 0.1], **at)
    elif kind == "soft":
        scene.add_solid("body", box={"size": [0.1] * 3, "cells": [1, 1, 2]}, youngs_modulus=1e5, **at)
    else:
        scene.add_cloth("body", size=[0.2, 0.2], cells=[3, 3], **{**at, "rotation": [0.2, 1.3, 0.0]})
    sim = turnbuckle.Simulation(scene)
    for _ in range(8 if velocity > 100.0 else 30):
        step_well(sim, 1)
        surface = sim.model.surfaces.positions(sim.state.positions())[sim.model.surfaces.shape == 1]
        assert surface[:, 0].max() < 0.0
        assert np.isfinite(surface).all()
