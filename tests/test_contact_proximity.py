"""Contacts of what is near: exact distances, each place once, no ghosts, and never the nearest place lost."""

from math import sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.reference.contact_bodies import NO_FACES, NO_LINES, Body, any_body, box, plate, sheet, wedge
from tests.reference.contact_distance import between_meshes
from tests.reference.contact_exact import squared_distance
from turnbuckle.contact.broad import BroadPhase
from turnbuckle.contact.proximity import Proximity, pair_delta
from turnbuckle.contact.surface import DELTA_FRACTION, SurfacePart, find_edges, make_surfaces
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Contacts, Pairs, Surfaces
from turnbuckle.data.errors import InputError


def scene(*bodies: Body) -> tuple[Surfaces, np.ndarray]:
    """Surfaces of bodies, shape after shape, and where their vertices are."""
    x, parts, first = np.concatenate([b[0] for b in bodies]), [], 0
    for k, (own, faces, lines) in enumerate(bodies):
        parts.append(SurfacePart(k, first + np.arange(len(own)), triangles=faces, lines=lines))
        first += len(own)
    return make_surfaces(parts, x), x


def near(s: Surfaces, x: np.ndarray, reach: float) -> Contacts:
    """Contacts between different bodies; all are checked for what they say of themselves."""
    c = Proximity(s).contacts(BroadPhase(s).candidates(x, x, reach), x, reach)
    way = np.einsum("nk,nkd->nd", c.coefficients, x[c.vertices])
    assert np.allclose(np.linalg.norm(c.normal, axis=1), 1.0, atol=1e-12)
    assert np.allclose(way, c.distance[:, None] * c.normal, atol=1e-13 * max(1.0, np.abs(x).max()))
    assert (c.distance < reach).all() and (c.time == 0.0).all()
    assert np.allclose(np.maximum(c.coefficients, 0).sum(axis=1), 1.0)
    assert np.allclose(np.minimum(c.coefficients, 0).sum(axis=1), -1.0)
    across = s.shape[c.vertices[:, 0]] != s.shape[c.vertices[:, 3]]
    return Contacts(*(getattr(c, name)[across] for name in Contacts.__dataclass_fields__))


def places(c: Contacts) -> list[frozenset]:
    return [frozenset(v[w != 0].tolist()) for v, w in zip(c.vertices, c.coefficients, strict=True)]


@pytest.mark.parametrize("kind", ["random", "grid", "needle", "far"])
def test_distances_are_exact(kind: str) -> None:
    rng = np.random.default_rng(4)
    n = 40
    points = rng.normal(size=(n, 4, 3)) if kind == "random" else rng.integers(-2, 3, size=(n, 4, 3)) / 8.0
    if kind == "needle":
        points[:, 3] = points[:, 2] + 1e-9 * rng.normal(size=(n, 3))
    if kind == "far":
        points += 1e6
    x, four = points.reshape(-1, 3), 4 * np.arange(n)[:, None]
    # every vertex with the triangle of its row, then every edge with the other of its row
    faces = make_surfaces([SurfacePart(0, np.arange(4 * n), triangles=four + [[1, 2, 3]])], x)
    rows = np.arange(n, dtype=np.int32)
    zeros = np.zeros(n, dtype=np.int32)
    c = Proximity(faces).contacts(Pairs(zeros + VERTEX_FACE, 4 * rows, rows), x, 1e9)
    assert c.count == n
    wanted = [sqrt(squared_distance(p[:1], p[1:])) for p in points]
    assert np.allclose(c.distance, wanted, rtol=1e-9, atol=1e-15)
    ropes = make_surfaces(
        [SurfacePart(0, np.arange(4 * n), lines=np.concatenate([four + [[0, 1]], four + [[2, 3]]]))], x
    )
    number = {tuple(e): k for k, e in enumerate(ropes.edges.tolist())}
    a, b = (np.array([number[(4 * k + i, 4 * k + i + 1)] for k in range(n)], dtype=np.int32) for i in (0, 2))
    c = Proximity(ropes).contacts(Pairs(zeros + EDGE_EDGE, a, b), x, 1e9)
    assert c.count == n
    wanted = [sqrt(squared_distance(p[:2], p[2:])) for p in points]
    assert np.allclose(c.distance, wanted, rtol=1e-9, atol=1e-15)


