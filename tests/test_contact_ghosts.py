"""Contacts found on the way at edges inside of a surface: left out beside others, never lost, and harmless to what slides."""

import math

import numpy as np
import pytest
from contact_measures import speed, step_well

import turnbuckle
from turnbuckle.contact.detector import Detector, each_place_once
from turnbuckle.contact.ghosts import Ghosts
from turnbuckle.contact.manifold import first_met
from turnbuckle.data.contact import Surfaces
from turnbuckle.step.simulation import Simulation


def grid(n: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    """A level floor of 2 n^2 triangles."""
    line = np.linspace(-0.5 * size, 0.5 * size, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    halves = [np.stack([corner, corner + n + 1, corner + n + 2], 1), np.stack([corner, corner + n + 2, corner + 1], 1)]
    return np.stack([x, y, 0.0 * x], 1), np.concatenate(halves)


def sliding(kind: str, dt: float, proximity: bool) -> Simulation:
    points, triangles = grid(40, 2.0)
    scene = turnbuckle.Scene("slide", dt=dt, contact={"friction": 0.0, "proximity": proximity})
    scene.add_obstacle("floor", vertices=points, triangles=triangles)
    moving = {"position": [-0.6, 0.013, 0.15], "velocity": [4.0, 0.3, -2.0]}
    if kind == "ball":
        scene.add_rigid("body", sphere=0.06, **moving)
    else:
        scene.add_cloth("body", size=[0.3, 0.3], cells=[6, 6], rotation=[0.3, 0.2, 0.1], **moving)
    return Simulation(scene)


@pytest.mark.parametrize(
    ("kind", "proximity", "kept"),
    [("ball", True, 0.99), ("ball", False, 0.98), ("cloth", True, 0.95), ("cloth", False, 0.85)],
)
def test_what_slides_without_friction_keeps_its_way(kind: str, proximity: bool, kept: float) -> None:
    """A level floor pushes up and nothing else, however many edges are inside of it.

    What is lost is lost to facets of the body that tilt. Borders of triangles on the way took 8 % to all of it.
    """
    sim = sliding(kind, 0.01, proximity)
    touched = sum(report.touching > 0 for report in step_well(sim, 18))
    assert touched > 2
    assert speed(sim, "body")[0] > kept * 4.0
    assert abs(speed(sim, "body")[1] - 0.3) < 0.12


@pytest.fixture(scope="module")
def over_a_floor() -> tuple[Surfaces, Detector]:
    """A tetrahedron of 2 cm over a grid of 5 cm, its tip down."""
    points, triangles = grid(4, 0.2)
    scene = turnbuckle.Scene("tip", contact={"delta": 4e-3})
    scene.add_obstacle("floor", vertices=points, triangles=triangles)
    tip = np.array([[0.0, 0.0, 0.0], [-0.01, -0.01, 0.02], [0.01, -0.01, 0.02], [0.0, 0.01, 0.02]])
    scene.add_rigid("tip", vertices=tip + [0.0, 0.0, 0.01], triangles=[[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    model, _ = scene.build()
    surfaces = model.surfaces
    assert surfaces is not None
    return surfaces, Detector(surfaces, surfaces.shape == 1)


def ends(surfaces: Surfaces, place: list[float], way: list[float]) -> tuple[np.ndarray, np.ndarray]:
    points, _ = grid(4, 0.2)
    tip = np.array([[0.0, 0.0, 0.0], [-0.01, -0.01, 0.02], [0.01, -0.01, 0.02], [0.0, 0.01, 0.02]])
    x0 = np.concatenate([points, tip + place])
    x1 = x0.copy()
    x1[surfaces.shape == 1] += way
    return x0, x1


@pytest.mark.parametrize(
    "place", [[0.005, 0.0005, 0.01], [0.012, 0.013, 0.01], [0.0, 0.0002, 0.01], [0.03, 0.001, 0.01]]
)
@pytest.mark.parametrize("way", [[0.0, 0.0, -0.02], [0.05, 0.02, -0.02], [-0.04, 0.04, -0.015]])
def test_only_the_floor_itself_is_left(over_a_floor: tuple[Surfaces, Detector], place: list, way: list) -> None:
    surfaces, detector = over_a_floor
    x0, x1 = ends(surfaces, place, way)
    every = detector.crossed(x0, x1)
    found = every.part(~Ghosts(surfaces).find(every, x0, x1))
    assert found.count >= 1
    # The tip's normal is up: neighbours across an edge, whose nearest places are on their borders, are gone.
    assert np.abs(found.normal[:, 2]).min() > 0.97


def test_ghosts_are_left_out_once(over_a_floor: tuple[Surfaces, Detector]) -> None:
    """So refinement ends: first rows are without ghosts, those of later rounds with them, and where all are, all are told."""
    surfaces, detector = over_a_floor
    x0, x1 = ends(surfaces, [0.005, 0.0005, 0.01], [0.05, 0.02, -0.02])
    every = detector.crossed(x0, x1)
    ghost = Ghosts(surfaces).find(every, x0, x1)
    assert 0 < ghost.sum() < every.count
    chosen = detector.chosen(every, x0)
    assert 0 < chosen.count and not Ghosts(surfaces).find(chosen, x0, x1).any()
    ghosts = every.part(ghost)
    assert detector.chosen(ghosts, x0).count > 0
    assert first_met(ghosts).count > 0


def test_corners_and_edges_that_meet_are_no_ghosts() -> None:
    """Of two boxes that meet edge on edge and corner on corner, what is nearest is kept."""
    for turn, place in (([0.78, 0.0, 0.0], [0.03, 0.05, 0.34]), ([0.6, 0.5, 0.2], [0.02, 0.17, 0.35])):
        scene = turnbuckle.Scene("meet", contact=True, gravity=[0.0, 0.0, 0.0])
        scene.add_rigid("low", box=[0.2, 0.6, 0.2], rotation=[0.0, 0.78, 0.0])
        scene.add_rigid("high", box=[0.2] * 3, position=place, rotation=turn)
        model, state = scene.build()
        surfaces = model.surfaces
        assert surfaces is not None
        x0 = surfaces.positions(state.positions())
        x1 = x0.copy()
        x1[surfaces.shape == 1] -= [0.0, 0.0, 0.15]
        detector = Detector(surfaces, np.ones(surfaces.vertices, bool))
        pairs = detector.broad.candidates(x0, x1, surfaces.delta)
        found = detector.ccd.first_impacts(pairs, x0, x1, 0.5 * detector.deltas(pairs.kind, pairs.a, pairs.b))[0]
        assert found.count
        ghost = Ghosts(surfaces).find(found, x0, x1)
        assert not ghost[np.argmin(found.time)], "the first impact of all is at a minimum"


def test_a_place_that_several_pairs_share_is_told_once(over_a_floor: tuple[Surfaces, Detector]) -> None:
    """A tip that falls on an edge inside of the floor meets two faces and that edge by its own three, at one place."""
    surfaces, detector = over_a_floor
    x0, x1 = ends(surfaces, [0.0, 0.012, 0.01], [0.0, 0.0, -0.02])  # x = 0 is a line of the grid
    every = detector.crossed(x0, x1)
    tip = (every.kind == 0) & (every.a == np.flatnonzero(surfaces.shape == 1)[0])
    assert tip.sum() >= 2 and every.count > tip.sum()
    once = each_place_once(every)
    places = np.where(np.abs(once.coefficients) > 1e-9, once.vertices, -1)
    assert len({tuple(sorted(row)) for row in places.tolist()}) == once.count
    assert once.count < every.count


def test_both_sides_of_a_sharp_fold_are_no_ghosts_for_long() -> None:
    """The sides of a fold are nearest at the fold itself, where they are one: no place on them is at a minimum."""
    wide, angle = 0.1, 0.12  # [m], [rad] between both halves
    points = [[0.0, y, 0.0] for y in (0.0, wide)]
    for sign in (1.0, -1.0):
        points += [[x * math.cos(angle), y, sign * x * math.sin(angle)] for x in (0.05, 0.1) for y in (0.0, wide)]
    faces = [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [0, 1, 6], [1, 7, 6], [6, 7, 8], [7, 9, 8]]
    scene = turnbuckle.Scene("fold", contact={"delta": 0.03}, gravity=[0.0, 0.0, 0.0])
    scene.add_cloth("sheet", vertices=points, triangles=faces, mass=0.01)
    model, state = scene.build()
    surfaces = model.surfaces
    assert surfaces is not None
    x0 = surfaces.positions(state.positions())
    x1 = x0 * [1.0, 1.0, 0.1]
    detector = Detector(surfaces, np.ones(surfaces.vertices, bool))
    ghosts = Ghosts(surfaces)
    found = each_place_once(detector.crossed(x0, x1))
    folded = ghosts.in_folds(found) & (found.distance < 0.03)
    assert (folded & ghosts.find(found, x0, x1)).any()
    chosen = detector.chosen(found, x0)
    names = {tuple(row) for row in np.stack([chosen.kind, chosen.a, chosen.b], axis=1).tolist()}
    assert names >= {tuple(row) for row in np.stack([found.kind, found.a, found.b], axis=1)[folded].tolist()}
