"""Published problems of friction in motion: turntable, rolling, capstan, pusher, conveyor; three step sizes."""

import numpy as np
import pytest
from contact_measures import G, centre, pushes, speed, step_well

import turnbuckle


@pytest.mark.parametrize(("part", "slips"), [(0.97, False), (1.03, True)])
def test_a_turntable_carries_what_is_near_its_axis(part: float, slips: bool) -> None:
    """Friction holds a body on a turning disc as far as mu g / omega^2."""
    omega, mu = 2.0, 0.3
    radius = part * mu * G / omega**2
    scene = turnbuckle.Scene("turntable", dt=0.004, contact={"friction": mu})
    scene.add_obstacle("disc", box=[4.0, 4.0, 0.1], trajectory=lambda t: ([0.0, 0.0, -0.05], [0.0, 0.0, omega * t]))
    scene.add_rigid(
        "body", box=[0.02, 0.02, 0.01], position=[radius, 0.0, 0.0052], velocity=[0.0, omega * radius, 0.0],
        angular_velocity=[0.0, 0.0, omega],
    )  # fmt: skip
    sim = turnbuckle.Simulation(scene)
    step_well(sim, 250)
    x, y = centre(sim, "body")[:2]
    if slips:
        assert np.hypot(x, y) > 1.05 * radius
    else:
        assert np.hypot(x, y) == pytest.approx(radius, rel=2e-3)
        turned = np.arctan2(y, x) - omega * sim.time
        assert abs((turned + np.pi) % (2.0 * np.pi) - np.pi) < 5e-3


def roller(mu: float, angle: float, dt: float, sides: int = 240) -> turnbuckle.Simulation:
    """A cylinder of many sides on a slope, in axes of the slope: gravity has a part along x."""
    scene = turnbuckle.Scene("roller", dt=dt, contact={"friction": mu, "delta": 5e-4}, gravity=[G * np.sin(angle), 0.0, -G * np.cos(angle)])  # fmt: skip
    scene.add_obstacle("slope", plane=[20.0, 4.0])
    turn = 2.0 * np.pi * np.arange(sides) / sides
    rim = 0.1 * np.stack([np.cos(turn), np.zeros(sides), np.sin(turn)], axis=1)
    vertices = np.concatenate([rim - [0.0, 0.05, 0.0], rim + [0.0, 0.05, 0.0], [[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    ends = np.full(sides, 2 * sides)
    triangles = np.concatenate([
        np.stack([i, j, j + sides], 1), np.stack([i, j + sides, i + sides], 1), np.stack([ends, j, i], 1),
        np.stack([ends + 1, i + sides, j + sides], 1),
    ])  # fmt: skip
    p = vertices[triangles]
    if np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) < 0.0:
        triangles = triangles[:, ::-1]
    scene.add_rigid("roller", vertices=vertices, triangles=triangles, position=[-5.0, 0.0, 0.1005])
    return turnbuckle.Simulation(scene)


def test_a_cylinder_slips_on_a_steep_slope() -> None:
    """a = g (sin - mu cos) where tan > 3 mu."""
    mu, angle = 0.1, 0.45
    sim = roller(mu, angle, 0.005)
    step_well(sim, 20)
    first = speed(sim, "roller")[0]
    step_well(sim, 40)
    assert (speed(sim, "roller")[0] - first) / 0.2 == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)), rel=0.01)
    assert 0.1 * sim.velocity("roller")[1][1] < 0.7 * speed(sim, "roller")[0]


def test_a_cylinder_rolls_on_a_flat_slope() -> None:
    """a = 2/3 g sin, but for an error of order dt: forces act where points were at the start of the step, hv ahead."""
    angle, errors = 0.2, []
    for dt in (0.01, 0.0025):
        sim = roller(0.5, angle, dt)
        step_well(sim, round(0.1 / dt))
        first = speed(sim, "roller")[0]
        step_well(sim, round(0.2 / dt))
        found = (speed(sim, "roller")[0] - first) / 0.2
        errors.append(abs(found / (2.0 / 3.0 * G * np.sin(angle)) - 1.0))
        assert 0.1 * sim.velocity("roller")[1][1] == pytest.approx(speed(sim, "roller")[0], rel=0.01)
    assert errors[0] < 0.2 and errors[1] < 0.4 * errors[0]


def capstan(ratio: float, mu: float = 0.3) -> turnbuckle.Simulation:
    """A rope over half of a fixed drum, with two weights whose ratio is given."""
    scene = turnbuckle.Scene("capstan", dt=0.004, contact={"friction": mu, "delta": 2e-3})
    radius, count = 0.1, 36
    scene.add_obstacle("drum", cylinder={"radius": radius, "length": 0.2}, rotation=[np.pi / 2, 0.0, 0.0])
    around = np.linspace(np.pi, 0.0, count + 1)
    r = radius + 2.5e-3
    top = np.stack([r * np.cos(around), np.zeros(count + 1), r * np.sin(around)], axis=1)
    hang = np.arange(1, 6)[:, None] * [0.0, 0.0, -0.02]
    points = np.concatenate([(top[0] + hang)[::-1], top, top[-1] + hang])
    scene.add_rope("rope", points=points, stretch_stiffness=3e4, damping=1.0, mass=0.01)

    def weights(x: np.ndarray, v: np.ndarray, t: float, m: np.ndarray) -> np.ndarray:
        force = np.zeros_like(x)
        force[0, 2], force[-1, 2] = -5.0, -5.0 * ratio
        return force

    scene.add_force("weights", body="rope", callable=weights)
    return turnbuckle.Simulation(scene)


