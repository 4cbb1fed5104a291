"""`check`: the largest stable step against eigenvalues of the scheme itself, weights, conflicts, counts."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnbuckle.data.errors import ConflictError
from turnbuckle.scene.check import check, inspect_scene
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.stability import energy_rows, step_warning


def random_solid(rng: np.random.Generator, damping: float, integrator: str) -> tuple[SimpleNamespace, np.ndarray]:
    """Two tetrahedra that share a face, with uneven masses, and a spring; damping is `damping` times stiffness [s]."""
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]]) + 0.1 * rng.standard_normal((5, 3))
    corners = np.array([[0, 1, 2, 3], [1, 4, 2, 3]])
    edges = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [1, 4], [2, 4], [3, 4]])
    triangles = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3], [1, 4, 2], [1, 4, 3], [2, 4, 3]])
    k = rng.uniform(10, 100, 3)
    tetrahedra = SimpleNamespace(
        corners=corners,
        material=np.zeros(2, int),
        materials=np.array([[*k, *(damping * k)]]),
        volume=np.array([volume(x[c]) for c in corners]),
        edges=edges,
        edge_length=np.array([length(x[e]) for e in edges]),
        edge_material=np.zeros(9, int),
        triangles=triangles,
        triangle_area=np.array([area(x[t]) for t in triangles]),
        triangle_material=np.zeros(7, int),
    )
    spring = np.array([[0, 4]])
    springs = SimpleNamespace(
        pairs=spring, length=np.array([length(x[spring[0]])]), k=np.array([30.0]), k_d=np.array([30.0 * damping])
    )
    mass = rng.uniform(0.1, 10, 5)
    none = {
        "hinges": SimpleNamespace(points=np.zeros((0, 4), int)),
        "corotational": SimpleNamespace(corners=np.zeros((0, 4), int)),
    }
    return SimpleNamespace(integrator=integrator, mass=mass, springs=springs, tetrahedra=tetrahedra, **none), x


def length(p: np.ndarray) -> float:
    return float(np.linalg.norm(p[1] - p[0]))


def area(p: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross(p[1] - p[0], p[2] - p[0])) / 2)


def volume(p: np.ndarray) -> float:
    return float(np.dot(np.cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]) / 6)


def test_gradients_against_finite_differences() -> None:
    model, x = random_solid(np.random.default_rng(0), 0.0, "verlet")
    t = model.tetrahedra
    parts = [(model.springs.pairs, length), (t.edges, length), (t.triangles, area), (t.corners, volume)]

    def strains(flat: np.ndarray) -> np.ndarray:
        y = flat.reshape(-1, 3)
        return np.array([f(y[c]) / f(x[c]) - 1 for corners, f in parts for c in corners])

    numeric = np.stack([(strains(x.ravel() + d) - strains(x.ravel() - d)) / 2e-6 for d in 1e-6 * np.eye(15)], axis=1)
    rows = energy_rows(model, x)
    gradient = rows.gradient.toarray() * np.sqrt(np.repeat(model.mass, 3))
    np.testing.assert_allclose(gradient, numeric, atol=1e-8)
    assert rows.k.min() > 0


def spectral_radius(model: SimpleNamespace, x: np.ndarray, h: float) -> float:
    """Of one step of the scheme on the linearised motion, by the eigenvalues of its matrix."""
    rows = energy_rows(model, x)
    g = rows.gradient.toarray()
    k, d = g.T @ (rows.k[:, None] * g), g.T @ (rows.k_d[:, None] * g)
    n = len(k)
    eye, zero = np.eye(n), np.zeros((n, n))
    a = np.block([[zero, eye], [-k, -d]])  # d/dt (x, v)
    if model.integrator == "euler_cromer":  # v' = v + h (-K x - D v), x' = x + h v'
        kick = np.block([[eye, zero], [-h * k, eye - h * d]])
        step = np.block([[eye, h * eye], [zero, eye]]) @ kick
    elif model.integrator == "explicit_euler":
        step = np.eye(2 * n) + h * a
    elif model.integrator == "midpoint":
        step = np.eye(2 * n) + h * a + h * h * a @ a / 2
    else:
        ha = h * a
        step = np.eye(2 * n) + ha @ (np.eye(2 * n) + ha @ (np.eye(2 * n) + ha @ (np.eye(2 * n) + ha / 4) / 3) / 2)
    return float(np.abs(np.linalg.eigvals(step)).max())


def largest_step(model: SimpleNamespace, x: np.ndarray, factor: float) -> float:
    """The largest step whose growth per step stays below `factor`, by bisection."""
    low, high = 1e-6, 10.0
    for _ in range(60):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if spectral_radius(model, x, middle) < factor else (low, middle)
    return low


@pytest.mark.parametrize("damping", [0.0, 0.005, 0.1])
@pytest.mark.parametrize("scheme", ["euler_cromer", "rk4"])
def test_the_limit_is_where_the_scheme_loses_stability(scheme: str, damping: float) -> None:
    for seed in range(3):
        model, x = random_solid(np.random.default_rng(seed), damping, scheme)
        # A rigid motion is a defective eigenvalue 1: rounding moves it by the root of the machine precision.
        limit = largest_step(model, x, 1 + 1e-5)
        assert step_warning(model, x, 0.8 * limit, 1.0) is None
        text = step_warning(model, x, 1.05 * limit, 1.0)
        assert text is not None and text.startswith(f"dt = {1.05 * limit:g} s is too large for the stiffness: {scheme}")
        told = float(text.split("about ")[1].split(" s")[0])
        assert 0.7 * limit < told < 1.05 * limit


@pytest.mark.parametrize("damping", [0.0, 0.002])
@pytest.mark.parametrize("scheme", ["explicit_euler", "midpoint"])
def test_schemes_that_grow_are_judged_by_the_length_of_the_run(scheme: str, damping: float) -> None:
    model, x = random_solid(np.random.default_rng(5), damping, scheme)
    for steps in (100, 10_000):
        limit = largest_step(model, x, np.exp(2.0 / steps))  # a growth by e^2 in so many steps
        for h in np.array([0.9, 1.1]) * limit:
            warned = step_warning(model, x, h, h * steps) is not None
            assert warned == (h > limit)


def test_schemes_without_a_limit() -> None:
    for scheme in ("implicit_euler", "newmark"):
        model, x = random_solid(np.random.default_rng(0), 0.0, scheme)
        assert step_warning(model, x, 100.0, 1.0) is None


def strip(**fields: object) -> Scene:
    scene = Scene("strip", dt=1e-4, **fields)
    scene.add_net("net", size=[1, 1], cells=[4, 4], mass=1.0, structural_stiffness=100.0)
    scene.add_solid("box", box={"size": [1, 1, 1], "cells": [2, 2, 2]}, position=[0, 0, 1])
    scene.add_constraint("nail", "left", points={"body": "net", "side": "-x"})
    return scene


def test_a_good_scene_has_no_warnings_and_true_counts() -> None:
    result = inspect_scene(strip())
    assert result.warnings == []
    counts = dict(result.counts)
    assert counts["points"] == str(25 + 27) and counts["tetrahedra"] == str(8 * 5) and counts["springs"] == str(40)
    assert counts["constraints: nail"] == "5" and counts["mass"] == "1001 kg"
    assert not any(label.startswith("constraints: ") and "nail" not in label for label in counts)


def test_a_large_step_is_warned_of() -> None:
    scene = strip()
    scene.apply_set("bodies.net.structural_stiffness=1e9")
    (warning,) = check(scene)
    assert warning.startswith("dt = 0.0001 s is too large for the stiffness: verlet holds up to about")


def test_weights_outside_their_element() -> None:
    scene = strip()
    elements, weights = [[0, 1, 2], [0, 1, 3]], [[1.5, -0.25, -0.25], [0.5, 0.25, 0.25]]
    scene.apply_set("conflicts=solve")
    to = {"body": "box", "elements": elements}
    scene.add_constraint("attach", "far", points={"body": "net", "indices": [23, 24]}, to=to, weights=weights)
    far = [w for w in check(scene) if "outside" in w]
    assert far == [
        "constraint 'far': 1 of 2 points are outside their elements (a weight of 1.5); attach them to nearer elements"
    ]


def test_conflicts_are_named_once_with_their_number_of_points() -> None:
    scene = strip(conflicts="solve")
    scene.add_constraint("nail", "again", points={"body": "net", "where": "x < 0.3 and y < 0.3"})
    scene.add_constraint("nail", "later", points={"body": "net", "side": "+x"}, start=1.0)
    scene.add_constraint("nail", "before", points={"body": "net", "side": "+x"}, end=1.0)
    scene.add_constraint("nail", "off", points={"body": "net", "all": True}, enabled=False)
    assert check(scene) == ["conflict: the constraints 'left' and 'again' hold 2 points at the same time"]
    scene.apply_set("conflicts=error")
    with pytest.raises(ConflictError, match="'left.*'again"):
        check(scene)


def test_a_surface_that_is_held_otherwise() -> None:
    scene = strip(conflicts="solve")
    scene.add_constraint("slide", "skate", points={"body": "net", "index": 24}, on={"body": "box", "surface": True})
    assert check(scene) == []
    scene.add_constraint("velocity", "push", points={"body": "box", "side": "-z"}, goal=[0, 0, 1])
    (warning,) = check(scene)
    assert "'push' holds 9 points of the elements that 'skate' slides on" in warning
