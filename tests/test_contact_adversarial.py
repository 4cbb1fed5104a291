"""Shapes that break contact: spikes, wedges, cracks, cliffs, slivers and doubled points, far from the origin and tiny."""

import numpy as np
import pytest
from contact_measures import centre, speed, step_well

import turnbuckle
from turnbuckle.contact.intersections import intersections
from turnbuckle.step.simulation import Simulation

SHORT = pytest.param(0.004, marks=pytest.mark.slow)
WOVEN = {"bend_model": "hinges", "bend_stiffness": 2e-5, "structural_stiffness": 300.0, "damping": 0.02, "density": 0.3}


def kept_apart(sim: Simulation, seconds: float) -> list[turnbuckle.StepReport]:
    """Step; nothing fails, everything is finite, and no committed state intersects."""
    reports = []
    surfaces = sim.model.surfaces
    assert surfaces is not None
    for _ in range(round(seconds / sim.dt)):
        reports += step_well(sim, 1)
        x = sim.state.positions()
        assert np.isfinite(x).all()
        assert len(intersections(surfaces, surfaces.positions(x))) == 0
        assert reports[-1].smallest_gap is None or reports[-1].smallest_gap > 0.0
    return reports


def energy(report: turnbuckle.StepReport) -> float:
    return sum(report.energies[name] for name in ("kinetic", "elastic", "gravity"))


def spike(width: float, height: float) -> dict:
    """A pyramid."""
    w = 0.5 * width
    points = [[-w, -w, 0.0], [w, -w, 0.0], [w, w, 0.0], [-w, w, 0.0], [0.0, 0.0, height]]
    return {"vertices": points, "triangles": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]]}


@pytest.mark.parametrize("dt", [SHORT, 0.015])
@pytest.mark.parametrize("place", [[0.0, 0.0], [0.013, -0.007]])
def test_cloth_falls_on_a_spike(dt: float, place: list[float]) -> None:
    """A needle 4 mm wide at its foot and 20 cm high, under a vertex or under the inside of a triangle."""
    scene = turnbuckle.Scene("spike", dt=dt, contact={"friction": 0.3})
    scene.add_obstacle("needle", position=[*place, 0.0], **spike(4e-3, 0.2))
    scene.add_cloth("cloth", size=[0.3, 0.3], cells=[8, 8], position=[-0.15, -0.15, 0.25], **WOVEN)
    sim = Simulation(scene)
    reports = kept_apart(sim, 0.3)
    assert max(report.touching for report in reports) > 0
    x = sim.positions("cloth")
    near = np.linalg.norm(x[:, :2] - place, axis=1) < 0.03
    assert x[near, 2].max() > 0.17, "it hangs on the tip"
    assert x[:, 2].min() < 0.15, "and its corners have fallen"


@pytest.mark.parametrize("dt", [SHORT, 0.015])
@pytest.mark.parametrize("kind", ["ball", "soft"])
def test_something_falls_into_a_wedge(kind: str, dt: float) -> None:
    """A groove of 40 degrees without friction: it comes to rest in the middle, on both walls."""
    scene = turnbuckle.Scene("wedge", dt=dt, contact={"friction": 0.0})
    lean = np.radians(70.0)
    for name, side in (("left", -1.0), ("right", 1.0)):
        wall = [
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [side * np.cos(lean), 0.5, np.sin(lean)],
            [side * np.cos(lean), -0.5, np.sin(lean)],
        ]
        wall = np.array(wall) + [side * 1e-3, 0.0, 0.0]
        scene.add_obstacle(name, vertices=wall, triangles=[[0, 1, 2], [0, 2, 3]])
    at = {"position": [0.01, 0.0, 0.45], "velocity": [0.0, 0.0, -2.0]}
    if kind == "ball":
        scene.add_rigid("body", sphere=0.08, **at)
    else:
        scene.add_solid("body", box={"size": [0.1] * 3, "cells": [2, 2, 2]}, youngs_modulus=1e5, damping=0.01, **at)
    sim = Simulation(scene)
    start = energy(step_well(sim, 1)[0])
    reports = kept_apart(sim, 0.6)
    assert max(energy(report) for report in reports) <= start * (1.0 + 1e-6)
    assert abs(centre(sim, "body")[0]) < 0.02
    assert np.linalg.norm(speed(sim, "body")) < 0.3


