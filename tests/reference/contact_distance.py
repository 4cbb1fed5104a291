"""Distances of all vertices to all triangles and of all edges to all edges, in plain NumPy."""

import numpy as np


def to_segments(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances of points (..., 3) to segments (..., 3)."""
    u = b - a
    length2 = (u * u).sum(-1)
    t = np.clip(((p - a) * u).sum(-1) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    return np.linalg.norm(p - a - t[..., None] * u, axis=-1)


def to_triangles(p: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Distances of points (..., 3) to triangles (..., 3)."""
    border = np.minimum(np.minimum(to_segments(p, a, b), to_segments(p, b, c)), to_segments(p, c, a))
    n = np.cross(b - a, c - a)
    n2 = (n * n).sum(-1)
    inside = n2 > 0.0
    for u, v in ((a, b), (b, c), (c, a)):
        inside = inside & ((np.cross(v - u, p - u) * n).sum(-1) >= 0.0)
    height = np.abs(((p - a) * n).sum(-1)) / np.sqrt(np.where(n2 > 0.0, n2, 1.0))
    return np.where(inside, np.minimum(height, border), border)


def between_segments(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> np.ndarray:
    """Distances of segments (..., 3) to segments (..., 3)."""
    ends = [to_segments(a0, b0, b1), to_segments(a1, b0, b1), to_segments(b0, a0, a1), to_segments(b1, a0, a1)]
    least = np.minimum.reduce(np.broadcast_arrays(*ends))
    u, v, w = a1 - a0, b1 - b0, b0 - a0
    n = np.cross(u, v)
    n2 = (n * n).sum(-1)
    safe = np.where(n2 > 0.0, n2, 1.0)
    s, t = (np.cross(w, v) * n).sum(-1) / safe, (np.cross(w, u) * n).sum(-1) / safe
    inside = (n2 > 1e-20 * (u * u).sum(-1) * (v * v).sum(-1)) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.where(inside, np.minimum(np.abs((w * n).sum(-1)) / np.sqrt(safe), least), least)


def between_meshes(x: np.ndarray, first: tuple, second: tuple) -> float:
    """Least distance of two meshes, each (vertices, faces, edges) in one numbering over ``x``."""
    found = []
    for (v, _, e), (w, g, d) in ((first, second), (second, first)):
        if len(g):
            p = x[v][:, None]
            found.append(to_triangles(p, x[g[:, 0]][None], x[g[:, 1]][None], x[g[:, 2]][None]).min())
        if len(d):
            found.append(to_segments(x[v][:, None], x[d[:, 0]][None], x[d[:, 1]][None]).min())
        if len(e) and len(d):
            found.append(
                between_segments(x[e[:, 0]][:, None], x[e[:, 1]][:, None], x[d[:, 0]][None], x[d[:, 1]][None]).min()
            )
        found.append(np.linalg.norm(x[v][:, None] - x[w][None], axis=-1).min())
    return float(min(found))
