"""A fine surface tied to a coarse tetrahedral mesh by barycentric weights (Local, section 5).

Both searches are exact. Elements are put into classes by size (each class spans a factor of two), so that a ball of
the class's largest radius around a point holds the centroids of all elements of that class that can reach it.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import boundary_faces, six_volumes

INSIDE = -1e-10  # smallest weight of a point that counts as inside
_CHUNK = 4096  # points a query, which bounds the memory for candidates


def embed(surface_vertices: np.ndarray, vertices: np.ndarray, tetrahedra: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights that carry each surface vertex along with a tetrahedron.

    Takes surface vertices [m] (n, 3), vertices [m] (p, 3) and tetrahedra (m, 4) of non-zero volume. Returns points
    (n, 4) int32, the corners of the tetrahedron that contains each surface vertex (of several, the one it lies deepest
    in), and weights (n, 4) float64 that sum to 1. A surface vertex outside all of them takes the tetrahedron closest to
    it, with weights outside [0, 1]; rest positions are reproduced either way. Raises InputError for input that is not
    finite or a flat tetrahedron.
    """
    surface = np.asarray(surface_vertices, dtype=np.float64).reshape(-1, 3)
    vertices = np.asarray(vertices, dtype=np.float64)
    tetrahedra = np.asarray(tetrahedra, dtype=np.int32).reshape(-1, 4)
    if not (np.isfinite(surface).all() and np.isfinite(vertices).all()):
        raise InputError("embedding: a vertex is not finite; repair the mesh")
    if not len(tetrahedra):
        raise InputError("embedding: there are no tetrahedra to carry the surface")
    if (six_volumes(vertices, tetrahedra) == 0).any():
        raise InputError("embedding: a tetrahedron has no volume; repair the mesh first")
    to_weights = np.linalg.inv(_edges(vertices, tetrahedra))
    owner = np.full(len(surface), -1, dtype=np.int64)
    depth = np.full(len(surface), -np.inf)
    centroids, radii = _balls(vertices[tetrahedra])
    for rows, elements in _candidates(surface, centroids, radii, np.zeros(len(surface))):
        smallest = _weights(surface[rows], vertices, tetrahedra[elements], to_weights[elements]).min(axis=1)
        _keep_best(rows, elements, smallest, owner, depth)
    outside = np.flatnonzero(depth < INSIDE)
    if len(outside):
        owner[outside] = _closest(surface[outside], vertices, tetrahedra)
    chosen = tetrahedra[owner]
    return chosen, _weights(surface, vertices, chosen, to_weights[owner])


def _edges(vertices: np.ndarray, tetrahedra: np.ndarray) -> np.ndarray:
    """The matrix [x1 - x0, x2 - x0, x3 - x0] of each tetrahedron, (m, 3, 3)."""
    corner = vertices[tetrahedra]
    return np.moveaxis(corner[:, 1:] - corner[:, :1], 1, 2)


def _weights(points: np.ndarray, vertices: np.ndarray, tetrahedra: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    offset = points - vertices[tetrahedra[:, 0]]
    weights = np.einsum("nij,nj->ni", inverse, offset)
    # once more for what is left, so that a thin element reproduces its points as well as a round one
    corner = vertices[tetrahedra]
    left = offset - np.einsum("nk,nkd->nd", weights, corner[:, 1:] - corner[:, :1])
    weights += np.einsum("nij,nj->ni", inverse, left)
    return np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1)


def _balls(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid (m, 3) and the distance to its farthest corner (m,) of each element (m, k, 3)."""
    centroids = corners.mean(axis=1)
    radii = np.sqrt(((corners - centroids[:, None]) ** 2).sum(axis=2).max(axis=1))
    return centroids, radii * (1 + 1e-9)


def _candidates(
    points: np.ndarray, centroids: np.ndarray, radii: np.ndarray, reach: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """All pairs (row of a point, element) with a ball that comes within ``reach`` of the point."""
    size_class = np.floor(np.log2(np.maximum(radii, 1e-300))).astype(np.int64)
    for number in np.unique(size_class):
        members = np.flatnonzero(size_class == number)
        tree = cKDTree(centroids[members])
        largest = radii[members].max()
        for begin in range(0, len(points), _CHUNK):
            rows = np.arange(begin, min(begin + _CHUNK, len(points)))
            found = tree.query_ball_point(points[rows], largest + reach[rows], return_sorted=False)
            count = np.fromiter((len(f) for f in found), dtype=np.int64, count=len(rows))
            if not count.any():
                continue
            elements = members[np.concatenate([np.asarray(f, dtype=np.int64) for f in found if f])]
            rows = np.repeat(rows, count)
            near = ((points[rows] - centroids[elements]) ** 2).sum(axis=1) <= (radii[elements] + reach[rows]) ** 2
            yield rows[near], elements[near]


def _keep_best(rows: np.ndarray, elements: np.ndarray, score: np.ndarray, owner: np.ndarray, best: np.ndarray) -> None:
    """Take the element of the highest score of each row; of equals, the one of the smallest index."""
    order = np.lexsort((elements, -score, rows))
    first = order[np.flatnonzero(np.diff(rows[order], prepend=-1))]
    row, element, value = rows[first], elements[first], score[first]
    better = (value > best[row]) | ((value == best[row]) & (element < owner[row]))
    owner[row[better]], best[row[better]] = element[better], value[better]


def _closest(points: np.ndarray, vertices: np.ndarray, tetrahedra: np.ndarray) -> np.ndarray:
    """The tetrahedron closest to each point outside: the owner of the closest boundary triangle."""
    faces, owners = boundary_faces(tetrahedra)
    corners = vertices[faces]
    centroids, radii = _balls(corners)
    # The distance to some triangle bounds the distance to the closest.
    guess = cKDTree(centroids).query(points, k=1)[1]
    reach = np.sqrt(_squared_distance(points, corners[guess])) * (1 + 1e-9)
    owner = np.full(len(points), -1, dtype=np.int64)
    best = np.full(len(points), -np.inf)
    for rows, elements in _candidates(points, centroids, radii, reach):
        _keep_best(rows, elements, -_squared_distance(points[rows], corners[elements]), owner, best)
    return owners[owner]


def _squared_distance(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Squared distance [m^2] of each point (n, 3) to its triangle (n, 3, 3).

    If the point projects into the triangle it is the distance to the plane, else the smallest to the three edges.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    inside = np.ones(len(points), dtype=bool)
    best = np.full(len(points), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge, offset = q - p, points - p
        inside &= np.einsum("ij,ij->i", np.cross(edge, offset), normal) >= 0
        length = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
        along = np.clip(np.einsum("ij,ij->i", offset, edge) / length, 0, 1)
        best = np.minimum(best, ((offset - along[:, None] * edge) ** 2).sum(axis=1))
    area = np.einsum("ij,ij->i", normal, normal)
    height = np.einsum("ij,ij->i", points - a, normal)
    return np.where(inside & (area > 0), height**2 / np.maximum(area, 1e-300), best)
