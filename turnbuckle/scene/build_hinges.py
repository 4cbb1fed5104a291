"""Inner edges of a triangle mesh as hinges."""

import numpy as np


def hinge_points(triangles: np.ndarray, n: int) -> np.ndarray:
    """The hinges (m, 4) int32 of triangles over ``n`` points: both ends of each edge that two triangles share, and the
    points opposite.

    Ends are in the order in which the first triangle runs through them, so that the first opposite point lies to the
    left of the edge seen from where that triangle is counter-clockwise. Where more than two triangles meet, each makes a
    hinge with the next.
    """
    t = np.asarray(triangles, dtype=np.int64)
    begin = np.concatenate([t[:, 0], t[:, 1], t[:, 2]])
    end = np.concatenate([t[:, 1], t[:, 2], t[:, 0]])
    opposite = np.concatenate([t[:, 2], t[:, 0], t[:, 1]])
    key = np.minimum(begin, end) * n + np.maximum(begin, end)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[same], order[same + 1]
    hinges = np.stack([begin[first], end[first], opposite[first], opposite[second]], axis=1)
    return hinges[hinges[:, 2] != hinges[:, 3]].astype(np.int32)


def hinge_angles(hinges: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The angle [rad] between both triangles of each hinge, 0 when flat, (n,), for positions ``x`` (points, 3).

    Positive where the normals turn about the edge's direction, from that of the first triangle to that of the second.
    """
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    edge = b - a
    first, second = np.cross(edge, c - a), np.cross(d - a, edge)
    along = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.arctan2(np.einsum("ij,ij->i", np.cross(first, second), along), np.einsum("ij,ij->i", first, second))
