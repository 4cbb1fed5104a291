"""Times of impact of pairs known by hand: what touches, slides, passes through a corner, is degenerate, fast, or far off."""

import numpy as np
import pytest
from reference.ccd_distance import distances

from turnbuckle.contact.ccd_bulk import time_of_impact
from turnbuckle.data.errors import InputError

FACE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def query(start, end) -> np.ndarray:
    return np.array([*start, *end], dtype=float)[None]


def falling(place, top=1.0, bottom=-1.0, face=FACE) -> np.ndarray:
    """A vertex that falls on a face at rest."""
    return query([[*place, top], *face], [[*place, bottom], *face])


def crossing(a, b, top=1.0, bottom=-1.0) -> np.ndarray:
    """Edge a, in the plane, falls on edge b at rest."""
    up, down = ([[*p, z] for p in a] for z in (top, bottom))
    flat = [[*p, 0.0] for p in b]
    return query([*up, *flat], [*down, *flat])


def one(q: np.ndarray, kind: str, separation: float = 0.0) -> tuple[bool, float]:
    hit, time = time_of_impact(q, kind, separation)
    assert 0.0 <= time[0] <= 1.0
    return bool(hit[0]), float(time[0])


@pytest.mark.parametrize(
    "place", [(0.25, 0.25), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.0, 0.5)]
)
@pytest.mark.parametrize("bottom", [-1.0, 0.0, -1e-9, -1e6])
def test_vertex_on_face(place, bottom):
    """Inside, on a side, on a corner; stopping right at the face as well."""
    hit, time = one(falling(place, bottom=bottom), "vertex_face")
    true = 1.0 / (1.0 - bottom)
    assert hit and 0.985 * true <= time <= true


@pytest.mark.parametrize("place", [(0.51, 0.51), (-0.02, 0.5), (1.02, 0.0), (3.0, 3.0)])
def test_vertex_beside_face(place):
    assert one(falling(place), "vertex_face") == (False, 1.0)


@pytest.mark.parametrize(
    "a",
    [
        [(0.5, -1), (0.5, 1)],  # in the middle
        [(0.5, 0), (0.5, 1)],  # an end on the other's middle
        [(1, 0), (2, 0)],  # end to end, along one line
        [(1, 0), (1, 1)],  # end to end, at an angle
        [(0, 0), (1, 0)],  # one on the other
        [(0.25, 0), (0.75, 0)],  # one within the other
        [(0.5, 0), (1.5, 0)],  # parallel, half over
        [(0.5, 0), (0.5, 0)],  # no length
        [(0, -1e-9), (1, 1e-9)],  # nearly parallel
    ],
)
@pytest.mark.parametrize("swap", [False, True])
def test_edge_on_edge(a, swap):
    q = crossing(a, [(0, 0), (1, 0)])
    if swap:
        q = q[:, [2, 3, 0, 1, 6, 7, 4, 5]]
    hit, time = one(q, "edge_edge")
    assert hit and 0.4925 <= time <= 0.5


def test_edge_beside_edge():
    for a in ([(1.02, 0), (2, 0)], [(0, 0.02), (1, 0.02)], [(0.5, 0.02), (0.5, 1)]):
        assert one(crossing(a, [(0, 0), (1, 0)]), "edge_edge") == (False, 1.0)


@pytest.mark.parametrize("kind", ["vertex_face", "edge_edge"])
def test_touching_or_too_near_at_the_start(kind):
    """Distance 0, or less than the separation: a hit at time 0, even for a pair that parts."""
    touching = (
        falling((0.25, 0.25), 0.0, 1.0) if kind == "vertex_face" else crossing([(0, 0), (1, 0)], [(0, 0), (1, 0)], 0)
    )
    assert one(touching, kind) == (True, 0.0)
    near = (
        falling((0.25, 0.25), 0.1, 1.0)
        if kind == "vertex_face"
        else crossing([(0, 0), (1, 0)], [(0, 0), (1, 0)], 0.1, 1)
    )
    assert one(near, kind, 0.2) == (True, 0.0)
    assert one(near, kind, 0.09) == (False, 1.0)