@pytest.mark.parametrize(("part", "holds"), [(0.85, True), (1.2, False)])
def test_a_capstan(part: float, holds: bool) -> None:
    """A rope that half surrounds a drum holds up to T1 / T2 = exp(pi mu)."""
    sim = capstan(part * np.exp(np.pi * 0.3))
    step_well(sim, 50)
    before = centre(sim, "rope")
    step_well(sim, 50)
    moved = np.linalg.norm(centre(sim, "rope") - before)
    assert (moved < 1e-3) == holds, moved


def test_a_belt_carries_rigid_and_soft_bodies() -> None:
    """They get its speed by friction, as fast as mu g allows, and keep it."""
    scene = turnbuckle.Scene("belt", dt=0.005, contact={"friction": 0.5})
    scene.add_obstacle("belt", plane=[20.0, 4.0], trajectory=lambda t: ([0.7 * t, 0.0, 0.0], [0.0, 0.0, 0.0]))
    scene.add_rigid("box", box=[0.1, 0.1, 0.06], position=[0.0, 0.0, 0.031])
    box = {"size": [0.1, 0.1, 0.06], "cells": [2, 2, 1]}
    scene.add_solid("soft", box=box, youngs_modulus=1e5, damping=0.01, position=[0.0, 1.0, 0.001])
    sim = turnbuckle.Simulation(scene)
    step_well(sim, 16)
    assert speed(sim, "box")[0] == pytest.approx(0.5 * G * 0.08, rel=0.03)
    step_well(sim, 84)
    assert speed(sim, "box")[0] == pytest.approx(0.7, abs=1e-3)
    assert speed(sim, "soft")[0] == pytest.approx(0.7, abs=1e-2)


def test_a_scripted_obstacle_pushes_a_box() -> None:
    """With its own speed, against friction of mu m g; its work is what friction takes."""
    scene = turnbuckle.Scene("push", dt=0.005, contact={"friction": 0.2})
    scene.add_obstacle("floor", plane=[20.0, 4.0])
    scene.add_obstacle(
        "pusher", box=[0.1, 1.0, 0.1], trajectory=lambda t: ([-0.2 + 0.5 * t, 0.0, 0.1], [0.0, 0.0, 0.0])
    )
    scene.add_rigid("box", box=[0.2, 0.2, 0.2], position=[0.0, 0.0, 0.1015], mass=2.0)
    scene.add_friction("pusher", "box", 0.0)
    sim = turnbuckle.Simulation(scene)
    step_well(sim, 80)
    forces, travelled = [], centre(sim, "box")[0]
    reports = step_well(sim, 1)
    before = reports[-1].energies
    for _ in range(80):
        reports = step_well(sim, 1)
        forces.append(pushes(sim)["pusher", "box"])
    assert centre(sim, "box")[0] - travelled == pytest.approx(0.5 * 81 * 0.005, rel=1e-2)
    assert np.mean(forces, axis=0)[0] == pytest.approx(0.2 * 2.0 * G, rel=1e-2)
    after = reports[-1].energies
    wanted = 0.2 * 2.0 * G * 0.2
    assert after["work"] - before["work"] == pytest.approx(wanted, rel=0.02)
    assert after["dissipation"] - before["dissipation"] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("kind", ["rigid", pytest.param("soft", marks=pytest.mark.slow)])
def test_three_step_sizes_end_alike(kind: str) -> None:
    """A body thrown against a wall on a floor comes to rest at nearly the same place with 2, 8 and 32 ms."""
    ends = []
    for dt in (0.002, 0.008, 0.032):
        scene = turnbuckle.Scene("thrown", dt=dt, contact={"friction": 0.4})
        scene.add_obstacle("floor", plane=[20.0, 4.0])
        scene.add_obstacle("wall", box=[0.1, 2.0, 1.0], position=[0.5, 0.0, 0.55])
        if kind == "rigid":
            scene.add_rigid("body", box=[0.2, 0.2, 0.1], position=[0.0, 0.0, 0.06], velocity=[1.2, 0.0, 0.0])
        else:
            box = {"size": [0.2, 0.2, 0.1], "cells": [2, 2, 1]}
            at = {"position": [-0.1, -0.1, 0.01], "velocity": [1.2, 0.0, 0.0]}
            scene.add_solid("body", box=box, youngs_modulus=1e5, damping=0.02, **at)
        sim = turnbuckle.Simulation(scene)
        step_well(sim, round(0.64 / dt))
        assert np.linalg.norm(speed(sim, "body")) < 5e-3
        ends.append(centre(sim, "body"))
    assert np.linalg.norm(ends[0] - ends[1]) < 0.01
    assert np.linalg.norm(ends[0] - ends[2]) < 0.03
