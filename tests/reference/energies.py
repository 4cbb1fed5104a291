"""Distance, area and volume energies of Teschner, Heidelberger, Mueller and Gross 2004, with damping.

An element has one number ``C(p)``, its relative change of length, area or (signed) volume::

    distance  C = (|p1 - p0| - D0) / D0                                  two points
    area      C = (|(p1 - p0) x (p2 - p0)| / 2 - A0) / A0                three points
    volume    C = ((p1 - p0) . ((p2 - p0) x (p3 - p0)) / 6 - V0) / V0    four points

its energy is ``E = k C^2 / 2`` [J] and the force on its point i ``-(k C + k_d sum_j dC/dp_j . v_j) dC/dp_i`` [N].

Everything runs on complex input too (no ``abs``, no ``norm``, no conjugation), so that a derivative can be taken by
a complex step: ``f'(x) = Im f(x + i e) / e``, exact to rounding because nothing is subtracted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

STEP = 1e-30  # of the complex step [unit of the variable]


def dot(a: np.ndarray, b: np.ndarray) -> complex:
    """Sum of products, without the conjugate that ``np.vdot`` takes."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def length(a: np.ndarray) -> complex:
    """Length of a vector; analytic, so that a complex step may pass through it."""
    return np.sqrt(dot(a, a))


@dataclass(frozen=True)
class Element:
    """One energy: ``kind`` is "distance", "area" or "volume"."""

    kind: str
    points: tuple[int, ...]  # 2, 3 or 4 indices
    rest: float  # D0 [m], A0 [m^2], V0 [m^3]
    k: float  # [J]
    k_d: float = 0.0  # [J s]


def measure(kind: str, p: np.ndarray) -> complex:
    """Length [m], area [m^2] or signed volume [m^3] of the points ``p``, shape (2 | 3 | 4, 3)."""
    if kind == "distance":
        return length(p[1] - p[0])
    if kind == "area":
        return 0.5 * length(np.cross(p[1] - p[0], p[2] - p[0]))
    return dot(p[1] - p[0], np.cross(p[2] - p[0], p[3] - p[0])) / 6.0


def measure_gradient(kind: str, p: np.ndarray) -> np.ndarray:
    """Derivative of `measure` by the points, same shape as ``p``."""
    g = np.zeros_like(p)
    if kind == "distance":
        g[1] = (p[1] - p[0]) / length(p[1] - p[0])
        g[0] = -g[1]
        return g
    a, b = p[1] - p[0], p[2] - p[0]
    if kind == "area":
        n = np.cross(a, b)
        n = n / length(n)
        # d|a x b| = n . (da x b + a x db) = da . (b x n) + db . (n x a)
        g[1] = 0.5 * np.cross(b, n)
        g[2] = 0.5 * np.cross(n, a)
        g[0] = -g[1] - g[2]
        return g
    c = p[3] - p[0]
    g[1] = np.cross(b, c) / 6.0
    g[2] = np.cross(c, a) / 6.0
    g[3] = np.cross(a, b) / 6.0
    g[0] = -g[1] - g[2] - g[3]
    return g


def strain(element: Element, x: np.ndarray) -> complex:
    """C of the element [1]; ``x`` are all points [m], shape (n, 3)."""
    return (measure(element.kind, x[list(element.points)]) - element.rest) / element.rest


def energy(elements: Sequence[Element], x: np.ndarray) -> complex:
    """Sum of k C^2 / 2 [J]."""
    return sum(0.5 * e.k * strain(e, x) ** 2 for e in elements)


def forces(elements: Sequence[Element], x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Elastic and damping forces on all points [N], shape (n, 3)."""
    out = np.zeros(x.shape, dtype=np.result_type(x, v))
    for e in elements:
        gradient = measure_gradient(e.kind, x[list(e.points)]) / e.rest
        rate = sum(dot(g, v[i]) for g, i in zip(gradient, e.points, strict=True))
        tension = e.k * strain(e, x) + e.k_d * rate
        for g, i in zip(gradient, e.points, strict=True):
            out[i] -= tension * g
    return out


def spring(i: int, j: int, rest: float, stiffness: float, damping: float = 0.0) -> Element:
    """Hookean spring of ``stiffness`` s [N/m] and ``damping`` [N s/m]: s (|d| - L0) = (k / L0) C, so k = s L0^2."""
    return Element("distance", (i, j), rest, stiffness * rest**2, damping * rest**2)


def edges_of(tetrahedra: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Every edge once, sorted."""
    pairs = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
    return sorted({tuple(sorted((int(t[a]), int(t[b])))) for t in tetrahedra for a, b in pairs})


def faces_of(tetrahedra: Sequence[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Every triangle once, inner ones too, sorted."""
    triples = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
    return sorted({tuple(sorted(int(t[a]) for a in f)) for t in tetrahedra for f in triples})


def solid(
    rest: np.ndarray,
    tetrahedra: Sequence[Sequence[int]],
    k: tuple[float, float, float],
    k_d: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Element]:
    """A tetrahedral body at rest in ``rest`` [m], (n, 3): an energy an edge, a face and a tetrahedron.

    ``k`` [J] and ``k_d`` [J s] of distance, area and volume.
    """
    points = (edges_of(tetrahedra), faces_of(tetrahedra), [tuple(int(i) for i in t) for t in tetrahedra])
    return [
        Element(kind, p, float(measure(kind, rest[list(p)])), k[which], k_d[which])
        for which, kind in enumerate(("distance", "area", "volume"))
        for p in points[which]
    ]


Force = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def jacobians(force: Force, x: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """dF/dx [N/m] and dF/dv [N s/m], each (3n, 3n), of ``force(x, v, t)`` by complex steps."""
    n = x.size
    k, d = np.zeros((n, n)), np.zeros((n, n))
    for column in range(n):
        shift = np.zeros(n, dtype=complex)
        shift[column] = 1j * STEP
        shift = shift.reshape(x.shape)
        k[:, column] = np.imag(force(x + shift, v + 0j, t)).ravel() / STEP
        d[:, column] = np.imag(force(x + 0j, v + shift, t)).ravel() / STEP
    return k, d


def jacobians_by_differences(
    force: Force, x: np.ndarray, v: np.ndarray, t: float, step: float = 1e-6
) -> tuple[np.ndarray, np.ndarray]:
    """As `jacobians`, by central differences: for a force that takes no complex input."""
    n = x.size
    k, d = np.zeros((n, n)), np.zeros((n, n))
    for column in range(n):
        shift = np.zeros(n)
        shift[column] = step
        shift = shift.reshape(x.shape)
        k[:, column] = (force(x + shift, v, t) - force(x - shift, v, t)).ravel() / (2.0 * step)
        d[:, column] = (force(x, v + shift, t) - force(x, v - shift, t)).ravel() / (2.0 * step)
    return k, d
