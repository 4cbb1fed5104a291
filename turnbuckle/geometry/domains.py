"""Domains that a point may be in: one mechanism, the nearest permissible point (Displacement, 4.1.3).

All coordinates are those of the domain's own frame; of `Segment`, `Ring` and `Sphere` z is the axis and the origin
the middle. Curves are in `curve_domain.py`, surfaces in `surface_domain.py`. A user's domain is a function.

A domain answers two questions for points p (n, 3):

* `nearest(p)`: the nearest permissible points (n, 3), p itself where it is permissible.
* `held(p)`: which directions are held there, see `Held`. What is inside a domain of full dimension has none.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from turnbuckle.data.errors import InputError

AT_LIMIT = 1e-9  # of the size of the numbers: this near to a limit counts as on it
STEP = 1e-6  # of the size of the numbers: how far a user's function is probed
FREE_PART = 0.75  # a direction is free where the nearest point follows by more than this


@dataclass(frozen=True)
class Held:
    """What a domain holds of points near it.

    With d_k = ``directions[:, k]`` and P the point, the condition is ``d_k . (P - point) = 0`` for k < count where
    ``one_sided`` is False, and ``>= 0`` where it is True (d_k points into the domain). The rows of ``directions`` are
    an orthonormal basis, those from count on are free. Held directions are the gradients of the gaps at ``point``, so
    that Newton steps converge quadratically on smooth domains however they are curved. The choice of basis within the
    held directions may jump from call to call: keep forces as vectors, not as multipliers.
    """

    point: np.ndarray  # (n, 3) nearest permissible point [m]
    directions: np.ndarray  # (n, 3, 3), rows
    count: np.ndarray  # (n,) int, 0 to 3
    one_sided: np.ndarray  # (n, 3) bool


class Domain(ABC):
    """Where a point may be."""

    @abstractmethod
    def nearest(self, p: np.ndarray) -> np.ndarray:
        """Nearest permissible points [m], shape (n, 3), of points ``p`` of the same shape."""

    @abstractmethod
    def held(self, p: np.ndarray) -> Held:
        """What is held of points ``p`` (n, 3) [m]."""


def basis(first: np.ndarray) -> np.ndarray:
    """Right-handed orthonormal bases (n, 3, 3), rows, that begin with the unit vectors ``first`` (n, 3)."""
    least = np.eye(3)[np.argmin(np.abs(first), axis=1)]
    second = np.cross(first, least)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _unit(v: np.ndarray, otherwise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors and lengths; ``otherwise`` where there is no length."""
    length = np.linalg.norm(v, axis=1)
    some = length > 0.0
    return np.where(some[:, None], v / np.where(some, length, 1.0)[:, None], otherwise), length