def apart(rng: np.random.Generator, bodies: list[Body]) -> tuple[list[Body], float] | None:
    """Turn the bodies and bring the second as near to the first as a random gap, and how near that is."""
    turn = [
        lambda: Rotation.from_rotvec(rng.normal(size=3) * 3),
        Rotation.identity,
        lambda: Rotation.from_rotvec(rng.normal(size=3) * 1e-9),
        lambda: Rotation.from_euler("xyz", rng.integers(0, 4, 3) * 45, degrees=True),
    ][rng.integers(4)]
    first, second = ((turn().apply(x), faces, lines) for x, faces, lines in bodies)
    way = rng.normal(size=3) if rng.integers(2) else np.array([0.0, 0.0, 1.0])
    way /= np.linalg.norm(way)
    start = second[0] + (rng.normal(size=3) * 0.2 if rng.integers(2) else rng.integers(-4, 5, 3) / 8.0)
    n = len(first[0])
    numbered = [
        (np.arange(len(b[0])) + k, b[1] + k, find_edges(b[1], b[2])[0] + k) for b, k in ((first, 0), (second, n))
    ]
    gap, t = 10.0 ** rng.uniform(-12, -1), float((first[0] @ way).max() - (start @ way).min()) + 1.0
    for _ in range(100):  # what is nearer than the distance can be walked without meeting
        distance = between_meshes(np.concatenate([first[0], start + t * way]), *numbered)
        if 0.0 < distance <= 1.5 * gap:
            return [first, (start + t * way, *second[1:])], distance
        t -= distance - gap
        if t < -5.0:
            break
    return None


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_place_is_always_a_contact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tried = 0
    while tried < 30:
        found = apart(rng, [any_body(rng), any_body(rng)])
        if found is not None:
            tried += 1
            s, x = scene(*found[0])
            c = near(s, x, found[1] * rng.choice([1.0000001, 1.5, 10.0]) + 1e-15)
            assert c.count and np.isclose(c.distance.min(), found[1], rtol=1e-8, atol=1e-14), (seed, tried)


def test_a_vertex_over_a_flat_floor_sees_the_floor_only() -> None:
    floor, tip = sheet(9), np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.4], [-0.1, 0.3, 0.4], [-0.2, -0.3, 0.4]])
    cone = (tip, np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]), NO_LINES)
    s, x = scene(floor, cone)
    rng = np.random.default_rng(0)
    n = len(floor[0])
    for k in range(60):
        at = rng.uniform(-0.4, 0.4, 2) if k % 3 else rng.integers(-6, 7, 2) / 16.0  # on edges and corners too
        x[n:] = tip + [*at, 0.01]
        c = near(s, x, 0.1)
        assert (np.abs(np.abs(c.normal[:, 2]) - 1.0) < 1e-12).all()
        assert np.isclose(c.distance, 0.01).all()
        assert c.count == 1, places(c)


def test_a_box_on_a_flat_floor() -> None:
    floor, cube = sheet(21), box((0.2, 0.2, 0.2))
    s, x = scene(floor, cube)
    n, rng = len(floor[0]), np.random.default_rng(1)
    for tilt in (0.0, 1e-12, 1e-6, 1e-3, -1e-3):
        for _ in range(6):
            x[n:] = Rotation.from_euler("xyz", [tilt, 0.5 * tilt, rng.uniform(0, 3)]).apply(cube[0])
            x[n:] += [*rng.uniform(-0.2, 0.2, 2), 0.004 - x[n:, 2].min()]
            c = near(s, x, 0.01)
            assert (np.abs(c.normal[:, 2]) > np.cos(1.2 * abs(tilt)) - 1e-12).all()
            corners = {v for v, k in zip(c.a.tolist(), c.kind.tolist(), strict=True) if k == VERTEX_FACE and v >= n}
            assert corners == set(np.flatnonzero(x[:, 2] < 0.05)[-4:].tolist())  # all four carry, however it tilts


def test_a_box_that_slides_off_a_table() -> None:
    table, cube = sheet(5, 1.0), box((0.2, 0.2, 0.2))
    s, x = scene(table, cube)
    x[len(table[0]) :] = cube[0] + [0.47, 0.01, 0.105]  # two corners over the border
    c = near(s, x, 0.01)
    assert np.allclose(c.normal[:, 2], np.where(s.shape[c.vertices[:, 0]] == 1, 1.0, -1.0))
    ends = np.einsum("nk,nkd->nd", np.maximum(c.coefficients, 0), x[c.vertices])
    assert ends[:, 0].max() == pytest.approx(0.5) and ends[:, 0].min() == pytest.approx(0.37)


def test_strips_that_cross_touch_at_their_borders_only() -> None:
    first, second = plate(), plate()
    s, x = scene(first, (second[0][:, [1, 0, 2]] + [0, 0, 0.01], second[1], NO_LINES))
    c = near(s, x, 0.02)
    places_xy = np.einsum("nk,nkd->nd", np.maximum(c.coefficients, 0), x[c.vertices])[:, :2]
    assert {(0.1, 0.1), (-0.1, 0.1), (0.1, -0.1), (-0.1, -0.1)} == {tuple(p) for p in np.round(places_xy, 9).tolist()}
    assert (np.abs(c.normal[:, 2]) == 1.0).all()


