"""Jacobians of the element forces, K = dF/dx and D = dF/dv, as dense blocks of each element (NumPy, vectorised).

For ``E = k C^2 / 2`` with damping, ``F = -(k C + k_d C') g`` with ``g = dC/dx``, ``C' = g . v``, ``H = d2C/dx2``:

    K = -k g g^T - (k C + k_d C') H - k_d g (H v)^T,        D = -k_d g g^T.

Tension makes the system matrix more definite, compression less: where the negative eigenvalues of ``(k C + k_d C') H``
would outweigh the masses over a step, a linearised step points the wrong way. They are then raised to a bound, and the
last term (which is not symmetric) is scaled down to it. This changes the Jacobian of that element in that step, never the
force; the stiffness of taut elements is always whole.
"""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.model import Model


@dataclass
class Gradients:
    """C, its gradient and Hessian for many elements of one kind, with the element's points."""

    points: np.ndarray  # (n, p) int32
    k: np.ndarray  # (n,) [J]
    k_d: np.ndarray  # (n,) [J s]
    c: np.ndarray  # (n,)
    g: np.ndarray  # (n, 3 p) [1/m]
    h: np.ndarray  # (n, 3 p, 3 p) [1/m^2]


def skew(a: np.ndarray) -> np.ndarray:
    """``[a]x`` with ``[a]x b = a x b``, shape (n, 3, 3)."""
    zero = np.zeros(len(a))
    x, y, z = a.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def to_corners(local: np.ndarray, vectors: int) -> np.ndarray:
    """Matrices over edge vectors from corner 0 -> matrices over corners, (n, 3v, 3v) -> (n, 3v+3, 3v+3)."""
    t = np.hstack([-np.tile(np.eye(3), (vectors, 1)), np.eye(3 * vectors)])
    return np.einsum("ia,nij,jb->nab", t, local, t, optimize=True)


def distances(points: np.ndarray, rest: np.ndarray, k: np.ndarray, k_d: np.ndarray, x: np.ndarray) -> Gradients:
    """``C = |d| / L - 1``; ``H = (I - n n^T) / (|d| L)`` over the edge vector d."""
    d = x[points[:, 1]] - x[points[:, 0]]
    length = np.maximum(np.linalg.norm(d, axis=1), 1e-150)
    n = d / length[:, None]
    h = (np.eye(3) - n[:, :, None] * n[:, None, :]) / (length * rest)[:, None, None]
    gradient = n / rest[:, None]
    return Gradients(points, k, k_d, length / rest - 1.0, np.hstack([-gradient, gradient]), to_corners(h, 1))


def areas(points: np.ndarray, rest: np.ndarray, k: np.ndarray, k_d: np.ndarray, x: np.ndarray) -> Gradients:
    """``C = |n| / (2 A0) - 1``, ``n = e1 x e2``; with ``N = dn/de``,
    ``H |n| = (N^T N - N^T m m^T N) / |n| + m . d2n``, ``m = n / |n|``."""
    e1 = x[points[:, 1]] - x[points[:, 0]]
    e2 = x[points[:, 2]] - x[points[:, 0]]
    n = np.cross(e1, e2)
    length = np.maximum(np.linalg.norm(n, axis=1), 1e-150)
    m = n / length[:, None]
    big = np.concatenate([-skew(e2), skew(e1)], axis=2)
    row = np.einsum("nij,ni->nj", big, m)
    h = (np.einsum("nij,nik->njk", big, big) - row[:, :, None] * row[:, None, :]) / length[:, None, None]
    h[:, 0:3, 3:6] -= skew(m)
    h[:, 3:6, 0:3] += skew(m)
    scale = 0.5 / rest
    gradient = row * scale[:, None]
    full = np.hstack([-gradient[:, :3] - gradient[:, 3:], gradient])
    return Gradients(points, k, k_d, length * scale - 1.0, full, to_corners(h * scale[:, None, None], 2))


def volumes(points: np.ndarray, rest: np.ndarray, k: np.ndarray, k_d: np.ndarray, x: np.ndarray) -> Gradients:
    """``C = a . (b x c) / (6 V0) - 1``; its Hessian over (a, b, c) is made of cross-product matrices."""
    a, b, c = (x[points[:, i]] - x[points[:, 0]] for i in (1, 2, 3))
    scale = 1.0 / (6.0 * rest)
    ga, gb, gc = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    h = np.zeros((len(points), 9, 9))
    h[:, 0:3, 3:6], h[:, 0:3, 6:9] = -skew(c), skew(b)
    h[:, 3:6, 0:3], h[:, 3:6, 6:9] = skew(c), -skew(a)
    h[:, 6:9, 0:3], h[:, 6:9, 3:6] = -skew(b), skew(a)
    gradient = np.hstack([-ga - gb - gc, ga, gb, gc]) * scale[:, None]
    strain = np.einsum("ni,ni->n", a, ga) * scale - 1.0
    return Gradients(points, k, k_d, strain, gradient, to_corners(h * scale[:, None, None], 3))


def all_elements(model: Model, x: np.ndarray) -> list[Gradients]:
    """Every energy of the model at positions ``x`` (points, 3)."""
    s, t = model.springs, model.tetrahedra
    m = t.materials
    return [
        distances(s.pairs, s.length, s.k, s.k_d, x),
        distances(t.edges, t.edge_length, m[t.edge_material, 0], m[t.edge_material, 3], x),
        areas(t.triangles, t.triangle_area, m[t.triangle_material, 1], m[t.triangle_material, 4], x),
        volumes(t.corners, t.volume, m[t.material, 2], m[t.material, 5], x),
    ]


def jacobians(e: Gradients, v: np.ndarray, room: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K and D of each element, (n, 3p, 3p). ``room``: how much of its H terms each point can take, (points,) [N/m]."""
    local_v = v[e.points].reshape(len(e.points), 3 * e.points.shape[1])
    rate = np.einsum("ni,ni->n", e.g, local_v)
    outer = e.g[:, :, None] * e.g[:, None, :]
    bound = np.min(room[e.points], axis=1) if len(e.points) else np.zeros(0)
    bent = (e.k * e.c + e.k_d * rate)[:, None, None] * e.h
    large = np.flatnonzero(np.sqrt(np.einsum("nij,nij->n", bent, bent)) > bound)
    if len(large):
        values, vectors = np.linalg.eigh(bent[large])
        values = np.maximum(values, -bound[large, None])
        bent[large] = np.einsum("nij,nj,nkj->nik", vectors, values, vectors)
    turning = np.einsum("nij,nj->ni", e.h, local_v)
    pull = e.k_d * np.linalg.norm(e.g, axis=1) * np.linalg.norm(turning, axis=1)
    weight = np.where(pull > bound, bound / np.where(pull > bound, pull, 1.0), 1.0)
    k = -e.k[:, None, None] * outer - bent
    k -= (weight * e.k_d)[:, None, None] * e.g[:, :, None] * turning[:, None, :]
    return k, -e.k_d[:, None, None] * outer
