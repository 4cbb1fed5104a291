"""Distances of vertex and face, and of two edges, from all their features in turn: slow, and right for degenerate ones."""

import numpy as np


def to_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance (n,) of points p from segments ab, all (n, 3)."""
    side = b - a
    length2 = np.sum(side * side, axis=1)
    t = np.sum((p - a) * side, axis=1) / np.where(length2 > 0.0, length2, 1.0)
    return np.linalg.norm(p - a - np.clip(t, 0.0, 1.0)[:, None] * side, axis=1)


def distances(x: np.ndarray, kind: int) -> np.ndarray:
    """Distance (n,) of vertex and face (kind 0) or of two edges (kind 1) with corners ``x`` (n, 4, 3)."""
    x = np.moveaxis(x - x[:, :1], 1, 0)
    if kind:
        found = [to_segment(x[i], x[a], x[b]) for i, a, b in ((0, 2, 3), (1, 2, 3), (2, 0, 1), (3, 0, 1))]
        base, p, q = x[2] - x[0], x[1] - x[0], x[3] - x[2]
    else:
        found = [to_segment(x[0], x[a], x[b]) for a, b in ((1, 2), (2, 3), (3, 1))]
        base, p, q = x[0] - x[1], x[2] - x[1], x[3] - x[1]
    normal = np.cross(p, q)
    area2 = np.sum(normal * normal, axis=1)
    good = area2 > 1e-14 * np.sum(p * p, axis=1) * np.sum(q * q, axis=1)
    scale = 1.0 / np.where(good, area2, 1.0)
    s = np.sum(np.cross(base, q) * normal, axis=1) * scale
    t = np.sum(np.cross(base, p) * normal, axis=1) * scale
    if kind:  # points at s along a and t along b
        inside = good & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    else:  # weights s and -t
        inside = good & (s >= 0.0) & (t <= 0.0) & (s - t <= 1.0)
    plane = np.abs(np.sum(base * normal, axis=1)) * np.sqrt(scale)
    return np.minimum(np.min(found, axis=0), np.where(inside, plane, np.inf))
