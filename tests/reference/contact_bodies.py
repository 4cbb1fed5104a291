"""Awkward little surfaces: (vertices, triangles, lines) each, every vertex on a triangle or a line."""

import numpy as np
from scipy.spatial import ConvexHull

NO_FACES, NO_LINES = np.zeros((0, 3), dtype=int), np.zeros((0, 2), dtype=int)
Body = tuple[np.ndarray, np.ndarray, np.ndarray]


def sheet(n: int, size: float = 1.0) -> Body:
    """A flat square of n x n vertices about the origin."""
    u = np.linspace(-0.5 * size, 0.5 * size, n)
    x = np.stack([*np.meshgrid(u, u, indexing="ij"), np.zeros((n, n))], axis=-1).reshape(-1, 3)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return x, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]), NO_LINES


def box(size: tuple[float, float, float]) -> Body:
    """A closed box about the origin, normals outwards."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * size
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]), NO_LINES


def _used(x: np.ndarray, faces: np.ndarray) -> Body:
    kept, number = np.unique(faces, return_inverse=True)
    return x[kept], number.reshape(-1, 3), NO_LINES


def hull(rng: np.random.Generator) -> Body:
    points = 0.4 * rng.normal(size=(12, 3))
    return _used(points, ConvexHull(points).simplices)


def spikes(rng: np.random.Generator) -> Body:
    """A ball whose vertices stick out or in."""
    points = rng.normal(size=(12, 3))
    far = points / np.linalg.norm(points, axis=1)[:, None] * rng.choice([0.1, 0.6], 12)[:, None]
    return _used(far, ConvexHull(points).simplices)


def crumpled(rng: np.random.Generator) -> Body:
    """A sheet of steps, cliffs and cracks."""
    x, faces, lines = sheet(5)
    x[:, 2] += rng.integers(-1, 2, len(x)) / 16
    return x, faces, lines


def soup(rng: np.random.Generator) -> Body:
    """Triangles on a coarse grid, some without area, some through each other."""
    faces = np.array([rng.permutation(8)[:3] for _ in range(8)])
    return _used(rng.integers(-2, 3, size=(8, 3)) / 4.0, faces)


def wedge() -> Body:
    """A blunt ridge whose line ends at both sides."""
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.05], [1, 1, 0.05], [0, -1, 0.05], [1, -1, 0.05]]) - [0.5, 0, 0]
    return x, np.array([[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]]), NO_LINES


def plate() -> Body:
    """A strip whose corners are far away."""
    x = np.array([[-1, -0.1, 0], [1, -0.1, 0], [1, 0.1, 0], [-1, 0.1, 0]])
    return x, np.array([[0, 1, 2], [0, 2, 3]]), NO_LINES


def rope(rng: np.random.Generator) -> Body:
    return np.cumsum(0.2 * rng.normal(size=(8, 3)), axis=0), NO_FACES, np.stack([np.arange(7), np.arange(1, 8)], axis=1)


def any_body(rng: np.random.Generator) -> Body:
    """One of all of these."""
    kind = rng.integers(9)
    plain = [lambda: box(tuple(rng.uniform(0.2, 1, 3))), lambda: sheet(5), wedge, plate]
    return plain[kind]() if kind < 4 else (hull, spikes, crumpled, soup, rope)[kind - 4](rng)
