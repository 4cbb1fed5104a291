"""A triangle surface as a domain, exact on faces, edges and corners (4.1.3)."""

import numpy as np
from scipy.spatial import cKDTree

from turnbuckle.data.errors import InputError
from turnbuckle.geometry.domains import AT_LIMIT, Domain, Held, basis

ON_SURFACE = 1e-12  # of its size: nearer than this the way to an edge has no direction


def nearest_on_triangles(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights (n, 3) of the place of triangle ``corners[i]`` (3, 3) nearest to ``p[i]``, exactly 0 on edges."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, p - a
    uu, uv, vv, wu, wv = (np.einsum("nd,nd->n", s, t) for s, t in ((u, u), (u, v), (v, v), (w, u), (w, v)))
    det = uu * vv - uv * uv
    flat = det <= 1e-14 * uu * vv
    det = np.where(flat, 1.0, det)
    s, t = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
    weights = np.stack([1.0 - s - t, s, t], axis=1)
    outside = np.flatnonzero((weights <= 0.0).any(axis=1) | flat)
    if len(outside) == 0:
        return weights
    best = np.full(len(outside), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, d = corners[outside, i], corners[outside, j] - corners[outside, i]
        rel = p[outside] - start
        length = np.einsum("nd,nd->n", d, d)
        part = np.clip(np.einsum("nd,nd->n", rel, d) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        gap = rel - part[:, None] * d
        distance = np.einsum("nd,nd->n", gap, gap)
        better = distance < best
        best = np.where(better, distance, best)
        found = np.zeros((better.sum(), 3))
        found[:, i], found[:, j] = 1.0 - part[better], part[better]
        weights[outside[better]] = found
    return weights


class Surface(Domain):
    """Triangles (m, 3) of ``vertices`` (k, 3) [m], open or closed.

    Held is the normal: that of the face, on edges and corners the gradient of the distance. Past an open rim also the
    way back in the plane of the face, on one side.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, name: str = "surface") -> None:
        self.vertices = np.asarray(vertices, dtype=float)
        self.triangles = np.asarray(triangles, dtype=np.int64)
        corners = self.vertices[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1)
        if len(area) == 0 or (area == 0.0).any():
            raise InputError(
                f"{name}: triangle {int(np.argmin(area)) if len(area) else 0} has no area; repair the mesh"
            )
        self.normal = normal / area[:, None]
        self._corners, self._middle = corners, corners.mean(axis=1)
        self._reach = float(np.linalg.norm(corners - self._middle[:, None], axis=2).max())
        self._size = float(np.ptp(self.vertices, axis=0).max())
        self._tree, self._points = cKDTree(self._middle), cKDTree(self.vertices[np.unique(self.triangles)])
        self._topology()

    def _topology(self) -> None:
        """Which edges are rims, and normals of edges and corners (weighted by angle)."""
        n, t = len(self.vertices), self.triangles
        opposite = np.sort(np.stack([t[:, [1, 2]], t[:, [2, 0]], t[:, [0, 1]]], axis=1), axis=2)
        key = opposite[:, :, 0] * n + opposite[:, :, 1]
        _, self._edge, count = np.unique(key.ravel(), return_inverse=True, return_counts=True)
        self._edge = self._edge.reshape(key.shape)  # (m, 3): the edge opposite of each corner
        self._rim = count[self._edge] == 1
        self._rim_vertex = np.zeros(n, bool)
        self._rim_vertex[opposite[self._rim].ravel()] = True
        self._edge_normal = np.zeros((len(count), 3))
        np.add.at(self._edge_normal, self._edge.ravel(), np.repeat(self.normal, 3, axis=0))
        ahead = np.roll(self._corners, -1, axis=1) - self._corners
        back = np.roll(self._corners, 1, axis=1) - self._corners
        cosine = np.einsum("mkd,mkd->mk", ahead, back) / (np.linalg.norm(ahead, axis=2) * np.linalg.norm(back, axis=2))
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        self._vertex_normal = np.zeros((n, 3))
        np.add.at(self._vertex_normal, t.ravel(), (self.normal[:, None] * angle[:, :, None]).reshape(-1, 3))

    def place(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest triangle (n,) and barycentric weights (n, 3); the first triangle where several are as near."""
        p = np.asarray(p, dtype=float)
        bound, _ = self._points.query(p)  # no triangle is further than the nearest corner
        lists = self._tree.query_ball_point(p, bound * (1.0 + 1e-12) + self._reach * (1.0 + 1e-9), return_sorted=True)
        sizes = np.array([len(found) for found in lists], dtype=np.int64)
        candidates = np.concatenate([np.asarray(found, dtype=np.int64) for found in lists]) if len(p) else sizes
        owner = np.repeat(np.arange(len(p)), sizes)
        weights = nearest_on_triangles(p[owner], self._corners[candidates])
        gap = np.einsum("nk,nkd->nd", weights, self._corners[candidates]) - p[owner]
        distance = np.einsum("nd,nd->n", gap, gap)
        order = np.lexsort((candidates, distance, owner))
        first = order[np.r_[0, np.cumsum(sizes)[:-1]]] if len(p) else order
        return candidates[first], weights[first]

    def nearest(self, p: np.ndarray) -> np.ndarray:
        triangle, weights = self.place(p)
        return np.einsum("nk,nkd->nd", weights, self._corners[triangle])

    def held(self, p: np.ndarray) -> Held:
        p = np.asarray(p, dtype=float)
        triangle, weights = self.place(p)
        n = len(p)
        point = np.einsum("nk,nkd->nd", weights, self._corners[triangle])
        off = p - point
        distance = np.linalg.norm(off, axis=1)
        zero = weights <= AT_LIMIT
        on_edge, on_corner = zero.sum(axis=1) == 1, zero.sum(axis=1) == 2
        edge = self._edge[triangle, np.argmax(zero, axis=1)]
        corner = self.triangles[triangle, np.argmax(~zero, axis=1)]
        face = self.normal[triangle]
        smooth = np.where(on_edge[:, None], self._edge_normal[edge], face)
        smooth = np.where(on_corner[:, None], self._vertex_normal[corner], smooth)
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        smooth = np.where(length > 1e-6, smooth / np.where(length > 1e-6, length, 1.0), face)
        rim = (on_edge & self._rim[triangle, np.argmax(zero, axis=1)]) | (on_corner & self._rim_vertex[corner])
        far = distance > ON_SURFACE * max(1.0, self._size)
        unit = off / np.where(far, distance, 1.0)[:, None]
        toward = np.where(np.einsum("nd,nd->n", unit, smooth) < 0.0, -1.0, 1.0)[:, None] * unit
        normal = np.where((far & (on_edge | on_corner) & ~rim)[:, None], toward, np.where(rim[:, None], face, smooth))
        frames = basis(normal)
        # Past a rim: P - point has a part in the plane of the face; it is held, and the way back is inside.
        inward = -(off - np.einsum("nd,nd->n", off, face)[:, None] * face)
        size = np.linalg.norm(inward, axis=1)
        middle = self._middle[triangle] - point  # on the rim itself: across the edge into the face
        ends = self._corners[triangle, (np.argmax(zero, axis=1) + 1) % 3]
        along = self._corners[triangle, (np.argmax(zero, axis=1) + 2) % 3] - ends
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across = middle - np.where(on_edge, np.einsum("nd,nd->n", middle, along), 0.0)[:, None] * along
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        past = size > AT_LIMIT * max(1.0, self._size)
        inward = np.where(past[:, None], inward / np.where(past, size, 1.0)[:, None], across)
        frames[rim, 1] = inward[rim]
        frames[rim, 2] = np.cross(face, inward)[rim]
        one_sided = np.zeros((n, 3), bool)
        one_sided[:, 1] = rim
        return Held(point, frames, 1 + rim, one_sided)
