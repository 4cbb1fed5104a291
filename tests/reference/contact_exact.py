"""Exact rational geometry of segments and triangles, as slow and plain as it can be."""

from fractions import Fraction
from itertools import combinations

import numpy as np


def rational(point: np.ndarray) -> list[Fraction]:
    return [Fraction(float(v)) for v in point]


def _solve(columns: list[list[Fraction]], right: list[Fraction]) -> tuple[str, list[Fraction]]:
    """Gauss: ("one", x), ("none", []) or ("many", [])."""
    rows = [[column[i] for column in columns] + [right[i]] for i in range(3)]
    n, pivots, r = len(columns), [], 0
    for c in range(n):
        p = next((i for i in range(r, 3) if rows[i][c] != 0), None)
        if p is None:
            continue
        rows[r], rows[p] = rows[p], rows[r]
        rows[r] = [v / rows[r][c] for v in rows[r]]
        for i in range(3):
            if i != r:
                rows[i] = [v - rows[i][c] * w for v, w in zip(rows[i], rows[r], strict=True)]
        pivots.append(c)
        r += 1
    if any(row[n] != 0 for row in rows[r:]):
        return "none", []
    return ("one", [rows[k][n] for k in range(n)]) if r == n else ("many", [])


def squared_distance(first: np.ndarray, second: np.ndarray) -> Fraction:
    """Of two simplices (k, 3) with k <= 3, exactly: the least over all pairs of their faces' affine hulls' closest points
    that lie inside both."""
    a, b = [rational(p) for p in first], [rational(p) for p in second]
    best = None
    for i in range(1, len(a) + 1):
        for j in range(1, len(b) + 1):
            for s in combinations(a, i):
                for t in combinations(b, j):
                    d = _inside(s, t)
                    if d is not None and (best is None or d < best):
                        best = d
    return best


def _inside(s: tuple, t: tuple) -> Fraction | None:
    """Squared distance of the affine hulls if the closest points are one in each and inside; None otherwise."""
    u = [[p - q for p, q in zip(v, s[0], strict=True)] for v in s[1:]]
    w = [[q - p for p, q in zip(v, t[0], strict=True)] for v in t[1:]]
    g = u + w
    gap = [p - q for p, q in zip(s[0], t[0], strict=True)]
    if len(g) > 3:
        return None  # a plane meets a plane: smaller faces give the same distance
    dot = lambda p, q: sum(x * y for x, y in zip(p, q, strict=True))  # noqa: E731
    n = len(g)
    columns = [[dot(g[r], g[c]) for r in range(n)] + [Fraction(0)] * (3 - n) for c in range(n)]
    kind, at = _solve(columns, [-dot(row, gap) for row in g] + [Fraction(0)] * (3 - n)) if n else ("one", [])
    if kind != "one":
        return None
    p, q = at[: len(u)], at[len(u) :]
    if any(v < 0 for v in at) or sum(p) > 1 or sum(q) > 1:
        return None
    way = [gap[k] + sum(c * v[k] for c, v in zip(at, g, strict=True)) for k in range(3)]
    return dot(way, way)


def meet(edge: np.ndarray, triangle: np.ndarray) -> bool:
    """Whether a segment and a triangle have a point in common."""
    return squared_distance(edge, triangle) == 0


def crosses(edge: np.ndarray, triangle: np.ndarray) -> bool:
    """The same, and the ends are strictly on different sides of the triangle's plane."""
    a, b, c, p, q = (rational(v) for v in (*triangle, *edge))
    u, v = ([y - x for x, y in zip(a, o, strict=True)] for o in (b, c))
    n = [u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3] for k in range(3)]
    side = [sum(n[k] * (o[k] - a[k]) for k in range(3)) for o in (p, q)]
    return side[0] * side[1] < 0 and meet(edge, triangle)
