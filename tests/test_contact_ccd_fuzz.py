"""Continuous collision detection against exact arithmetic on a grid of dyadic numbers: no miss, never late.

Corners are small integers times a power of two plus a multiple of it, so positions and their differences are exact in
floating point and the truth does not change with scale and place; many pairs touch exactly: at corners, on sides, at
the start, at the end, in a plane, along a line, without area or length.
"""

from fractions import Fraction

import numpy as np
import pytest
from reference.ccd_exact import Root, first_meeting

from turnbuckle.contact.ccd_bulk import time_of_impact


def grid_queries(rng: np.random.Generator, n: int, size: int) -> np.ndarray:
    """Integers (n, 8, 3) up to ``size``: free ones, in a plane, along a line, with repeated corners, moved as one."""
    q = rng.integers(-size, size + 1, size=(n, 8, 3))
    sort = rng.integers(0, 8, n)
    axis = rng.integers(0, 3, n)
    for i in np.flatnonzero(sort == 1):  # in a plane
        q[i, :, axis[i]] = 0
    for i in np.flatnonzero(sort == 2):  # along a line
        q[i, :, axis[i]] = q[i, :, axis[i] - 1] = 0
    for i in np.flatnonzero(sort == 3):  # a face without area, or an edge without length
        q[i, 3::4] = q[i, 2::4]
    for i in np.flatnonzero(sort == 4):  # b rests
        q[i, 6:] = q[i, 2:4]
        q[i, 5] = q[i, 1]
    for i in np.flatnonzero(sort == 5):  # in planes that approach along an axis
        q[i, :, axis[i]] = np.array([2, 0, 0, 0, -2, 0, 0, 0]) + np.array([0, 2, 0, 0, 0, -2, 0, 0]) * rng.integers(
            0, 2
        )
    return q


def judge(q: np.ndarray, kind: int) -> list[Root | None]:
    return [first_meeting(corners, kind) for corners in q.tolist()]


def check(q: np.ndarray, kind: int, rng: np.random.Generator) -> tuple[int, int]:
    """Meetings, and those that the paper's cubic test misses. Every one is found in time, at any scale and place."""
    true = judge(q, kind)
    meets = np.array([root is not None for root in true])
    latest = [root.bounds()[1] if root is not None else Fraction(2) for root in true]
    for power, offset in ((0, 0), (-20, 1 << 20), (20, 0), (-300, 12345), (int(rng.integers(-60, 60)), 1 << 40)):
        hit, time = time_of_impact(np.ldexp((q + offset).astype(float), power), kind)
        assert hit[meets].all(), f"missed: {q[meets & ~hit][0].tolist()}"
        late = [i for i in np.flatnonzero(hit) if Fraction(time[i]) > latest[i]]
        assert not late, f"late: {q[late[0]].tolist()}"
        assert hit.sum() - meets.sum() < 0.05 * len(q)  # false alarms: nearer than a hundredth of the starting gap
    cubic, _ = time_of_impact(q.astype(float), kind, method="cubic")
    return int(meets.sum()), int((meets & ~cubic).sum())


@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("size", [2, 8, 1000])
def test_no_miss_on_a_dyadic_grid(kind, size):
    """Also how many the cubic test misses: motion in a plane, and touching of corners and sides."""
    rng = np.random.default_rng([kind, size])
    meetings, missed = check(grid_queries(rng, 300, size), kind, rng)
    assert meetings > 40
    assert missed > 0.02 * meetings


@pytest.mark.slow
@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("size", [1, 2, 3, 5, 8, 64, 1 << 20])
def test_no_miss_in_tens_of_thousands(kind, size):
    rng = np.random.default_rng([7, kind, size])
    check(grid_queries(rng, 2000, size), kind, rng)


@pytest.mark.parametrize("kind", [0, 1])
def test_meetings_built_to_touch_at_a_known_time(kind):
    """Features through one point at a time k / 48, in general motion: there on a corner, on a side, or inside."""
    rng = np.random.default_rng(kind)
    n = 20000
    k = rng.integers(0, 49, n)[:, None, None]
    place, u, v = rng.integers(-99, 100, (3, n, 1, 3))
    if kind:  # s / 4 along edge a, t / 4 along edge b
        s, t = rng.integers(0, 5, (2, n, 1, 1))
        moment = place + np.concatenate([-s * u, (4 - s) * u, -t * v, (4 - t) * v], axis=1)
    else:  # weights of the face's corners over their sum
        a, b, c = rng.integers(0, 3, (3, n, 1, 1))
        first, total = place - b * u - c * v, a + b + c
        moment = np.concatenate([place, first, first + total * u, first + total * v], axis=1)
    speed = rng.integers(-99, 100, (n, 4, 3))
    q = np.concatenate([48 * moment - k * speed, 48 * moment + (48 - k) * speed], axis=1) / 64.0
    k = k[:, 0, 0] / 48
    hit, time = time_of_impact(q, kind)
    assert hit.all() and (time <= k).all()
    assert np.median(k - time) < 0.02
    cubic = time_of_impact(q, kind, method="cubic")[0]
    assert 0.01 < np.mean(~cubic) < 0.5  # corners and sides: by chance
