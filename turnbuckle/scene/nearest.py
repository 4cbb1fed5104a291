"""Weights of a point's projection on lines, triangles and tetrahedra, and which element is nearest (NumPy)."""

import numpy as np
from scipy.spatial import cKDTree

CANDIDATES = 16  # elements by centre that are looked at first


def projection_weights(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights of the orthogonal projection of points ``p`` (n, 3) on the element of ``corners`` (n, k, 3), k = 2, 3, 4.

    Not clamped: outside the element some are negative or above one. Rows sum to one. For tetrahedra these are the
    barycentric coordinates.
    """
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)  # (n, 3, k - 1)
    solution = np.einsum("nij,nj->ni", np.linalg.pinv(edges), p - corners[:, 0])
    return np.c_[1.0 - solution.sum(axis=1), solution]


def distance(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from segments (n, 2, 3) or triangles (n, 3, 3) [m]."""
    w = projection_weights(p, corners)
    inside = (w >= 0.0).all(axis=1)
    gap = np.linalg.norm(p - np.einsum("nk,nkd->nd", w, corners), axis=1)
    best = np.full(len(p), np.inf)
    for a, b in ((0, 1),) if corners.shape[1] == 2 else ((0, 1), (1, 2), (2, 0)):
        d = corners[:, b] - corners[:, a]
        t = np.clip(
            np.einsum("nd,nd->n", p - corners[:, a], d) / np.maximum(np.einsum("nd,nd->n", d, d), 1e-300), 0.0, 1.0
        )
        best = np.minimum(best, np.linalg.norm(p - corners[:, a] - t[:, None] * d, axis=1))
    return np.where(inside, np.minimum(gap, best), best)


def nearest_element(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Number of the element nearest to each point: ``p`` (n, 3), ``corners`` (m, k, 3). The first of equal ones."""
    centre = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centre[:, None], axis=2).max()
    tree = cKDTree(centre)
    out = np.zeros(len(p), dtype=np.int64)
    for i, point in enumerate(p):
        near = tree.query(point, k=min(CANDIDATES, len(centre)))[1]
        near = np.atleast_1d(near)
        bound = distance(np.repeat(point[None], len(near), axis=0), corners[near]).min()
        close = np.sort(tree.query_ball_point(point, bound + reach))
        d = distance(np.repeat(point[None], len(close), axis=0), corners[close])
        out[i] = close[np.argmin(d)]
    return out
