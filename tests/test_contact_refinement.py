"""Which crossings become rows, and looks at a motion that differs little from the last one."""

import numpy as np
import pytest

import turnbuckle
from turnbuckle.contact.detector import Detector
from turnbuckle.contact.manifold import first_met, no_contacts
from turnbuckle.contact.surface import SurfacePart, make_surfaces
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Contacts, Surfaces
from turnbuckle.scenes import REGISTRY


def crossings(kind: list[int], a: list[int], b: list[int], time: list[float]) -> Contacts:
    n = len(kind)
    i = np.int32
    return Contacts(np.array(kind, i), np.array(a, i), np.array(b, i), np.zeros((n, 4), i), np.zeros((n, 4)),
                    np.zeros((n, 3)), np.zeros(n), np.array(time))  # fmt: skip


def test_each_vertex_and_edge_keeps_what_it_meets_first() -> None:
    v, e = VERTEX_FACE, EDGE_EDGE
    found = crossings([v, v, v, e, e, e], [3, 3, 4, 1, 1, 2], [7, 8, 7, 2, 5, 5], [0.5, 0.2, 0.9, 0.3, 0.4, 0.1])
    kept = first_met(found)
    # vertex 3 meets face 8 first; vertex 4 has one face; edge 1 meets 2 first, edges 2 and 5 each other
    assert [(k, a, b) for k, a, b in zip(kept.kind, kept.a, kept.b, strict=True)] == [
        (v, 3, 8), (v, 4, 7), (e, 1, 2), (e, 2, 5),
    ]  # fmt: skip
    assert first_met(no_contacts()).count == 0


def falling_block(**more) -> turnbuckle.Simulation:
    scene = turnbuckle.Scene("block", dt=0.02, contact={"friction": 0.3})
    scene.add_obstacle("plate", box=[1.0, 1.0, 0.02], position=[0, 0, 0])
    scene.add_solid("block", box={"size": [0.2, 0.2, 0.2], "cells": [2, 2, 2]}, position=[0.013, 0.007, 0.05],
                    rotation=[0.1, 0.2, 0.0], youngs_modulus=1e5, poissons_ratio=0.3, density=1000.0, **more)  # fmt: skip
    return turnbuckle.Simulation(scene)


def detector_of(simulation: turnbuckle.Simulation) -> Detector:
    return simulation.stepper.detector


def test_rows_of_a_motion_through_a_body_are_for_its_front() -> None:
    simulation = falling_block()
    detector = detector_of(simulation)
    s0 = simulation.model.surfaces.positions(simulation.state.positions())
    through = s0.copy()
    through[simulation.model.surfaces.shape == 1] -= [0.0, 0.0, 0.6]  # all the way through the plate
    found = detector.crossed(s0, through)
    chosen = detector.chosen(found, s0)
    assert (np.abs(found.normal[:, 2]) > 0.9).any() and (found.normal[:, 2] < -0.1).any()  # both sides are crossed
    body_above = simulation.model.surfaces.shape[chosen.vertices[:, 0]] == 1
    up = np.where(body_above, chosen.normal[:, 2], -chosen.normal[:, 2])
    assert 0 < chosen.count < found.count
    assert (up > -1e-9).all()


def test_a_second_look_finds_what_a_fresh_one_does() -> None:
    simulation = falling_block(velocity=[0, 0, -2.0])
    s0 = simulation.model.surfaces.positions(simulation.state.positions())
    rng = np.random.default_rng(5)
    known, fresh = detector_of(simulation), detector_of(falling_block())
    motion = np.where((simulation.model.surfaces.shape == 1)[:, None], [0.02, 0.01, -0.12], [0.0, 0.0, 0.0])
    slack, hits = 2e-3, 0
    for k in range(24):
        s1 = s0 + motion + rng.uniform(-1.0, 1.0, s0.shape) * 0.2 * slack * rng.random()
        if k % 3 == 2:  # some end far away, which is searched for them alone
            s1[rng.integers(0, len(s0), 2)] += rng.uniform(-0.05, 0.05, 3)
        fresh.forget()
        found, wanted = known.crossed(s0, s1), fresh.crossed(s0, s1)
        hits += wanted.count
        assert known.smallest_gap <= fresh.smallest_gap + 1e-12
        np.testing.assert_array_equal(found.kind, wanted.kind)
        np.testing.assert_array_equal(found.a, wanted.a)
        np.testing.assert_array_equal(found.b, wanted.b)
    assert hits > 0


