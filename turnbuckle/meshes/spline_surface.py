"""A closed bicubic B-spline surface over rings of control points, as a linear map of them.

Rows of control points run along the surface: a pole, rings of `around` points, a pole. Around, the spline is uniform
and periodic; along, its knots are simple inside (so the surface is C2) and fourfold at the ends, where it reaches the
poles. The ring next to a pole should lie in one plane with it: then that is the tangent plane there.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, kron

from turnbuckle.meshes.solids import ring_triangles

DEGREE = 3


@dataclass(frozen=True)
class SplineSurface:
    """Vertices are ``weights @ controls``; the controls are the rings one after the other, then both poles."""

    weights: csr_array  # (n, rings * around + 2), rows sum to 1
    triangles: np.ndarray  # (m, 3) int32; outwards where rings turn left about the way from the first to the last


def spline_surface(rings: int, around: int, resolution: int) -> SplineSurface:
    """The surface of ``rings`` (at least 2) of ``around`` (at least 3) control points, ``resolution`` cells a span."""
    u = np.linspace(0.0, spans(rings), spans(rings) * resolution + 1)
    v = np.arange(around * resolution) / resolution
    inside = grid_weights(u[1:-1], v, rings, around)
    poles = csr_array((np.ones(2), ([0, 1], [rings * around, rings * around + 1])), shape=(2, inside.shape[1]))
    weights = _stack(inside, poles)
    return SplineSurface(weights, ring_triangles(len(u) - 2, len(v)))


def spans(rings: int) -> int:
    """Pieces of the surface along it; the parameter along goes from 0 to this."""
    return rings + 2 - DEGREE


def grid_weights(u: np.ndarray, v: np.ndarray, rings: int, around: int) -> csr_array:
    """Weights of the controls at all (u, v), u slowest, (len(u) len(v), rings around + 2): u along, v in [0, around)."""
    rows = rings + 2
    knots = np.r_[np.zeros(DEGREE), np.arange(spans(rings) + 1.0), np.full(DEGREE, float(spans(rings)))]
    along = csr_array(BSpline.design_matrix(np.asarray(u, dtype=np.float64), knots, DEGREE))
    both = kron(along, _periodic(np.asarray(v, dtype=np.float64), around), format="csr")
    # The first and the last row are one point each.
    ring = np.arange(rings * around)
    column = np.r_[np.full(around, len(ring)), ring, np.full(around, len(ring) + 1)]
    merge = csr_array(
        (np.ones(rows * around), (np.arange(rows * around), column)), shape=(rows * around, len(ring) + 2)
    )
    return csr_array(both @ merge)


def _periodic(v: np.ndarray, count: int) -> csr_array:
    """Uniform cubic B-spline weights on a closed ring, (len(v), count)."""
    i = np.floor(v).astype(np.int64)
    t = v - i
    weights = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6.0
    columns = (i[:, None] + np.arange(-1, 3)) % count
    rows = np.repeat(np.arange(len(v)), 4)
    return csr_array((weights.ravel(), (rows, columns.ravel())), shape=(len(v), count))  # sums what names one twice


def ring_gain(around: int) -> float:
    """By how much a ring of control points on a circle is larger than the spline's circle, at the controls."""
    return float(3.0 / (2.0 + np.cos(2.0 * np.pi / around)))


def _stack(a: csr_array, b: csr_array) -> csr_array:
    return csr_array(
        (np.r_[a.data, b.data], np.r_[a.indices, b.indices], np.r_[a.indptr, a.indptr[-1] + b.indptr[1:]]),
        shape=(a.shape[0] + b.shape[0], a.shape[1]),
    )
