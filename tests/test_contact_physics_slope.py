"""A block on a slope: Coulomb's threshold, in any direction, for rigid bodies, soft solids and cloth alike (dt 10 ms)."""

import numpy as np
import pytest
from contact_measures import G, centre, speed, step_well
from scipy.spatial.transform import Rotation

import turnbuckle

DT = 0.01
KINDS = ("rigid", "soft", "cloth")


def on_slope(
    kind: str, mu: float, part: float, heading: float, **contact
) -> tuple[turnbuckle.Simulation, Rotation, float]:
    """A body on a slope at ``part`` of the angle of friction, which falls towards ``heading``; with its turn and angle."""
    angle = part * np.arctan(mu)
    turn = Rotation.from_rotvec(angle * np.array([-np.sin(heading), np.cos(heading), 0.0]))
    scene = turnbuckle.Scene("slope", dt=DT, contact={"friction": mu, **contact})
    scene.add_obstacle("slope", plane=[40.0, 40.0], rotation=turn.as_rotvec())
    at = {"rotation": turn.as_rotvec()}
    if kind == "rigid":
        scene.add_rigid("block", box=[0.2, 0.2, 0.1], position=turn.apply([0.013, 0.007, 0.0515]), **at)
    elif kind == "soft":
        box = {"size": [0.2, 0.2, 0.1], "cells": [3, 3, 2]}
        scene.add_solid("block", box=box, youngs_modulus=1e5, position=turn.apply([-0.1, -0.1, 0.0015]), **at)
    else:
        scene.add_cloth("block", size=[0.2, 0.2], cells=[5, 5], position=turn.apply([-0.1, -0.1, 0.0015]), **at)
    return turnbuckle.Simulation(scene), turn, angle


def creep(sim: turnbuckle.Simulation, settle: float, watch: float) -> float:
    """How far the centre of mass gets from where it is after ``settle`` seconds, in ``watch`` seconds."""
    step_well(sim, round(settle / DT))
    start, far = centre(sim, "block"), 0.0
    for _ in range(round(watch / DT)):
        step_well(sim, 1)
        far = max(far, float(np.linalg.norm(centre(sim, "block") - start)))
    return far


def acceleration(sim: turnbuckle.Simulation, down: np.ndarray) -> float:
    """Along ``down``, over the last 0.6 of 1.2 s."""
    step_well(sim, 60)
    first = speed(sim, "block")
    step_well(sim, 60)
    return float((speed(sim, "block") - first) @ down) / 0.6


@pytest.mark.parametrize("heading", [0.0, 2.3])
@pytest.mark.parametrize("kind", KINDS)
def test_it_rests_just_below_the_angle_of_friction(kind: str, heading: float) -> None:
    sim, _, _ = on_slope(kind, 0.4, 0.99, heading)
    assert creep(sim, 1.5, 0.5) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.2, 0.8])
@pytest.mark.parametrize("heading", [0.0, 0.7, 2.3])
@pytest.mark.parametrize("kind", KINDS)
def test_it_rests_for_a_minute(kind: str, heading: float, mu: float) -> None:
    sim, _, _ = on_slope(kind, mu, 0.99, heading)
    assert creep(sim, 2.0, 60.0) < 1e-6


@pytest.mark.parametrize("heading", [0.5, 2.3])
@pytest.mark.parametrize("kind", KINDS)
def test_it_slides_just_above(kind: str, heading: float) -> None:
    """Straight down, and as fast as g (sin - mu cos) says."""
    sim, turn, angle = on_slope(kind, 0.4, 1.01, heading)
    down = turn.apply([np.cos(heading), np.sin(heading), 0.0])
    wanted = G * (np.sin(angle) - 0.4 * np.cos(angle))
    assert acceleration(sim, down) == pytest.approx(wanted, rel=0.01)
    across = turn.apply([-np.sin(heading), np.cos(heading), 0.0])
    v = speed(sim, "block")
    assert abs(v @ across) < 5e-3 * (v @ down)


@pytest.mark.parametrize("kind", KINDS)
def test_steeper_slopes(kind: str) -> None:
    sim, turn, angle = on_slope(kind, 0.3, 1.6, 1.1)
    wanted = G * (np.sin(angle) - 0.3 * np.cos(angle))
    assert acceleration(sim, turn.apply([np.cos(1.1), np.sin(1.1), 0.0])) == pytest.approx(wanted, rel=0.01)