def test_all_in_one_plane():
    """Coplanar motion: no cubic to solve, so the paper's test sees nothing."""
    slide = query([[3, 0.2, 0], *FACE], [[-3, 0.2, 0], *FACE])  # enters the face through its slanting side
    hit, time = one(slide, "vertex_face")
    assert hit and 0.985 * (2.2 / 6) <= time <= 2.2 / 6
    edges = query([[2, 0, 0], [2, 1, 0], [0, 0.5, 0], [1, 0.5, 0]], [[0, 0, 0], [0, 1, 0], [0, 0.5, 0], [1, 0.5, 0]])
    hit, time = one(edges, "edge_edge")
    assert hit and 0.49 <= time <= 0.5
    line = query([[0, 0, 0], [1, 0, 0], [3, 0, 0], [4, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0]])
    hit, time = one(line, "edge_edge")
    assert hit and 0.65 <= time <= 2 / 3
    assert not time_of_impact(np.concatenate([edges, line]), "edge_edge", method="cubic")[0].any()
    assert not time_of_impact(slide, "vertex_face", method="cubic")[0][0]


@pytest.mark.parametrize(
    "face", [[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]], [[0.5, 0, 0]] * 3, [[0, 0, 0], [0, 0, 0], [1, 0, 0]]]
)
def test_face_without_area(face):
    hit, time = one(falling((0.5, 0.0), face=face), "vertex_face")
    assert hit and 0.4925 <= time <= 0.5
    assert one(falling((0.5, 0.02), face=face), "vertex_face") == (False, 1.0)


def test_thousand_metres_a_second_against_a_wall_of_two_triangles():
    """30 m in a step of 30 ms, at every place of the wall, its diagonal and its rim included."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    y, x = np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 33))
    for tilt in (0.0, 12.34, 1e4):  # aside on its way, through the same places at half of the step
        shot = np.zeros((2, x.size, 8, 3))
        for half, faces in enumerate(([0, 1, 2], [0, 2, 3])):
            shot[half, :, 0] = np.c_[x.ravel() - tilt, y.ravel(), np.full(x.size, 15.0)]
            shot[half, :, 4] = np.c_[x.ravel() + tilt, y.ravel(), np.full(x.size, -15.0)]
            shot[half, :, 1:4] = shot[half, :, 5:8] = corners[faces]
        hit, time = time_of_impact(shot.reshape(-1, 8, 3), "vertex_face")
        hit, time = hit.reshape(2, -1), time.reshape(2, -1)
        stopped = np.where(hit, time, 1.0).min(axis=0)
        assert (stopped <= 0.5).all() and (stopped > 0.48).all()


@pytest.mark.parametrize("scale", [1e-300, 1e-120, 1e-6, 1.0, 1e6, 1e100])
@pytest.mark.parametrize("kind", ["vertex_face", "edge_edge"])
def test_any_scale_and_any_offset(scale, kind):
    """Scaled pairs answer alike; far from the origin the answer is that of the positions as stored."""
    q = falling((0.25, 0.25)) if kind == "vertex_face" else crossing([(0.5, -1), (0.5, 1)], [(0, 0), (1, 0)])
    hit, time = one(q * scale, kind)
    assert hit and 0.4925 <= time <= 0.5
    rng = np.random.default_rng(0)
    random = rng.normal(size=(500, 8, 3))
    assert np.array_equal(time_of_impact(random, kind)[0], time_of_impact(random * scale, kind)[0])
    if 1e-6 <= scale <= 1e6:
        stored = (random + 1e6) - 1e6
        far = time_of_impact(random * 2.0**-20 + 1e6 * 2.0**-20, kind)
        near = time_of_impact(stored * 2.0**-20, kind)
        assert np.array_equal(far[0], near[0]) and np.allclose(far[1], near[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", [0, 1])
def test_order_of_corners_and_sides(kind):
    """Faces in any order, edges either way round, a and b exchanged: the same hits at nearly the same times."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=(3000, 8, 3))
    hit, time = time_of_impact(q, kind, 0.01)
    orders = [(1, 0, 2, 3), (0, 1, 3, 2), (2, 3, 0, 1)] if kind else [(0, 2, 3, 1), (0, 2, 1, 3)]
    for order in orders:
        hit2, time2 = time_of_impact(q[:, [*order, *(4 + i for i in order)]], kind, 0.01)
        assert np.array_equal(hit, hit2)
        np.testing.assert_allclose(time, time2, rtol=0, atol=1e-9)
    shuffle = rng.permutation(len(q))
    hit3, time3 = time_of_impact(q[shuffle], kind, 0.01)
    assert np.array_equal(hit3, hit[shuffle]) and np.array_equal(time3, time[shuffle])


