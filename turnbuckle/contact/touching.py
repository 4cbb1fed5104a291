"""Normals of contacts at distance zero, where the vector between the places gives none."""

import numpy as np

from turnbuckle.contact.surface import neighbours
from turnbuckle.data.contact import VERTEX_FACE, Surfaces


def touching_normals(
    surfaces: Surfaces,
    x: np.ndarray,
    kind: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    vertices: np.ndarray,
    place: np.ndarray,
) -> np.ndarray:
    """Unit normals (n, 3) from b to a of contacts whose places agree; ``place`` (n, 8) starts with coefficients.

    The line is that of the pair: square to the face, or to both edges; where that is not defined (a face without area,
    parallel edges), the way from b's surroundings to a's. Its sense is the one in which the surroundings of a are; where
    they are level, that in which b's face looks.
    """
    start, other = neighbours(surfaces.vertices, surfaces.edges)
    around = _centres(x, vertices, place[:, :4], start, other)
    corner = x[vertices]
    face = kind == VERTEX_FACE
    u = np.where(face[:, None], corner[:, 2] - corner[:, 1], corner[:, 1] - corner[:, 0])
    w = np.where(face[:, None], corner[:, 3] - corner[:, 1], corner[:, 3] - corner[:, 2])
    cross = np.cross(u, w)
    length = np.linalg.norm(cross, axis=1)
    sound = length > 1e-10 * np.linalg.norm(u, axis=1) * np.linalg.norm(w, axis=1)
    normal = np.where(sound[:, None], cross / np.where(sound, length, 1.0)[:, None], 0.0)
    wide = np.linalg.norm(around, axis=1)
    along = np.einsum("nk,nk->n", normal, around)
    normal = np.where((along < -1e-9 * wide)[:, None], -normal, normal)
    way = np.where((wide > 0.0)[:, None], around / np.where(wide > 0.0, wide, 1.0)[:, None], [0.0, 0.0, 1.0])
    return np.where(sound[:, None], normal, way)


def _centres(
    x: np.ndarray, vertices: np.ndarray, coefficients: np.ndarray, start: np.ndarray, other: np.ndarray
) -> np.ndarray:
    """Mean of the neighbours of a's vertices less that of b's, relative to the place, (n, 3)."""
    flat = vertices.reshape(-1)
    count = start[flat + 1] - start[flat]
    owner = np.repeat(np.arange(len(flat)), count)
    first = np.repeat(np.cumsum(count) - count, count)
    ring = other[np.repeat(start[flat], count) + np.arange(len(owner)) - first]
    total = np.zeros((len(flat), 3))
    np.add.at(total, owner, x[ring])
    mean = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], x[flat])
    return np.einsum("nk,nkd->nd", coefficients, (mean - x[flat]).reshape(*vertices.shape, 3))
