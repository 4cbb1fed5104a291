"""Lines as thin prisms: a browser can only take hold of surfaces."""

import numpy as np

SIDES = 3
MANY = 4000  # segments; with more, each is one flat strip


def tube_faces(segments: int) -> np.ndarray:
    """Triangles (n, 3) over the vertices of `tube_vertices`."""
    if segments > MANY:
        one = np.array([[0, 1, 3], [0, 3, 2]])
        return (one[None] + 4 * np.arange(segments)[:, None, None]).reshape(-1, 3)
    k = np.arange(SIDES)
    after = (k + 1) % SIDES
    one = np.concatenate([np.stack([k, after, after + SIDES], 1), np.stack([k, after + SIDES, k + SIDES], 1)])
    return (one[None] + 2 * SIDES * np.arange(segments)[:, None, None]).reshape(-1, 3)


def tube_vertices(start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Corners of prisms around segments from ``start`` to ``end``, (n, 3) each [m]."""
    along = end - start
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    least = np.zeros_like(along)
    least[np.arange(len(along)), np.argmin(np.abs(along), axis=1)] = 1.0
    u = np.cross(along, least)
    u = u / np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-300)
    if len(start) > MANY:
        return np.stack([start - radius * u, start + radius * u, end - radius * u, end + radius * u], 1).reshape(-1, 3)
    w = np.cross(along, u)
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = radius * (np.cos(turn)[:, None] * u[:, None, :] + np.sin(turn)[:, None] * w[:, None, :])
    return np.concatenate([start[:, None, :] + ring, end[:, None, :] + ring], axis=1).reshape(-1, 3)