def _limits(value: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Clamped values; side: +1 at the lower limit, -1 at the upper, 0 between; whether both are the same."""
    slack = AT_LIMIT * np.maximum(1.0, np.abs(value))
    side = (value <= lo + slack).astype(int) - (value >= hi - slack)
    return np.clip(value, lo, hi), side, hi - lo <= slack


class _Limited(Domain):
    """Domains with one limited coordinate; ``lo`` and ``hi`` are numbers or one for each point asked about."""

    def __init__(self, lo: np.ndarray | float = -np.inf, hi: np.ndarray | float = np.inf) -> None:
        self.lo, self.hi = np.asarray(lo, dtype=float), np.asarray(hi, dtype=float)

    def _bounds(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        return np.broadcast_to(self.lo, (n,)), np.broadcast_to(self.hi, (n,))


class Point(Domain):
    """The origin alone (3.1)."""

    def nearest(self, p: np.ndarray) -> np.ndarray:
        return np.zeros_like(p)

    def held(self, p: np.ndarray) -> Held:
        n = len(p)
        return Held(np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.full(n, 3), np.zeros((n, 3), bool))


class Segment(_Limited):
    """On the z axis between lo and hi (4.1.1)."""

    def nearest(self, p: np.ndarray) -> np.ndarray:
        lo, hi = self._bounds(len(p))
        out = np.zeros_like(p)
        out[:, 2] = np.clip(p[:, 2], lo, hi)
        return out

    def held(self, p: np.ndarray) -> Held:
        n = len(p)
        lo, hi = self._bounds(n)
        z, side, same = _limits(p[:, 2], lo, hi)
        point, one_sided = np.zeros((n, 3)), np.zeros((n, 3), bool)
        point[:, 2] = z
        directions = np.tile(np.eye(3), (n, 1, 1))
        directions[:, 2, 2] = np.where(side < 0, -1.0, 1.0)
        limited = (side != 0) | same
        one_sided[:, 2] = limited & ~same
        return Held(point, directions, 2 + limited, one_sided)


class Ring(_Limited):
    """In the plane z = 0 at a distance from the origin between lo and hi (4.1.2)."""

    def nearest(self, p: np.ndarray) -> np.ndarray:
        lo, hi = self._bounds(len(p))
        out = p * np.array([1.0, 1.0, 0.0])
        radial, r = _unit(out, np.array([1.0, 0.0, 0.0]))
        outside = (r < lo) | (r > hi)
        out[outside] = radial[outside] * np.clip(r, lo, hi)[outside, None]
        return out

    def held(self, p: np.ndarray) -> Held:
        n = len(p)
        lo, hi = self._bounds(n)
        flat = p * np.array([1.0, 1.0, 0.0])
        radial, r = _unit(flat, np.array([1.0, 0.0, 0.0]))
        _, side, same = _limits(r, np.where(lo > 0.0, lo, -np.inf), hi)
        directions = np.zeros((n, 3, 3))
        directions[:, 0, 2] = 1.0
        directions[:, 1] = radial * np.where(side < 0, -1.0, 1.0)[:, None]
        directions[:, 2] = np.cross(directions[:, 0], directions[:, 1])
        centre = same & (hi <= 0.0)  # a disc without a radius: the point itself
        same |= centre
        limited = (side != 0) | same
        one_sided = np.zeros((n, 3), bool)
        one_sided[:, 1] = limited & ~same & (hi > 0.0)
        return Held(self.nearest(p), directions, 1 + limited + (hi <= 0.0), one_sided)


class Sphere(_Limited):
    """At a distance from the origin between lo and hi: a ball, a shell, or with lo = hi a rod (4.1.3)."""

    def nearest(self, p: np.ndarray) -> np.ndarray:
        lo, hi = self._bounds(len(p))
        out = np.array(p, dtype=float)
        radial, r = _unit(out, np.array([0.0, 0.0, 1.0]))
        outside = (r < lo) | (r > hi)
        out[outside] = radial[outside] * np.clip(r, lo, hi)[outside, None]
        return out

    def held(self, p: np.ndarray) -> Held:
        n = len(p)
        lo, hi = self._bounds(n)
        radial, r = _unit(np.asarray(p, dtype=float), np.array([0.0, 0.0, 1.0]))
        _, side, same = _limits(r, np.where(lo > 0.0, lo, -np.inf), hi)
        limited = (side != 0) | same
        one_sided = np.zeros((n, 3), bool)
        one_sided[:, 0] = limited & ~same & (hi > 0.0) & ~((lo > 0.0) & (hi - lo <= AT_LIMIT))
        count = np.where(hi <= 0.0, 3, limited)
        return Held(self.nearest(p), basis(radial * np.where(side < 0, -1.0, 1.0)[:, None]), count, one_sided)


class Union(Domain):
    """In any of several domains."""

    def __init__(self, parts: Sequence[Domain]) -> None:
        self._parts = list(parts)

    def _choice(self, p: np.ndarray) -> np.ndarray:
        """The domain with the nearest point, the first of them (n,)."""
        distances = [np.linalg.norm(part.nearest(p) - p, axis=1) for part in self._parts]
        return np.argmin(distances, axis=0)

    def nearest(self, p: np.ndarray) -> np.ndarray:
        near, choice = np.array(p, dtype=float), self._choice(p)
        for k in np.unique(choice):
            near[choice == k] = self._parts[k].nearest(p[choice == k])
        return near

    def held(self, p: np.ndarray) -> Held:
        n, choice = len(p), self._choice(p)
        held = Held(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros(n, int), np.zeros((n, 3), bool))
        for k in np.unique(choice):
            rows = choice == k
            part = self._parts[k].held(p[rows])
            for name in ("point", "directions", "count", "one_sided"):
                getattr(held, name)[rows] = getattr(part, name)
        return held


class CallableDomain(Domain):
    """A user's function, p (3,) [m] -> nearest permissible point (3,) [m].

    What it holds is found by probing around the nearest point: a direction is free where the nearest point follows to
    both sides, held on one side where it follows to one. ``size``: of its details [m]; probes go 1e-6 of it.
    """

    def __init__(self, function: Callable[[np.ndarray], np.ndarray], name: str = "domain", size: float = 1.0) -> None:
        self._function, self._name, self._size = function, name, size

    def nearest(self, p: np.ndarray) -> np.ndarray:
        return np.array([self._one(x) for x in np.asarray(p, dtype=float)]).reshape(-1, 3)

    def _one(self, p: np.ndarray) -> np.ndarray:
        try:
            found = np.asarray(self._function(p.copy()), dtype=float)
        except Exception as error:
            raise InputError(f"{self._name}: the domain's function fails at {p.tolist()} ({error!r})") from error
        if found.shape != (3,) or not np.isfinite(found).all():
            where = f"{self._name}: the domain's function, at {p.tolist()},"
            raise InputError(f"{where} gave {found!r}; it must return three finite numbers")
        return found

    def held(self, p: np.ndarray) -> Held:
        n = len(p)
        point = self.nearest(p)
        directions, count, one_sided = np.tile(np.eye(3), (n, 1, 1)), np.zeros(n, int), np.zeros((n, 3), bool)
        for i, x in enumerate(point):
            directions[i], count[i], one_sided[i] = self._probe(x)
        return Held(point, directions, count, one_sided)

    def _probe(self, x: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
        step = STEP * max(self._size, float(np.abs(x).max()))

        def follows(d: np.ndarray) -> np.ndarray:
            return (self._one(x + step * d) - x) / step

        derivative = np.array([0.5 * (follows(e) - follows(-e)) for e in np.eye(3)])
        free, vectors = np.linalg.eigh(0.5 * (derivative + derivative.T))  # ascending: what is held comes first
        directions, count = vectors.T.copy(), int((free < FREE_PART).sum())
        one_sided = np.zeros(3, bool)
        for k in range(count):
            d = directions[k]
            ahead, behind = follows(d) @ d > FREE_PART, follows(-d) @ -d > FREE_PART
            one_sided[k] = ahead != behind
            if behind and not ahead:
                directions[k] = -d
        return directions, count, one_sided
