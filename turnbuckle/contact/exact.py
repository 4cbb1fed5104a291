"""Whether an edge and a triangle meet, in integers: for what floating-point numbers leave in doubt.

Every float64 is an integer times a power of two, so the signs below are those of exact arithmetic.
"""

from collections.abc import Sequence

import numpy as np

Vector = tuple[int, int, int]


def to_integers(points: np.ndarray) -> list[Vector]:
    """Points (n, 3), all scaled by one power of two that makes every coordinate an integer."""
    ratios = [[float(value).as_integer_ratio() for value in point] for point in points]
    scale = max(den for point in ratios for _, den in point)
    return [tuple(num * (scale // den) for num, den in point) for point in ratios]  # type: ignore[misc]


def _sub(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Vector, b: Vector) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)


def edge_meets_triangle(points: Sequence[Vector], touching: bool) -> bool:
    """Whether the edge ``points[:2]`` and the triangle ``points[2:]`` have a point in common.

    Without ``touching`` only if the ends lie on different sides of the triangle's plane, neither in it.
    """
    p, q, a, b, c = points
    normal = _cross(_sub(b, a), _sub(c, a))
    side_p, side_q = _sign(_dot(normal, _sub(p, a))), _sign(_dot(normal, _sub(q, a)))
    if side_p * side_q > 0:
        return False
    if side_p == 0 or side_q == 0:
        if not touching:
            return False
        if side_p == side_q:
            return _level(p, q, a, b, c, normal)
    way = _sub(q, p)
    corner = [_sub(v, p) for v in (a, b, c)]
    turns = {_sign(_dot(way, _cross(corner[i], corner[(i + 1) % 3]))) for i in range(3)}
    return not {1, -1} <= turns


def _level(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector, normal: Vector) -> bool:
    """An edge in the plane of the triangle, or a triangle without area."""
    if any(_edges_meet(p, q, *side) for side in ((a, b), (b, c), (c, a))):
        return True
    if normal == (0, 0, 0):
        return False
    # no side is met: the edge is inside if one end is
    turns = {_sign(_dot(normal, _cross(_sub(v, u), _sub(p, u)))) for u, v in ((a, b), (b, c), (c, a))}
    return not {1, -1} <= turns


def _edges_meet(p: Vector, q: Vector, a: Vector, b: Vector) -> bool:
    """Whether two closed segments, of any length, have a point in common."""
    u, v, w = _sub(q, p), _sub(b, a), _sub(a, p)
    n = _cross(u, v)
    if n != (0, 0, 0):
        if _dot(n, w) != 0:
            return False
        size = _dot(n, n)
        s, t = _dot(_cross(w, v), n), _dot(_cross(w, u), n)
        return 0 <= s <= size and 0 <= t <= size
    long, other = (u, (a, b)) if any(u) else (v, (p, q))
    origin = p if any(u) else a
    if not any(long):
        return p == a
    if any(any(_cross(long, _sub(o, origin))) for o in other):
        return False
    at = sorted(_dot(long, _sub(o, origin)) for o in other)
    return at[0] <= _dot(long, long) and at[1] >= 0
