"""Loop subdivision (Loop 1987): a smoother surface for pictures, linear in the vertices.

New vertices inside: 3/8 of the edge's ends and 1/8 of the two points opposite. Old vertices inside, with n neighbours:
``1 - n b`` of themselves and b of each neighbour, b = 3/16 for n = 3, else 3 / (8 n) (Warren 1995). On the boundary, and
where more than two triangles meet in an edge, surfaces are cubic splines of the edges: 1/2, 1/2 for new vertices, and
1/8, 3/4, 1/8 for old ones; a vertex where other than two such edges end stays.
"""

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from turnbuckle.data.errors import InputError


def loop_subdivide(vertices: np.ndarray, triangles: np.ndarray, times: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Subdivide ``times`` times. Takes vertices (n, 3) [m] and triangles (m, 3); every triangle becomes four each time.

    Returns vertices (n', 3), the first n of them the old ones moved, and triangles (4^times m, 3) int32. Vertices in no
    triangle stay. Raises InputError for indices that are not there. See `loop_weights` for many frames of one mesh.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    weights, finer = loop_weights(triangles, len(vertices), times)
    return weights @ vertices, finer


def loop_weights(triangles: np.ndarray, n: int, times: int = 1) -> tuple[csr_array, np.ndarray]:
    """The matrix (n', n) that takes the vertices of a mesh to those of the subdivided one, and its triangles."""
    triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    if times < 0:
        raise InputError(f"Loop subdivision: times is {times}; give 0 or more")
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= n):
        raise InputError(f"Loop subdivision: a triangle names vertex {triangles.max()} of {n}; repair the mesh")
    weights = csr_array(eye_array(n))
    for _ in range(times):
        once, triangles = _once(triangles, weights.shape[0])
        weights = csr_array(once @ weights)
    return weights, triangles.astype(np.int32)


def _once(t: np.ndarray, n: int) -> tuple[csr_array, np.ndarray]:
    sides = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    opposite = np.concatenate([t[:, 2], t[:, 0], t[:, 1]])
    edges, number, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    m = len(edges)
    inner = count == 2
    # new vertices, one an edge
    rows = [np.repeat(np.arange(m), 2), number]
    columns = [edges.ravel(), opposite]
    values = [np.repeat(np.where(inner, 3 / 8, 1 / 2), 2), np.where(inner[number], 1 / 8, 0.0)]
    made = csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(m, n))
    # old vertices
    creases = edges[~inner]
    at_crease = np.bincount(creases.ravel(), minlength=n)
    degree = np.bincount(edges.ravel(), minlength=n)
    smooth, spline = (at_crease == 0) & (degree > 0), at_crease == 2
    b = np.where(smooth, np.where(degree == 3, 3 / 16, 3 / (8 * np.maximum(degree, 1))), 0.0)
    own = np.where(smooth, 1.0 - degree * b, np.where(spline, 3 / 4, 1.0))
    ends = np.concatenate([edges, edges[:, ::-1]])
    rim = np.concatenate([creases, creases[:, ::-1]])
    rows = [np.arange(n), ends[:, 0], rim[:, 0]]
    columns = [np.arange(n), ends[:, 1], rim[:, 1]]
    values = [own, b[ends[:, 0]], np.where(spline[rim[:, 0]], 1 / 8, 0.0)]
    moved = csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    together = csr_array(vstack([moved, made]))
    together.eliminate_zeros()
    ab, bc, ca = n + number[: len(t)], n + number[len(t) : 2 * len(t)], n + number[2 * len(t) :]
    a, bb, c = t.T
    finer = np.stack([(a, ab, ca), (ab, bb, bc), (ca, bc, c), (ab, bc, ca)]).transpose(2, 0, 1).reshape(-1, 3)
    return together, finer
