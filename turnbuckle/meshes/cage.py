"""Coarse tetrahedra around a fine closed surface: the cells of a grid that the surface's inside reaches.

Robust for any closed surface, and fast; the tetrahedra do not follow the surface, which is embedded in them.
"""

from functools import lru_cache

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.inside import winding_numbers
from turnbuckle.meshes.shapes import box_tetrahedra

A_CELL = 5  # tetrahedra of a cell
LENGTHS = 12  # of cells, tried to come near a wanted count
SLENDER = 2.0  # the longest side of a cell over its shortest, at most
ROUND = 1e-9  # of the extent: the grid is this much larger than the surface


def cage(vertices: np.ndarray, triangles: np.ndarray, cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Those of ``cells`` (x, y, z) of the surface's bounding box that hold a part of it or of its inside.

    Takes a closed surface, vertices (n, 3) [m] and triangles (m, 3). A cell counts when a vertex lies in it, an edge's
    or a triangle's sample, or when its middle is inside. Returns points (p, 3) [m] and tetrahedra (k, 4) int32, five a
    cell; every vertex lies in one.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    if not (size > 0.0).all():
        raise InputError("cage: the surface is flat; give a closed one")
    room = ROUND * size.max()
    low, size = low - room, size + 2.0 * room
    count = np.array(cells)
    cell = size / count
    samples = _samples(vertices, np.asarray(triangles), 0.5 * cell.min())
    place = np.clip(((samples - low) / cell).astype(np.int64), 0, count - 1)
    taken = np.zeros(count, dtype=bool)
    taken[tuple(place.T)] = True
    open_cells = np.argwhere(~taken)
    if len(open_cells):
        inside = winding_numbers(low + (open_cells + 0.5) * cell, vertices, triangles) > 0.5
        taken[tuple(open_cells[inside].T)] = True
    points, tetrahedra = box_tetrahedra(tuple(size), tuple(int(c) for c in count))  # type: ignore[arg-type]
    order = taken.transpose(2, 1, 0).ravel()  # cells are numbered along x first
    kept = tetrahedra.reshape(-1, A_CELL, 4)[order].reshape(-1, 4)
    used, index = np.unique(kept, return_inverse=True)
    return points[used] + low, index.reshape(-1, 4).astype(np.int32)


def cage_near(vertices: np.ndarray, triangles: np.ndarray, tetrahedra: int) -> tuple[np.ndarray, np.ndarray]:
    """The cage of about cubic cells whose number of tetrahedra comes nearest to the one wanted (see `cage`).

    The last few are remembered: a heap of letters has many alike.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32)
    points, cells = _nearest(vertices.tobytes(), triangles.tobytes(), tetrahedra)
    return points.copy(), cells.copy()


@lru_cache(maxsize=128)
def _nearest(of_vertices: bytes, of_triangles: bytes, tetrahedra: int) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.frombuffer(of_vertices).reshape(-1, 3)
    triangles = np.frombuffer(of_triangles, dtype=np.int32).reshape(-1, 3)
    size = np.ptp(vertices, axis=0)
    if not (size > 0.0).all():
        raise InputError("cage: the surface is flat; give a closed one")
    middle = (size.prod() * A_CELL / tetrahedra) ** (1.0 / 3.0)  # a box would be filled by cells of this length
    tried: dict[tuple[int, ...], tuple[np.ndarray, np.ndarray]] = {}
    for length in middle * np.geomspace(1.5, 0.4, LENGTHS):
        for up in range(8):  # each side cut into the fewer or the more cells
            more = np.array([up & 1, up >> 1 & 1, up >> 2])
            key = tuple(int(c) for c in np.maximum(np.floor(size / length).astype(int) + more, 1))
            cell = size / np.array(key)
            if key not in tried and cell.max() <= SLENDER * cell.min() and np.prod(key) <= tetrahedra:
                tried[key] = cage(vertices, triangles, key)  # type: ignore[arg-type]
    if not tried:
        return cage(vertices, triangles, tuple(int(c) for c in np.maximum(np.rint(size / middle), 1)))  # type: ignore[arg-type]
    return min(tried.values(), key=lambda found: abs(len(found[1]) - tetrahedra))


def _samples(vertices: np.ndarray, triangles: np.ndarray, spacing: float) -> np.ndarray:
    """The vertices, and points on all triangles no farther apart than about ``spacing`` [m]."""
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(np.ceil(longest / spacing), 1).astype(int)
    found = [vertices]
    for n in np.unique(steps):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        i, j = i[i + j <= n], j[i + j <= n]
        weights = np.stack([i, j, n - i - j], axis=1) / n
        found.append(np.einsum("wk,tkd->twd", weights, corners[steps == n]).reshape(-1, 3))
    return np.concatenate(found)
