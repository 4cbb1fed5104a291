"""Options of contact: scripts that wait, starts that intersect, strain limits, rows of velocities."""

import numpy as np
import pytest

import turnbuckle
from turnbuckle.contact.intersections import intersections

DT = 4e-3


def _sheet(scene: turnbuckle.Scene, height: float, cells: int = 6, size: float = 0.4, **more: object) -> None:
    scene.add_cloth(
        "cloth", size=[size, size], cells=[cells, cells], position=[-0.5 * size, -0.5 * size, height], density=0.3,
        **{"structural_stiffness": 200.0, "shear_stiffness": 50.0, "damping": 0.01, **more},
    )  # fmt: skip


def _pinch(integrator: str, **contact: object) -> turnbuckle.Simulation:
    """A press comes down on a cloth on a table, and would go through."""
    scene = turnbuckle.Scene("pinch", dt=DT, integrator=integrator, contact={"delta": 4e-3, **contact})
    keys = {"times": [0.0, 0.1], "positions": [[0, 0, 0.09], [0, 0, 0.04]], "interpolation": "linear"}
    scene.add_obstacle("press", box=[0.3, 0.3, 0.1], trajectory=keys)
    scene.add_obstacle("table", box=[0.3, 0.3, 0.1], position=[0, 0, -0.055])
    _sheet(scene, 0.003, cells=4, structural_stiffness=30.0, shear_stiffness=10.0)
    return turnbuckle.Simulation(scene)


def test_a_pinched_cloth_fails_with_the_pair_named() -> None:
    simulation = _pinch("implicit_euler")
    reports = [simulation.step() for _ in range(26)]
    failed = [r for r in reports if r.status == "failed"]
    assert failed and "'press' and 'cloth'" in failed[0].messages[0]


@pytest.mark.parametrize("integrator", ["implicit_euler", "euler_cromer"])
def test_scripts_wait_where_they_press(integrator: str) -> None:
    simulation = _pinch(integrator, on_impossible="stall")
    waited = []
    for _ in range(32):
        report = simulation.step()
        assert report.status in ("ok", "degraded"), report.messages
        waited += [m for m in report.messages if "scripts wait" in m]
    state, model = simulation.state, simulation.model
    assert len(waited) > 5 and "'press' and 'cloth'" in waited[0]
    assert state.script_delay == pytest.approx(len(waited) * DT)
    press = simulation.positions("press")
    assert np.allclose(press, model.scripted[0].positions(state.time - state.script_delay), atol=1e-12)
    assert -0.005 < press[:, 2].min() < 0.005
    assert model.surfaces is not None
    assert len(intersections(model.surfaces, model.surfaces.positions(state.positions()))) == 0


def _crossed_boxes() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("boxes", dt=DT, contact={"delta": 3e-3, "on_intersection": "grow"})
    scene.add_obstacle("ground", plane=[4, 4])
    scene.add_rigid("low", box=[0.2, 0.2, 0.1], position=[0.01, 0.02, 0.045], density=500.0)
    scene.add_rigid("high", box=[0.2, 0.2, 0.1], position=[0.03, 0.02, 0.14], density=500.0)
    return scene


def _crossed_solids() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("solids", dt=DT, contact={"delta": 3e-3, "on_intersection": "grow"})
    scene.add_obstacle("ground", plane=[4, 4])
    soft = {"youngs_modulus": 1e5, "poissons_ratio": 0.3, "density": 300.0, "damping": 0.01}
    box = {"size": [0.2, 0.2, 0.1], "cells": [2, 2, 1]}
    scene.add_solid("low", box=box, position=[0, 0, -0.005], **soft)
    scene.add_solid("high", box=box, position=[0.05, 0.03, 0.09], **soft)
    return scene


def _crossed_cloth() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("cloth", dt=DT, contact={"delta": 3e-3, "on_intersection": "grow"})
    scene.add_obstacle("ball", sphere=0.2)
    _sheet(scene, 0.195, cells=8)
    return scene


@pytest.mark.parametrize("make", [_crossed_boxes, _crossed_solids, _crossed_cloth])
def test_starts_that_intersect_are_let_apart(make) -> None:
    simulation = turnbuckle.Simulation(make())
    surfaces = simulation.model.surfaces
    assert surfaces is not None
    start = len(intersections(surfaces, surfaces.positions(simulation.state.positions())))
    assert start > 0
    fastest, told, last = 0.0, [], None
    for _ in range(120):
        report = simulation.step()
        assert report.status != "failed", report.messages
        fastest = max(fastest, report.energies["kinetic"])
        last = any("let apart" in m for m in report.messages)
        told.append(last)
    assert told[0] and not last
    assert told == sorted(told, reverse=True)  # once apart, apart
    assert len(intersections(surfaces, surfaces.positions(simulation.state.positions()))) == 0
    if "high" in [s.name for s in simulation.model.shapes]:  # what lay on top still does, and nothing was thrown
        low, high = (simulation.positions(name).mean(axis=0) for name in ("low", "high"))
        assert 0.09 < high[2] - low[2] < 0.115 and np.abs((high - low)[:2]).max() < 0.09
        assert fastest < 0.5