@pytest.mark.parametrize("ahead", [0.0, 5e-4, 5e-2])
def test_one_search_serves_what_is_near_and_what_is_on_the_way(ahead: float) -> None:
    simulation, other = falling_block(), falling_block()
    s0 = simulation.model.surfaces.positions(simulation.state.positions())
    towards = s0 - [0.0, 0.0, ahead]
    one, two = detector_of(simulation), detector_of(other)
    near, wanted = one.near(s0, towards), two.near(s0)
    np.testing.assert_array_equal(near.a, wanted.a)
    np.testing.assert_array_equal(near.b, wanted.b)
    s1 = towards - [0.0, 0.0, 1e-4]
    s1[simulation.model.surfaces.shape == 0] = s0[simulation.model.surfaces.shape == 0]
    np.testing.assert_array_equal(one.crossed(s0, s1).a, two.crossed(s0, s1).a)


def test_rounds_of_letters_are_few() -> None:
    """Letters that fall on each other at 3 m/s: what the first solve is told leaves little to find."""
    simulation = turnbuckle.Simulation(REGISTRY["letters"](count=6, across=2, press=0.0))
    rounds = []
    for _ in range(22):
        report = simulation.step()
        assert report.status == "ok" and report.intersections == 0
        rounds.append(report.rounds)
    assert max(rounds) <= 5 and np.mean(np.array(rounds) <= 3) > 0.9


def facing(gaps: list[float], delta: float) -> tuple[Surfaces, np.ndarray]:
    """Pairs of triangles, each a vertex over a face at a gap [m]."""
    below, above = (
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        np.array([[0.2, 0.2, 0.0], [1.2, 0.2, 1.0], [0.2, 1.2, 1.0]]),
    )
    x = np.concatenate(
        [part for k, gap in enumerate(gaps) for part in (below + [5.0 * k, 0, 0], above + [5.0 * k, 0, gap])]
    )
    one = np.array([[0, 1, 2]])
    parts = [SurfacePart(k, np.arange(3 * k, 3 * k + 3), triangles=one, delta=delta) for k in range(2 * len(gaps))]
    return make_surfaces(parts, x), x


def test_the_gap_that_is_told_is_kept() -> None:
    """By a pair that is nearer than what makes rows from the start, and by one that comes so near but not too near."""
    surfaces, x0 = facing([0.033, 0.05], 0.1)
    x1 = x0.copy()
    x1[3:6] -= [0.0, 0.0, 0.0025]
    x1[9:12] -= [0.0, 0.0, 0.0175]
    detector = Detector(surfaces, np.ones(len(x0), dtype=bool))
    assert detector.crossed(x0, x1).count == 0
    assert 0.029 < detector.smallest_gap <= 0.0305
    far, x0 = facing([0.2], 0.1)  # beyond delta nothing is looked for
    other = Detector(far, np.ones(len(x0), dtype=bool))
    assert other.crossed(x0, x0).count == 0 and not 0.1 < other.smallest_gap < np.inf


def test_surfaces_that_keep_no_distance_do_not_cross_either() -> None:
    surfaces, x0 = facing([0.1], 0.0)
    x1 = x0.copy()
    x1[3:] -= [0.0, 0.0, 0.3]
    assert Detector(surfaces, np.ones(len(x0), dtype=bool)).crossed(x0, x1).count > 0