def test_edges_of_boxes_at_a_right_angle() -> None:
    first, second = box((1, 1, 1)), box((1, 1, 1))
    quarter = Rotation.from_euler("x", 45, degrees=True).apply(first[0])
    other = Rotation.from_euler("y", 45, degrees=True).apply(second[0]) + [0.1, 0.2, sqrt(2) + 0.01]
    s, x = scene((quarter, *first[1:]), (other, *second[1:]))
    c = near(s, x, 0.02)
    assert c.count == 1 and c.kind[0] == EDGE_EDGE and c.distance[0] == pytest.approx(0.01)
    assert np.allclose(np.abs(c.normal[0]), [0, 0, 1])


def test_a_place_that_many_pairs_share_is_one_contact() -> None:
    up = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 1.0], [-0.1, 0.2, 1.0], [-0.1, -0.2, 1.0]])
    cone = (up, np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]), NO_LINES)
    s, x = scene((up * [1, 1, -1], *cone[1:]), (up + [0.001, 0, 0.01], *cone[1:]))  # tip to tip
    c = near(s, x, 0.02)
    assert places(c) == [frozenset((0, 4))]
    ridge = wedge()
    s, x = scene((ridge[0] * [1, 1, -1], *ridge[1:]), (up + [0.1, 0, 0.01], *cone[1:]))  # tip to ridge
    assert places(near(s, x, 0.02)) == [frozenset((0, 1, 6))]
    s, x = scene((ridge[0] * [1, 1, -1], *ridge[1:]), (ridge[0] + [0.25, 0, 0.01], *ridge[1:]))  # along each other
    assert sorted(map(sorted, places(near(s, x, 0.011)))) == [[0, 1, 6], [1, 6, 7]]


def test_ropes() -> None:
    line = np.array([[-1.0, 0, 0], [-0.3, 0, 0], [0.4, 0, 0], [1, 0, 0]])
    links = np.array([[0, 1], [1, 2], [2, 3]])
    s, x = scene((line, NO_FACES, links), (line[:, [1, 0, 2]] + [0.1, 0, 0.01], NO_FACES, links))
    c = near(s, x, 0.02)
    assert c.count == 1 and c.distance[0] == pytest.approx(0.01)
    s, x = scene((line, NO_FACES, links), (line + [0.1, 0, 0.01], NO_FACES, links))  # side by side
    c = near(s, x, 0.02)
    assert len(set(places(c))) == c.count == 3 and np.allclose(
        c.normal[:, 2], np.where(c.vertices[:, 0] < 4, -1.0, 1.0)
    )
    floor = sheet(5)
    s, x = scene(floor, (line * 0.3 + [0, 0.01, 0.005], NO_FACES, links))
    c = near(s, x, 0.01)
    assert c.count == 4 and np.allclose(c.normal, [0, 0, 1])


@pytest.mark.parametrize("flip", [False, True])
def test_touching_surfaces_have_normals(flip: bool) -> None:
    floor, cube = sheet(5), box((0.2, 0.2, 0.2))
    faces = floor[1][:, ::-1] if flip else floor[1]
    s, x = scene((floor[0], faces, NO_LINES), (cube[0] + [0.03, 0.02, 0.1], *cube[1:]))
    c = near(s, x, 0.01)
    assert c.count >= 4 and (c.distance == 0.0).all()
    assert np.allclose(c.normal, [0, 0, 1] * np.where(s.shape[c.vertices[:, 0]] == 1, 1, -1)[:, None])


def test_reach_of_each_pair_and_delta() -> None:
    floor, cube = sheet(3), box((0.2, 0.2, 0.2))
    s, x = scene(floor, (cube[0] + [0.1, 0.05, 0.104], *cube[1:]))
    pairs = BroadPhase(s).candidates(x, x, 0.1)
    search = Proximity(s)
    everything = search.contacts(pairs, x, 0.01)
    reach = np.where(pairs.kind == VERTEX_FACE, 0.01, 0.0)
    assert (search.contacts(pairs, x, reach).kind == VERTEX_FACE).all() and search.contacts(pairs, x, reach).count > 3
    assert np.allclose(pair_delta(s, everything), DELTA_FRACTION * np.full(everything.count, 0.2), rtol=0.2)
    with pytest.raises(InputError, match="give one number or one for each"):
        search.contacts(pairs, x, np.ones(3))


def test_same_for_any_number_of_threads() -> None:
    rng = np.random.default_rng(0)
    upper, lower = sheet(40), sheet(37)
    s, x = scene(lower, (upper[0] + [0, 0, 0.01], *upper[1:]))
    x = x + 0.003 * rng.normal(size=x.shape)
    pairs = BroadPhase(s).candidates(x, x, 0.02)
    assert pairs.count > 4096
    one, two = (Proximity(s, threads=k).contacts(pairs, x, 0.02) for k in (1, 2))
    assert one.count > 500
    for name in Contacts.__dataclass_fields__:
        assert np.array_equal(getattr(one, name), getattr(two, name))
