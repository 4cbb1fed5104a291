"""Whether and when two moving features meet, decided exactly in integers: the referee of continuous collision detection.

Corners (8, 3) are integers: four at the start, four at the end (vertex and face, or both edges), moving along straight
lines. A place where features meet is a root of a polynomial in time with integer coefficients (coplanarity; in motion
within a plane, collinearity; within a line, coincidence), so it is an algebraic number: kept as a polynomial without
double roots and an interval with just this root, and the sign of any other polynomial there follows from a greatest
common divisor and from Sturm's count of roots. Slow and sure.
"""

from fractions import Fraction
from functools import reduce
from itertools import combinations
from math import gcd

Poly = tuple[int, ...]  # integer coefficients from the constant on, last one not 0; () is the zero polynomial


def trim(p: list[int]) -> Poly:
    """Without leading zeros."""
    while p and p[-1] == 0:
        p.pop()
    return tuple(p)


def add(p: Poly, q: Poly) -> Poly:
    """p + q."""
    n = max(len(p), len(q))
    return trim([(p[i] if i < len(p) else 0) + (q[i] if i < len(q) else 0) for i in range(n)])


def times(p: Poly, q: Poly) -> Poly:
    """p q."""
    out = [0] * max(len(p) + len(q) - 1, 0)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            out[i + j] += a * b
    return trim(out)


def minus(p: Poly, q: Poly) -> Poly:
    """p - q."""
    return add(p, tuple(-c for c in q))


def slope(p: Poly) -> Poly:
    """dp/dt."""
    return tuple(i * c for i, c in enumerate(p))[1:]


