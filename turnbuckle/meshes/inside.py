"""Which points lie inside a closed triangle surface."""

import numpy as np

_CHUNK = 1 << 20  # pairs of point and triangle at once, which bounds the memory


def winding_numbers(points: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """How often the surface winds around each point: 1 inside, 0 outside, in between next to the surface, (n,).

    The sum of the solid angles of all triangles over 4 pi (van Oosterom, Strackee 1983). Takes points (n, 3),
    vertices (p, 3) [m] and triangles (m, 3) with normals outwards; parts that overlap count more than once.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = np.asarray(vertices, dtype=np.float64)[triangles]
    result = np.zeros(len(points))
    step = max(1, _CHUNK // max(len(corners), 1))
    for begin in range(0, len(points), step):
        a, b, c = np.moveaxis(corners[None] - points[begin : begin + step, None, None], 2, 0)
        la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
        above = np.einsum("nmi,nmi->nm", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("nmi,nmi->nm", p, q) for p, q in ((a, b), (b, c), (c, a)))
        result[begin : begin + step] = np.arctan2(above, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return result / (2.0 * np.pi)
