"""A point that slides on a triangulated surface (Local, 4.4) stays on it, crosses its edges, and pushes it in turn."""

import numpy as np
import pytest
from laboratory import Run, rope, size
from reference import schemes


def closest(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights (3,) of the place of a triangle closest to ``p``: inside its plane, else the best of its three edges."""
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    share = np.linalg.lstsq(np.stack([a, b], axis=1), p - corners[0], rcond=None)[0]
    inside = np.array([1.0 - share.sum(), *share])
    if inside.min() >= 0.0:
        return inside
    best, weights = np.inf, inside
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge = corners[j] - corners[i]
        t = np.clip((p - corners[i]) @ edge / (edge @ edge), 0.0, 1.0)
        distance = np.linalg.norm(corners[i] + t * edge - p)
        if distance < best:
            best, weights = distance, np.zeros(3)
            weights[i], weights[j] = 1.0 - t, t
    return weights


def bead_on_a_sheet(name: str) -> tuple[Run, np.ndarray]:
    """A bead of 0.1 kg at 1 m/s on a floating, waving net of 2 kg; and the triangles, as indices of points."""
    start = np.array([0.2, 0.31, 0.0])
    bodies = [
        {
            "type": "cloth",
            "name": "sheet",
            "size": [1.0, 1.0],
            "cells": [6, 6],
            "mass": 2.0,
            "structural_stiffness": 50.0,
            "shear_stiffness": 20.0,
            "damping": 0.05,
        },
        rope("bead", start + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]), 0.2, 0.0),
    ]
    bead = {"type": "slide", "name": "bead", "points": [{"body": "bead", "index": 0}]}
    bead["on"] = {"body": "sheet", "surface": True}
    run = Run({"integrator": name, "bodies": bodies, "constraints": [bead]})
    x, v = run.x, np.zeros_like(run.x)
    x[:, 2] += 0.08 * np.sin(2.0 * np.pi * x[:, 0]) * np.cos(np.pi * x[:, 1])
    v[run.at("bead", 0, 1)] = [1.0, 0.4, 0.0]
    triangles = run.model.shape("sheet").triangles + run.at("sheet", 0)[0]
    p = run.at("bead", 0)[0]
    run.state.set_positions(x)
    run.state.set_velocities(v)
    assert p == len(x) - 2 and len(triangles) == 72
    return run, triangles


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_stays_on_the_surface_and_keeps_momentum(name):
    run, triangles = bead_on_a_sheet(name)
    p = run.at("bead", 0)[0]
    h, visited = 2e-3, set()
    before = (run.m[:, None] * run.v).sum(0)
    for k in range(200):
        run.step(h)
        if k % 7 != 1:  # explicit Euler arrives in the second step
            continue
        x = run.x
        weights = np.array([closest(x[p], x[t]) for t in triangles])
        places = np.einsum("tk,tkd->td", weights, x[triangles])
        gaps = np.linalg.norm(places - x[p], axis=1)
        nearest = int(np.argmin(gaps))
        assert gaps[nearest] < 1e-12 * size(x)
        visited.add(nearest)
        scale = (run.m * np.linalg.norm(run.v, axis=1)).sum()
        assert np.abs((run.m[:, None] * run.v).sum(0) - before).max() < 1e-12 * scale
    assert len(visited) >= 4


@pytest.mark.parametrize("name", ["verlet", "velocity_verlet", "rk4", "implicit_euler"])
def test_without_friction_on_a_flat_sheet(name):
    """On a flat, resting, force-free sheet the bead goes straight on at its speed, across edges."""
    run, _ = bead_on_a_sheet(name)
    p = run.at("bead", 0)[0]
    x, v = run.x, run.v
    x[:p, 2] = 0.0
    x[p] = [0.2, 0.31, 0.0]
    run.state.set_positions(x)
    run.state.set_velocities(v)
    run.steps([2e-3] * 200)
    assert run.x[p] == pytest.approx([0.6, 0.47, 0.0], abs=1e-10)
    assert run.v[p] == pytest.approx([1.0, 0.4, 0.0], abs=1e-10)


@pytest.mark.parametrize("name", ["verlet", "velocity_verlet", "rk4", "midpoint"])
@pytest.mark.parametrize("facets", [8, 32])
def test_keeps_its_speed_around_a_prism(name, facets):
    """A bead without forces runs around a nailed prism: no edge takes speed from it."""
    turn = 2 * np.pi * np.arange(facets) / facets
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = np.concatenate([np.c_[ring, -np.ones(facets)], np.c_[ring, np.ones(facets)]])
    here, there = np.arange(facets), (np.arange(facets) + 1) % facets
    lower, upper = np.c_[here, there, facets + here], np.c_[there, facets + there, facets + here]
    middle = np.pi / facets
    start = np.array([np.cos(middle) ** 2, np.cos(middle) * np.sin(middle), 0.05])
    prism = {"type": "cloth", "name": "prism", "vertices": vertices, "triangles": np.concatenate([lower, upper])}
    bead = {
        "type": "rope",
        "name": "bead",
        "points": np.stack([start, [3, 0, 0]]),
        "stretch_stiffness": 0.0,
        "mass": 1.0,
    }
    run = Run({
        "integrator": name,
        "bodies": [prism, bead | {"velocity": [-np.sin(middle), np.cos(middle), 0.0]}],
        "constraints": [
            {"type": "nail", "name": "held", "points": {"body": "prism", "all": True}},
            {"type": "slide", "name": "slide", "points": {"body": "bead", "index": 0}, "on": {"body": "prism", "surface": True}},
        ],
    })  # fmt: skip
    angle = 0.0
    for _ in range(1500):
        before = run.x[-2]
        run.step(2e-3)
        assert run.report.status == "ok"
        after = run.x[-2]
        angle += np.arctan2(before[0] * after[1] - before[1] * after[0], before[:2] @ after[:2])
        assert np.cos(middle) - 1e-12 <= np.hypot(*after[:2]) <= 1.0 + 1e-12
    assert abs(np.linalg.norm(run.v[-2]) - 1.0) < 1e-9
    assert angle > 0.9 * 3.0


@pytest.mark.parametrize("name", ["velocity_verlet", "beeman", "rk4"])
def test_a_joint_that_pulls_points_together_has_its_angular_error_told(name):
    run = Run({
        "integrator": name,
        "bodies": [
            {"type": "rope", "name": "a", "points": [[0, 0, 0], [1, 0, 0]], "mass": 1.0, "velocity": [1.0, 0, 0]},
            {"type": "rope", "name": "b", "points": [[0, 0.3, 0], [1, 1, 0]], "mass": 2.0},
        ],
        "constraints": [{"type": "points_to_point", "name": "p", "zip": [{"body": k, "index": 0} for k in "ab"]}],
    })  # fmt: skip
    run.step(1e-3)
    assert run.report.momentum_error[0] < 1e-12 and run.report.momentum_error[1] > 1e-3