def primitive(p: Poly) -> Poly:
    """p over the greatest common divisor of its coefficients."""
    d = reduce(gcd, p, 0)
    return tuple(c // d for c in p) if d > 1 else p


def remainder(p: Poly, q: Poly) -> Poly:
    """p mod q times a positive number."""
    r = list(p)
    while len(r) >= len(q):
        top, shift = r[-1], len(r) - len(q)
        factor = abs(q[-1])
        sign = 1 if q[-1] > 0 else -1
        r = [c * factor for c in r]
        for i, c in enumerate(q):
            r[i + shift] -= sign * top * c
        r = list(trim(r))
    return primitive(tuple(r))


def common(p: Poly, q: Poly) -> Poly:
    """Greatest common divisor."""
    while q:
        p, q = q, remainder(p, q)
    return primitive(p)


def quotient(p: Poly, q: Poly) -> Poly:
    """p / q, which must come out even, times some number."""
    r, out = [Fraction(c) for c in p], [Fraction(0)] * (len(p) - len(q) + 1)
    for shift in range(len(p) - len(q), -1, -1):
        out[shift] = r[shift + len(q) - 1] / q[-1]
        for i, c in enumerate(q):
            r[i + shift] -= out[shift] * c
    bottom = reduce(lambda a, b: a * b // gcd(a, b), (f.denominator for f in out), 1)
    return primitive(tuple(int(f * bottom) for f in out))


def value(p: Poly, t: Fraction) -> Fraction:
    """p(t)."""
    return reduce(lambda total, c: total * t + c, reversed(p), Fraction(0))


def sturm(p: Poly) -> list[Poly]:
    """Sturm's chain of a polynomial without double roots."""
    chain = [p, slope(p)]
    while chain[-1]:
        chain.append(tuple(-c for c in remainder(chain[-2], chain[-1])))
    return chain[:-1]


def changes(chain: list[Poly], t: Fraction) -> int:
    """Changes of sign along the chain."""
    signs = [v > 0 for p in chain if (v := value(p, t)) != 0]
    return sum(a != b for a, b in zip(signs, signs[1:], strict=False))


class Root:
    """The one root of ``p`` (without double roots) in (low, high]; low = high once it is known to be just that."""

    def __init__(self, p: Poly, low: Fraction, high: Fraction) -> None:
        self.p = p
        self.at_high = value(p, high)
        self.low, self.high = (low if self.at_high else high), high

    def halve(self) -> None:
        """Half of the interval."""
        middle = (self.low + self.high) / 2
        there = value(self.p, middle)
        if there == 0:
            self.low = self.high = middle
        elif (there > 0) == (self.at_high > 0):
            self.high = middle
        else:
            self.low = middle

    def sign(self, q: Poly) -> int:
        """Sign of q at the root."""
        if len(q) < 2:
            return 0 if not q else (1 if q[0] > 0 else -1)
        steepest = sum(i * abs(c) for i, c in enumerate(q))  # |dq/dt| is at most this where |t| <= 1
        for attempt in range(40):
            at_high = value(q, self.high)
            if abs(at_high) > steepest * (self.high - self.low):
                return 1 if at_high > 0 else -1
            if self.low == self.high:
                return 0
            if attempt == 24:  # very likely 0
                shared = common(self.p, q)
                if len(shared) > 1:
                    chain = sturm(shared)
                    if changes(chain, self.low) > changes(chain, self.high):
                        return 0
            self.halve()
        while abs(value(q, self.high)) <= steepest * (self.high - self.low):
            self.halve()
        return 1 if value(q, self.high) > 0 else -1

    def bounds(self, width: Fraction = Fraction(1, 1 << 62)) -> tuple[Fraction, Fraction]:
        """The root lies in (low, high]."""
        while self.high - self.low > width:
            self.halve()
        return self.low, self.high


def roots(p: Poly) -> list[Root]:
    """All roots in [0, 1], in order."""
    if len(p) < 2:
        return []
    p = quotient(p, common(p, slope(p)))
    chain = sturm(p)
    found, stack = [], [(Fraction(-1, 4), Fraction(1))]
    while stack:
        low, high = stack.pop()
        count = changes(chain, low) - changes(chain, high)
        if count == 1:
            found.append(Root(p, low, high))
        elif count > 1:
            middle = (low + high) / 2
            stack += [(middle, high), (low, middle)]
    return [root for root in found if root.sign((0, 1)) >= 0]


Vector = tuple[Poly, Poly, Poly]


def difference(p: Vector, q: Vector) -> Vector:
    """p - q."""
    return tuple(minus(a, b) for a, b in zip(p, q, strict=True))


def cross(p: Vector, q: Vector) -> Vector:
    """p x q."""
    return tuple(minus(times(p[i - 2], q[i - 1]), times(p[i - 1], q[i - 2])) for i in range(3))


def dot(p: Vector, q: Vector) -> Poly:
    """p . q."""
    return reduce(add, (times(a, b) for a, b in zip(p, q, strict=True)))


def on_segment(root: Root, p: Vector, a: Vector, b: Vector) -> bool:
    """Whether p lies on the segment from a to b."""
    pa, pb = difference(p, a), difference(p, b)
    return root.sign(dot(pa, pb)) <= 0 and all(root.sign(c) == 0 for c in cross(pa, pb))


def meet(root: Root, kind: int, x: list[Vector]) -> bool:
    """Whether the features, coplanar at the root, meet there."""
    p, q = (
        (difference(x[1], x[0]), difference(x[3], x[2])) if kind else (difference(x[2], x[1]), difference(x[3], x[1]))
    )
    normal = cross(p, q)
    axis = next((c for c in range(3) if root.sign(normal[c]) != 0), None)
    if kind:
        if axis is None:  # parallel: an end of one lies on the other
            ends = ((0, 2, 3), (1, 2, 3), (2, 0, 1), (3, 0, 1))
            return any(on_segment(root, x[i], x[a], x[b]) for i, a, b in ends)
        sides = [
            [root.sign(cross(difference(x[i], x[a]), line)[axis]) for i in ends]
            for ends, a, line in (((0, 1), 2, q), ((2, 3), 0, p))
        ]
        return all(s[0] * s[1] <= 0 for s in sides)
    if axis is None:  # no area: on one of the sides
        return any(on_segment(root, x[0], x[a], x[b]) for a, b in ((1, 2), (2, 3), (3, 1)))
    signs = {
        root.sign(cross(difference(x[b], x[a]), difference(x[0], x[a]))[axis]) for a, b in ((1, 2), (2, 3), (3, 1))
    }
    return not {1, -1} <= signs


def first_meeting(corners: list[list[int]], kind: int) -> Root | None:
    """The first time in [0, 1] at which vertex and face (kind 0) or two edges (kind 1) have a point in common, or None."""
    for c in range(3):  # on two sides of a plane at the start and at the end: no need for more
        first, second = ((0, 1), (2, 3)) if kind else ((0,), (1, 2, 3))
        for sign in (1, -1):
            ends = (0, 4)
            if all(sign * (corners[e + i][c] - corners[e + j][c]) > 0 for e in ends for i in first for j in second):
                return None
    x: list[Vector] = [
        tuple(trim([int(a), int(b) - int(a)]) for a, b in zip(corners[k], corners[k + 4], strict=True))
        for k in range(4)
    ]
    r = [difference(x[k], x[0]) for k in (1, 2, 3)]
    coplanar = dot(r[0], cross(r[1], r[2]))
    if coplanar:
        times_ = roots(coplanar)
    else:  # moving in a plane: at a first meeting, a corner lies on a side
        at_start = Root((0, 1), Fraction(0), Fraction(0))
        lines = [cross(difference(x[i], x[j]), difference(x[i], x[k])) for i, j, k in combinations(range(4), 3)]
        points = [difference(x[i], x[j]) for i, j in combinations(range(4), 2)]
        times_ = [at_start, *(root for v in (*lines, *points) for p in v for root in roots(p))]
    hits = [root for root in times_ if meet(root, kind, x)]
    return min(hits, key=lambda root: root.bounds()[1], default=None)