@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("separation", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("shape", ["plain", "slivers", "rigid"])
def test_distance_at_the_time_of_impact(kind, separation, shape):
    """Never below the separation, a hundredth of the starting gap above it at most; clear pairs stay clear (sampled)."""
    rng = np.random.default_rng(2)
    n = 4000
    q = rng.normal(size=(n, 8, 3))
    if shape == "slivers":
        q[:, 3] = q[:, 2] + 1e-7 * q[:, 3]
        q[:, 7] = q[:, 6] + 1e-7 * q[:, 7]
    if shape == "rigid":
        q[:, 5:] = q[:, 1:4] + q[:, 5:6]
    hit, time = time_of_impact(q, kind, separation, max_iterations=20000)  # edges that turn far while near take many
    assert 10 < hit.sum() < n - 50
    start = distances(q[:, :4], kind)
    at = distances(q[:, :4] + time[:, None, None] * (q[:, 4:] - q[:, :4]), kind)
    late = hit & (start > separation + 1e-9)
    gap, left = start - separation, at - separation
    assert (left[late] >= 0.0).all() and (left[late] <= 0.01 * gap[late] + 1e-9).all()
    assert (time[hit & ~late] == 0.0).all()
    for t in np.linspace(0.0, 1.0, 101):
        near = distances(q[:, :4] + t * (q[:, 4:] - q[:, :4]), kind) < separation - 1e-12
        assert (hit[near] & (time[near] <= t)).all()


def test_iterations_run_out_on_the_safe_side():
    rng = np.random.default_rng(3)
    q = rng.normal(size=(3000, 8, 3))
    hit, time = time_of_impact(q, "edge_edge")
    hit1, time1 = time_of_impact(q, "edge_edge", max_iterations=1)
    assert (hit1 >= hit).all() and (time1 <= time).all() and hit1.sum() > hit.sum()


def test_kinds_and_separations_one_by_one():
    rng = np.random.default_rng(4)
    q, kinds, apart = rng.normal(size=(200, 8, 3)), rng.integers(0, 2, 200), rng.random(200)
    hit, time = time_of_impact(q, kinds, apart)
    for i in range(200):
        assert one(q[i : i + 1], int(kinds[i]), apart[i]) == (hit[i], time[i])


def test_threads_do_not_matter():
    rng = np.random.default_rng(5)
    q = rng.normal(size=(40000, 8, 3))
    alone, together = (time_of_impact(q, "edge_edge", threads=threads) for threads in (1, 3))
    assert np.array_equal(alone[0], together[0]) and np.array_equal(alone[1], together[1])


def test_nothing_and_wrong_input():
    hit, time = time_of_impact(np.zeros((0, 8, 3)), "edge_edge")
    assert hit.shape == time.shape == (0,)
    good = falling((0.25, 0.25))
    for wrong in (np.nan, np.inf, -np.inf, 1e200):
        for corner in range(8):
            bad = np.concatenate([good, good])
            bad[1, corner, 1] = wrong
            with pytest.raises(InputError, match="query 1"):
                time_of_impact(bad, "vertex_face")
    with pytest.raises(InputError, match="shape"):
        time_of_impact(good[0], "vertex_face")
    with pytest.raises(InputError, match="vertex_face or edge_edge"):
        time_of_impact(good, "vertex_vertex")
    with pytest.raises(InputError, match="min_separation"):
        time_of_impact(good, "vertex_face", -1.0)
    with pytest.raises(InputError, match="min_separation"):
        time_of_impact(good, "vertex_face", np.nan)
    with pytest.raises(InputError, match="cubic"):
        time_of_impact(good, "vertex_face", 0.1, method="cubic")
    with pytest.raises(InputError, match="method"):
        time_of_impact(good, "vertex_face", method="exact")