@pytest.mark.parametrize("dt", [SHORT, 0.015])
def test_a_plate_goes_down_a_crack(dt: float) -> None:
    """A plate of 10 mm falls into a crack of 16 mm between two blocks; a wide one bridges it."""
    scene = turnbuckle.Scene("crack", dt=dt, contact={"friction": 0.1})
    for name, side in (("left", -1.0), ("right", 1.0)):
        scene.add_obstacle(name, box=[0.3, 0.5, 0.4], position=[side * (0.15 + 0.008), 0.0, -0.2])
    scene.add_rigid("plate", box=[0.01, 0.2, 0.2], position=[0.0, 0.0, 0.12], velocity=[0.0, 0.0, -1.0], density=500.0)
    scene.add_rigid("bridge", box=[0.06, 0.05, 0.05], position=[0.0, 0.18, 0.04], density=500.0)
    sim = Simulation(scene)
    kept_apart(sim, 0.25)
    assert centre(sim, "plate")[2] < -0.05
    assert 0.02 < centre(sim, "bridge")[2] < 0.03


@pytest.mark.parametrize("dt", [SHORT, 0.015])
def test_a_block_slides_over_a_cliff(dt: float) -> None:
    """The cliff's edge holds nothing back; over it the block tips and falls."""
    scene = turnbuckle.Scene("cliff", dt=dt, contact={"friction": 0.0})
    scene.add_obstacle("table", box=[0.6, 0.6, 0.3], position=[-0.3, 0.0, -0.15])
    scene.add_rigid("block", box=[0.1, 0.1, 0.06], position=[-0.15, 0.02, 0.0315], velocity=[1.5, 0.0, 0.0])
    sim = Simulation(scene)
    along = []
    for _ in range(round(0.45 / dt)):
        kept_apart(sim, dt)
        along.append(speed(sim, "block")[0])
    assert min(along) > 1.4, "nothing is caught at the edge"
    assert centre(sim, "block")[2] < -0.2


@pytest.mark.parametrize(
    ("scale", "offset"),
    [(1.0, 1e6), (1e-6, 0.0), *(pytest.param(*given, marks=pytest.mark.slow) for given in ((1e-3, 1e3), (1e3, 0.0)))],
)
def test_far_away_and_tiny(scale: float, offset: float) -> None:
    """A ball and a box fall on a floor and rest, at any size and place; times go with the root of the size."""
    dt = 0.004 * np.sqrt(scale)
    far = np.array([offset, -offset, offset])
    scene = turnbuckle.Scene("scaled", dt=dt, contact={"friction": 0.4})
    scene.add_obstacle("floor", box=scale * np.array([1.0, 1.0, 0.2]), position=far - scale * np.array([0.0, 0.0, 0.1]))
    scene.add_rigid("ball", sphere=0.1 * scale, position=far + scale * np.array([-0.2, 0.0, 0.12]))
    scene.add_rigid(
        "box", box=[0.2 * scale] * 3, position=far + scale * np.array([0.2, 0.0, 0.15]), rotation=[0.1, 0.0, 0.0]
    )
    sim = Simulation(scene)
    reports = kept_apart(sim, 80 * dt)
    assert all(report.status == "ok" for report in reports)
    for name in ("ball", "box"):
        height = (centre(sim, name)[2] - offset) / scale
        assert 0.1 < height < 0.103
        assert np.linalg.norm(speed(sim, name)) < 0.02 * np.sqrt(scale)


def test_a_mesh_with_slivers_doubled_points_and_faces_without_area() -> None:
    """A floor as scanners and careless modellers give it holds a box and a cloth, and the same as a clean one."""
    rest = []
    for bad in (False, True):
        scene = turnbuckle.Scene("floor", dt=0.004, contact={"friction": 0.4, "delta": 2e-3})
        points = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]
        triangles = [[0, 1, 2], [0, 2, 3]]
        if bad:
            points += [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0], [1e-7, 0.5, 0.0], [0.2, 0.1, 0.0], [0.2, 0.1, 0.0]]
            triangles = [[0, 4, 5], [0, 5, 3], [4, 6, 5], [4, 1, 7], [1, 2, 7], [2, 6, 7], [6, 4, 7]]  # a sliver: 4 6 5
            points += [[0.0, 0.1, 0.0]]
            triangles += [[1, 7, 8], [4, 5, 9]]  # no area: doubled points, a line
        scene.add_obstacle("floor", vertices=points, triangles=triangles)
        scene.add_rigid("box", box=[0.15, 0.15, 0.1], position=[0.02, 0.03, 0.08], rotation=[0.05, 0.02, 0.0])
        scene.add_cloth(
            "cloth", size=[0.2, 0.2], cells=[5, 5], position=[-0.4, -0.1, 0.05], rotation=[0.1, 0.1, 0.0], **WOVEN
        )
        sim = Simulation(scene)
        kept_apart(sim, 0.4)
        rest.append(centre(sim, "box"))
        assert sim.positions("cloth")[:, 2].min() > 0.0
    np.testing.assert_allclose(rest[0], rest[1], atol=2e-3)