def test_the_paper_s_pyramid_is_not_round() -> None:
    """Four sides aligned with the motion at the start resist as the cone does along it."""
    sim, turn, angle = on_slope("rigid", 0.4, 1.3, 0.5, solver="ica", friction_shape="pyramid4", tolerance=1e-5)
    wanted = G * (np.sin(angle) - 0.4 * np.cos(angle))
    assert acceleration(sim, turn.apply([np.cos(0.5), np.sin(0.5), 0.0])) == pytest.approx(wanted, rel=0.03)


def test_at_rest_static_friction_in_motion_dynamic() -> None:
    """One slope: a block that stands stays, one that was pushed goes on, by the dynamic coefficient."""
    angle = np.arctan(0.4)
    for start, slides in ((0.0, False), (0.5, True)):
        turn = Rotation.from_rotvec([0.0, angle, 0.0])
        scene = turnbuckle.Scene("both", dt=DT, contact={"friction": 0.5, "dynamic_friction": 0.3})
        scene.add_obstacle("slope", plane=[40.0, 40.0], rotation=turn.as_rotvec())
        scene.add_rigid(
            "block", box=[0.2, 0.2, 0.1], position=turn.apply([0.0, 0.0, 0.0515]), rotation=turn.as_rotvec(),
            velocity=start * turn.apply([1.0, 0.0, 0.0]),
        )  # fmt: skip
        sim = turnbuckle.Simulation(scene)
        down = turn.apply([1.0, 0.0, 0.0])
        if slides:
            assert acceleration(sim, down) == pytest.approx(G * (np.sin(angle) - 0.3 * np.cos(angle)), rel=0.01)
        else:
            step_well(sim, 100)
            assert np.linalg.norm(speed(sim, "block")) < 1e-5


def test_sliding_converges_with_the_first_order() -> None:
    """The way that a pushed block slides until it stops is v^2 / (2 mu g), but for an error of order dt."""
    wanted = 1.5**2 / (2.0 * 0.4 * G)
    errors = []
    for dt in (0.016, 0.004, 0.001):
        scene = turnbuckle.Scene("slide", dt=dt, contact={"friction": 0.4, "delta": 2e-3})
        scene.add_obstacle("floor", plane=[40.0, 40.0])
        scene.add_rigid("block", box=[0.2, 0.2, 0.05], position=[0.0, 0.0, 0.027], velocity=[0.9, 1.2, 0.0])
        sim = turnbuckle.Simulation(scene)
        step_well(sim, round(0.5 / dt))
        assert np.linalg.norm(speed(sim, "block")) < 1e-3
        way = centre(sim, "block")[:2]
        assert way @ np.array([0.8, -0.6]) == pytest.approx(0.0, abs=1e-3)
        errors.append(abs(float(way @ np.array([0.6, 0.8])) - wanted))
    assert errors[0] < 0.06 * wanted
    assert errors[1] < 0.35 * errors[0] and errors[2] < 0.35 * errors[1]


@pytest.mark.parametrize(("kind", "part"), [("rigid", 0.002), ("soft", 0.03)])
def test_dynamic_friction_holds_on_a_floor_of_many_triangles(kind: str, part: float) -> None:
    """A body that slides meets new triangles in every step; its friction stays that of sliding."""
    n, dt = 80, 0.01
    line = np.linspace(-0.9, 1.1, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line + 0.003, indexing="ij"))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    halves = [np.stack([corner, corner + n + 1, corner + n + 2], 1), np.stack([corner, corner + n + 2, corner + 1], 1)]
    scene = turnbuckle.Scene("fine", dt=dt, contact={"friction": 0.5, "dynamic_friction": 0.3, "delta": 1e-3})
    scene.add_obstacle("floor", vertices=np.stack([x, y, 0.0 * x], 1), triangles=np.concatenate(halves))
    if kind == "rigid":
        scene.add_rigid("block", box=[0.1, 0.1, 0.05], position=[0.0, 0.0, 0.0261], velocity=[1.5, 0.2, 0.0])
    else:
        box = {"size": [0.1, 0.1, 0.05], "cells": [2, 2, 1]}
        at = {"position": [-0.05, -0.05, 0.0011], "velocity": [1.5, 0.2, 0.0]}
        scene.add_solid("block", box=box, youngs_modulus=1e5, damping=0.01, **at)
    sim = turnbuckle.Simulation(scene)
    step_well(sim, 10)
    first = np.linalg.norm(speed(sim, "block"))
    step_well(sim, 15)
    assert first - np.linalg.norm(speed(sim, "block")) == pytest.approx(0.3 * G * 0.15, rel=part)