def test_an_intersecting_start_is_refused_by_default_also_after_a_change_by_hand() -> None:
    scene = turnbuckle.Scene("change", dt=DT, contact={"delta": 3e-3})
    scene.add_obstacle("ground", plane=[4, 4])
    scene.add_rigid("box", box=[0.2, 0.2, 0.1], position=[0, 0, 0.06], density=500.0)
    _sheet(scene, 0.3, cells=3)
    simulation = turnbuckle.Simulation(scene)
    assert simulation.step().status == "ok"
    simulation.set_pose("box", [0, 0, 0.03], [0, 0, 0, 1])
    report = simulation.step()
    assert report.status == "failed" and "'box' and 'ground'" in report.messages[0].replace(
        "'ground' and 'box'", "'box' and 'ground'"
    )
    simulation.set_pose("box", [0, 0, 0.06], [0, 0, 0, 1])
    x = np.array(simulation.positions())
    cloth = simulation.model.shape("cloth")
    x[cloth.begin : cloth.end, 2] -= 0.25
    simulation.state.set_positions(x)
    report = simulation.step()
    assert report.status == "failed" and "'cloth'" in report.messages[0]


@pytest.mark.parametrize("integrator", ["implicit_euler", "newmark", "velocity_verlet"])
def test_strain_limits_hold_and_keep_momentum(integrator: str) -> None:
    """A weak cloth, torn apart by its speeds in free flight."""
    scene = turnbuckle.Scene("limits", dt=2e-3, integrator=integrator, gravity=[0, 0, 0], contact={"delta": 1e-3})
    _sheet(scene, 0.0, cells=4, strain_limit=0.05, structural_stiffness=2.0, shear_stiffness=0.5)
    simulation = turnbuckle.Simulation(scene)
    x = np.array(simulation.positions())
    v = np.zeros_like(x)
    v[:, 0] = 10.0 * x[:, 0] + 0.3
    v[:, 1] = 4.0 * x[:, 0] * x[:, 1] + 0.1
    simulation.state.set_velocities(v)
    mass = simulation.model.mass[:, None]
    linear, angular = (mass * v).sum(axis=0), (mass * np.cross(x, v)).sum(axis=0)
    limits = simulation.model.strain_limits
    worst, energy = 0.0, 0.5 * float((mass * v * v).sum())
    for _ in range(40):
        report = simulation.step()
        assert report.status == "ok", report.messages
        x = simulation.positions()
        length = np.linalg.norm(x[limits.pairs[:, 1]] - x[limits.pairs[:, 0]], axis=1)
        worst = max(worst, float((length / limits.length).max()))
        total = report.energies["kinetic"] + report.energies["elastic"]
        assert total < energy * (1.0 + 1e-3)
    assert 0.99 < worst < 1.0 + 1.1e-3
    v = simulation.velocities()
    assert np.allclose((mass * v).sum(axis=0), linear, atol=1e-3 * np.abs(linear).max())
    assert np.allclose((mass * np.cross(x, v)).sum(axis=0), angular, atol=2e-3 * float((mass * 0.2 * np.abs(v)).sum()))


def test_rows_of_velocities_keep_apart_too_and_further_than_needed() -> None:
    """Non-approaching velocities stop a body as soon as it is near (Contact, section 4): a gap stays open."""
    gaps = {}
    for rows in ("position", "velocity"):
        scene = turnbuckle.Scene("drop", dt=DT, contact={"delta": 4e-3, "rows": rows})
        scene.add_obstacle("ground", plane=[4, 4])
        scene.add_rigid("box", box=[0.2, 0.2, 0.1], position=[0, 0, 0.08], density=500.0)
        simulation = turnbuckle.Simulation(scene)
        lowest = np.inf
        for _ in range(60):
            report = simulation.step()
            assert report.status == "ok", report.messages
            assert report.smallest_gap is None or report.smallest_gap > 0.0
            lowest = min(lowest, simulation.center("box")[2] - 0.05)
        gaps[rows] = simulation.center("box")[2] - 0.05
        assert np.abs(simulation.velocity("box")[0]).max() < 1e-3
        assert lowest > 1e-3
    assert gaps["position"] == pytest.approx(4e-3, abs=5e-4)
    assert gaps["velocity"] > gaps["position"] - 1e-4
