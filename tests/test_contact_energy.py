"""Energy in contact: what lies too near is lifted, not thrown; what is stored, lost and given adds up."""

from pathlib import Path

import numpy as np
import pytest
from contact_measures import step_well

import turnbuckle
from turnbuckle.io import checkpoint

DELTA = 2e-3
KEPT = {"contact_delta": DELTA}


def total(report: turnbuckle.StepReport) -> float:
    """Energy that bodies have and have lost, less what they were given [J]."""
    e = report.energies
    return e["kinetic"] + e["elastic"] + e["gravity"] + e["dissipation"] - e["work"]


def too_near(kind: str, scheme: str, dt: float) -> turnbuckle.Simulation:
    """Bodies of 1 kg at rest a fifth of delta over a floor, and over each other."""
    scene = turnbuckle.Scene("near", dt=dt, integrator=scheme, contact={"friction": 0.4})
    scene.add_obstacle("floor", plane=[2.0, 2.0], **KEPT)
    gap = 0.2 * DELTA
    if kind == "ball":
        scene.add_rigid("ball", sphere=0.1, mass=1.0, position=[0.0, 0.0, 0.1 + gap], **KEPT)
    for k in range(3 if kind == "stack" else 0):
        scene.add_rigid(f"box{k}", box=[0.2] * 3, mass=1.0, position=[0.0, 0.0, 0.1 + gap + k * (0.2 + gap)], **KEPT)
    return turnbuckle.Simulation(scene)


@pytest.mark.parametrize("dt", [pytest.param(0.002, marks=pytest.mark.slow), 0.01])
@pytest.mark.parametrize("scheme", ["implicit_euler", "newmark", "velocity_verlet"])
@pytest.mark.parametrize("kind", ["ball", "stack"])
def test_what_lies_too_near_is_let_apart_and_does_not_hop(kind: str, scheme: str, dt: float) -> None:
    """It moves apart at up to 0.05 m/s; as velocity that were 1e-3 J for each kilogram."""
    sim = too_near(kind, scheme, dt)
    first = sim.positions()[-1, 2]
    before, height = first, first
    for _ in range(round(0.12 / dt)):
        report = step_well(sim, 1)[0]
        assert report.energies["kinetic"] < 1e-6
        height = sim.positions()[-1, 2]
        assert height >= before - 1e-3 * DELTA, "it never falls back"
        before = height
    layers = 3 if kind == "stack" else 1
    assert 0.3 * DELTA < (height - first) / layers < 0.45 * DELTA, "up to 0.6 delta"


def test_parting_is_the_only_thing_that_lifts() -> None:
    """Under backward Euler the lift is counted as work: the rest never grows, and all adds up."""
    sim = too_near("stack", "implicit_euler", 0.005)
    reports = step_well(sim, 30)
    np.testing.assert_allclose([total(r) for r in reports], total(reports[0]), atol=1e-10)
    lost = np.array([r.energies["dissipation"] for r in reports])
    assert (np.diff(lost) > -1e-5).all()
    lift = reports[-1].energies["gravity"] - reports[0].energies["gravity"]
    given = reports[-1].energies["work"] - reports[0].energies["work"]
    assert lift > 0.02 and given == pytest.approx(lift, rel=0.1)


