"""Crossings of edges and faces: the same as exact arithmetic finds, coincident and degenerate ones too."""

import numpy as np
import pytest

from tests.reference.contact_exact import crosses, meet
from turnbuckle.contact.exact import edge_meets_triangle, to_integers
from turnbuckle.contact.intersections import Intersections, intersections
from turnbuckle.contact.surface import SurfacePart, make_surfaces
from turnbuckle.data.contact import Surfaces


def pairs_of(rng: np.random.Generator, n: int, kind: str) -> np.ndarray:
    """Edges and triangles (n, 5, 3): random, on a coarse grid (touching, level, without area), or level and tilted."""
    if kind == "random":
        return rng.normal(size=(n, 5, 3))
    if kind == "grid":
        return rng.integers(-2, 3, size=(n, 5, 3)) / 8.0
    if kind == "far":
        return 1e6 + rng.integers(-2, 3, size=(n, 5, 3)) / 8.0
    if kind == "tiny":
        return 1e-6 * rng.integers(-2, 3, size=(n, 5, 3)) + 1e-22 * rng.normal(size=(n, 5, 3))
    flat = rng.integers(-2, 3, size=(n, 5, 3)) * [1.0, 1.0, 0.0]  # level in a tilted plane, but for round-off
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return flat @ turn.T


def surfaces_of(points: np.ndarray) -> tuple[Surfaces, np.ndarray]:
    """A rope and a triangle for each row (n, 5, 3)."""
    n, x = len(points), points.reshape(-1, 3)
    first = 5 * np.arange(n)[:, None]
    part = SurfacePart(0, np.arange(5 * n), lines=first + [[0, 1]], triangles=first + [[2, 3, 4]])
    return make_surfaces([part], x), x


@pytest.mark.parametrize("kind", ["random", "grid", "far", "tiny", "tilted"])
@pytest.mark.parametrize("touching", [True, False])
def test_as_exact_arithmetic(kind: str, touching: bool) -> None:
    rng = np.random.default_rng(3)
    points = pairs_of(rng, 60, kind)
    s, x = surfaces_of(points)
    rope = {tuple(sorted((5 * k, 5 * k + 1))): k for k in range(60)}
    number = {e: rope[tuple(edge)] for e, edge in enumerate(s.edges.tolist()) if tuple(edge) in rope}
    found = {(number[e], f) for e, f in intersections(s, x, touching=touching).tolist() if e in number}
    check = meet if touching else crosses
    wanted = {
        (k, f)
        for k in range(60)
        for f in range(60)
        if (k + f) % 7 == 0 and check(points[k, :2], points[f, 2:])
    }  # fmt: skip
    assert {(k, f) for k, f in found if (k + f) % 7 == 0} == wanted
    assert len(wanted) > 3 or kind == "tilted"


def test_integers_decide_as_fractions() -> None:
    rng = np.random.default_rng(5)
    met = 0
    for kind in ("grid", "tiny", "tilted"):
        for points in pairs_of(rng, 150, kind):
            integers = to_integers(points)
            assert edge_meets_triangle(integers, True) == meet(points[:2], points[2:])
            assert edge_meets_triangle(integers, False) == crosses(points[:2], points[2:])
            met += edge_meets_triangle(integers, True)
    assert met > 40


def sheet(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n n, 3) of a unit square, and its triangles."""
    u = np.linspace(0.0, 1.0, n)
    x = np.stack([*np.meshgrid(u, u, indexing="ij"), np.zeros((n, n))], axis=-1).reshape(-1, 3)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return x, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def two_sheets(second: np.ndarray, n: int = 12, **more: object) -> tuple[Surfaces, np.ndarray]:
    x, f = sheet(n)
    both = np.concatenate([x, second])
    parts = [SurfacePart(k, k * len(x) + np.arange(len(x)), triangles=f) for k in range(2)]
    return make_surfaces(parts, both, **more), both


def test_sheets_that_cross() -> None:
    x, _ = sheet(12)
    s, both = two_sheets((x - 0.5)[:, [2, 0, 1]] + [0.503, 0.501, 0.017])
    found = intersections(s, both)
    assert len(found) >= 11
    side = both[s.edges[found[:, 0]]]
    level = s.shape[s.edges[found[:, 0], 0]] == 1
    assert (side[level][:, 0, 2] * side[level][:, 1, 2] < 0).all()


def test_flat_cloth_does_not_meet_itself() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    x, f = sheet(30)
    for place in (x, x @ turn.T, x @ turn.T + 1e6):
        s = make_surfaces([SurfacePart(0, np.arange(len(x)), triangles=f)], place)
        assert len(intersections(s, place)) == 0


def test_sheets_on_each_other() -> None:
    x, _ = sheet(6)
    for gap, meets in ((0.0, True), (1e-15, False)):
        s, both = two_sheets(x + [0.0, 0.0, gap], 6)
        assert (len(intersections(s, both)) > 0) == meets
        assert len(intersections(s, both, touching=False)) == 0


def test_what_may_cross() -> None:
    x, _ = sheet(12)
    across = (x - 0.5)[:, [2, 0, 1]] + [0.503, 0.501, 0.017]
    s, both = two_sheets(across, collides=np.eye(2, dtype=bool))
    assert len(intersections(s, both)) == 0
    s, both = two_sheets(across)
    assert len(intersections(s, both, moves=np.zeros(len(both), dtype=bool))) == 0
    assert len(intersections(s, both, moves=s.shape == 0)) == len(intersections(s, both)) > 0


def test_same_for_any_number_of_threads() -> None:
    rng = np.random.default_rng(0)
    x, f = sheet(40)
    crumpled = x + 0.05 * rng.normal(size=x.shape)
    s = make_surfaces([SurfacePart(0, np.arange(len(x)), triangles=f)], x)
    one, two = (Intersections(s, threads=k) for k in (1, 2))
    assert len(one.find(crumpled)) > 100
    assert np.array_equal(one.find(crumpled), two.find(crumpled))


def test_as_ipctk() -> None:
    ipctk = pytest.importorskip("ipctk")
    rng = np.random.default_rng(2)
    x, f = sheet(10)
    s = make_surfaces([SurfacePart(0, np.arange(len(x)), triangles=f)], x)
    mesh, search, seen = ipctk.CollisionMesh(x, s.edges, s.faces), Intersections(s), []
    for k in range(40):
        crumpled = x + (0.002 + 0.002 * k) * rng.normal(size=x.shape)
        seen.append(len(search.find(crumpled)) > 0)
        assert seen[-1] == ipctk.has_intersections(mesh, crumpled)
    assert 5 < sum(seen) < 35