@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_an_impact_without_bounce_takes_half(dt: float) -> None:
    """A box runs into another of the same mass: they go on together."""
    scene = turnbuckle.Scene("impact", dt=dt, gravity=[0.0, 0.0, 0.0], contact={"friction": 0.0})
    scene.add_rigid("a", box=[0.2] * 3, mass=1.0, position=[-0.25, 0.0, 0.0], velocity=[2.0, 0.0, 0.0])
    scene.add_rigid("b", box=[0.2] * 3, mass=1.0)
    sim = turnbuckle.Simulation(scene)
    reports = step_well(sim, round(0.2 / dt))
    np.testing.assert_allclose([total(r) for r in reports], 2.0, atol=1e-9)
    assert reports[-1].energies["kinetic"] == pytest.approx(1.0, rel=0.02)
    assert reports[-1].energies["dissipation"] == pytest.approx(1.0, rel=0.02)
    assert reports[-1].energies["work"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("by", ["obstacle", "nails"])
def test_what_a_script_gives_is_work(by: str) -> None:
    """A paddle at V meets a body of mass m at rest: it does m V^2, half of which is lost."""
    speed, mass = 0.5, 2.0
    scene = turnbuckle.Scene("paddle", dt=2e-3, gravity=[0.0, 0.0, 0.0], contact={"friction": 0.0})
    if by == "obstacle":
        way = {
            "interpolation": "linear",
            "times": [0.0, 2.0],
            "positions": [[-0.22, 0.0, 0.0], [-0.22 + 2.0 * speed, 0.0, 0.0]],
        }
        scene.add_obstacle("paddle", box=[0.1, 0.6, 0.6], trajectory=way)
    else:
        scene.add_cloth(
            "paddle", size=[0.6, 0.6], cells=[2, 2], position=[-0.16, -0.3, 0.3], rotation=[0, 0.5 * np.pi, 0]
        )
        goal = {"times": [0.0, 2.0], "offsets": [[0.0] * 3, [2.0 * speed, 0.0, 0.0]]}
        scene.add_constraint("nail", "hand", points={"body": "paddle", "all": True}, goal=goal)
    scene.add_rigid("body", box=[0.2] * 3, mass=mass)
    sim = turnbuckle.Simulation(scene)
    first = step_well(sim, 1)[0]
    reports = step_well(sim, 199)
    np.testing.assert_allclose([total(r) for r in reports], total(first), atol=1e-9)
    assert np.linalg.norm(sim.velocity("body")[0] - [speed, 0.0, 0.0]) < 0.01 * speed
    given = reports[-1].energies["work"] - first.energies["work"]
    assert given == pytest.approx(mass * speed**2, rel=0.02)
    lost = reports[-1].energies["dissipation"] - first.energies["dissipation"]
    assert lost == pytest.approx(0.5 * mass * speed**2, rel=0.02)


@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_energies_of_a_collision_add_up(dt: float) -> None:
    """Rigid and soft bodies and a cloth fall on each other: no step gives energy back, however hard the impact."""
    scene = turnbuckle.Scene("heap", dt=dt, contact={"friction": 0.3})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    scene.add_rigid("box", box=[0.2] * 3, density=500.0, position=[0.0, 0.0, 0.15], velocity=[0.3, 0.0, -1.0])
    soft = {"youngs_modulus": 1e5, "density": 500.0, "position": [-0.08, -0.1, 0.3]}
    scene.add_solid("soft", box={"size": [0.2] * 3, "cells": [2, 2, 2]}, velocity=[0.0, 0.0, -2.0], **soft)
    scene.add_cloth("cloth", size=[0.5, 0.5], cells=[6, 6], position=[-0.25, -0.25, 0.55], density=0.3)
    sim = turnbuckle.Simulation(scene)
    reports = step_well(sim, round(0.25 / dt))
    start = total(reports[0])
    np.testing.assert_allclose([total(r) for r in reports], start, rtol=1e-9)
    lost = np.array([r.energies["dissipation"] for r in reports])
    assert lost[-1] - lost[0] > 0.2 * start
    assert (np.diff(lost) > -1e-4 * start).all()


def struck(scheme: str) -> turnbuckle.Simulation:
    """A strip that falls on a sheet that hangs by two corners, at 20 ms."""
    scene = turnbuckle.Scene("struck", dt=0.02, integrator=scheme, contact={"friction": 0.3})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    scene.add_cloth("cloth", size=[0.6, 0.6], cells=[5, 5], position=[-0.3, -0.3, 0.2], density=0.2)
    scene.add_constraint("nail", "corners", points={"body": "cloth", "indices": [0, 5]})
    scene.add_cloth("strip", size=[0.4, 0.05], cells=[8, 1], position=[-0.2, 0.0, 0.4], density=0.3)
    return turnbuckle.Simulation(scene)


@pytest.mark.parametrize("scheme", ["newmark", "implicit_euler"])
def test_stiff_cloth_that_is_struck_makes_no_energy(scheme: str) -> None:
    """At 20 ms average acceleration alone makes ten thousand times the energy there is, once springs turn and give way."""
    there = []
    for report in step_well(struck(scheme), 50):
        e = report.energies
        there.append(e["kinetic"] + e["elastic"] + e["gravity"] - e["work"])
    assert (there - np.minimum.accumulate(there)).max() < 1e-3 * there[0]
    assert there[-1] < 0.3 * there[0]


def test_steps_that_are_made_again_are_the_same_in_a_run_that_goes_on(tmp_path: Path) -> None:
    """What a step gained is known from its own start alone: from a checkpoint, too."""
    sim, ends = struck("newmark"), []
    for k in range(24):
        checkpoint.save(tmp_path / f"{k}.npz", sim.model, sim.state)
        sim.step()
        ends.append(sim.positions().copy())
    for k in range(8, 24, 3):
        other = struck("newmark")
        checkpoint.load(tmp_path / f"{k}.npz", other.model, other.state)
        other.step()
        np.testing.assert_array_equal(other.positions(), ends[k], err_msg=f"step {k}")
