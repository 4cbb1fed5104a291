"""Starts that intersect, let apart (`on_intersection: grow`).

While edges cross faces, three things hold.

* Features on the wrong side are left out of proximity and continuous detection, since distances there point the wrong
  way: between the two bodies that cross and nothing else, those at the crossings, the smaller parts that the crossings
  cut off, and a ring of neighbours. Inside one body, or between two open sheets, `RINGS` rings at the crossings.
* Each crossing is a row of the contact problem: the edge parts from the face at the speed `recovery` at least, without
  friction, so momentum stays and nothing is thrown. It parts along the normals of both sides; those of an open sheet are
  taken to point at the closed body that crosses it. Where both are open, the edge goes where the curve of intersection
  gets shorter (Volino and Magnenat-Thalmann 2006).
* Every step is reported "degraded", with the crossings left.

Once nothing crosses, contact is on for everything. Crossings that have not become fewer for `PATIENCE` steps fail the run.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from turnbuckle.contact.intersections import Intersections
from turnbuckle.contact.surface import closed_shapes
from turnbuckle.data.contact import VERTEX_FACE, Contacts, Surfaces
from turnbuckle.step.contact_rows import PointMap, frames

PATIENCE = 200  # steps without fewer crossings
RINGS = 3  # of neighbours at crossings of open sheets
THIN = 0.5  # of its next larger extent: what two bodies share is flat
SURE = 0.3  # of all crossings must agree on the side
FLAT = 0.05  # of a unit vector: directions that are shorter are none


class Opening:
    """Crossings of one state, as they are let apart."""

    def __init__(self, surfaces: Surfaces, intersections: Intersections) -> None:
        self.surfaces, self.intersections = surfaces, intersections
        self.fewest, self.waited = np.inf, 0
        self.closed = closed_shapes(surfaces)
        ends = np.concatenate([surfaces.edges, surfaces.edges[:, ::-1]])
        self._ends = ends
        self.found = np.zeros((0, 2), dtype=np.int32)

    # Looking -------------------------------------------------------------------------------------------------------

    def look(self, s: np.ndarray) -> int:
        """Find what crosses at positions ``s`` of surface vertices (n, 3) [m]; how many."""
        self.found = self.intersections.find(s)
        if len(self.found):
            self._place(s)
            self._take_sides(s)
            size = np.linalg.norm(self.towards, axis=1)
            self.used = np.flatnonzero(size > FLAT)
            self.direction = self.towards[self.used] / size[self.used, None]
        return len(self.found)

    @property
    def stuck(self) -> bool:
        """Count a step; whether crossings have not become fewer for too long."""
        self.waited += 1
        if len(self.found) < self.fewest:
            self.fewest, self.waited = len(self.found), 0
        return self.waited > PATIENCE

    def _place(self, s: np.ndarray) -> None:
        """Where edges meet faces, as weights of five vertices, and the directions that they part along."""
        surfaces = self.surfaces
        e, f = surfaces.edges[self.found[:, 0]], surfaces.faces[self.found[:, 1]]
        normal = _normals(s, f)
        above = np.einsum("kid,kd->ki", s[e] - s[f[:, :1]], normal)
        across = above[:, 0] - above[:, 1]
        t = np.clip(above[:, 0] / np.where(across == 0.0, 1.0, across), 0.0, 1.0)
        t = np.where(across == 0.0, 0.5, t)
        place = (1.0 - t)[:, None] * s[e[:, 0]] + t[:, None] * s[e[:, 1]]
        self.vertices = np.concatenate([e, f], axis=1)
        self.weights = np.concatenate([np.stack([1.0 - t, t], axis=1), -_barycentric(place, s[f])], axis=1)
        self._direct(s, e, normal, place)

    def _direct(self, s: np.ndarray, e: np.ndarray, normal: np.ndarray, place: np.ndarray) -> None:
        surfaces = self.surfaces
        self.shape_a = surfaces.shape[e[:, 0]]
        self.shape_b = surfaces.shape[surfaces.faces[self.found[:, 1], 0]]
        closed_a, closed_b = self.closed[self.shape_a], self.closed[self.shape_b]
        beside = surfaces.edge_faces[self.found[:, 0]]
        sides = _normals(s, surfaces.faces[np.maximum(beside, 0)].reshape(-1, 3)).reshape(-1, 2, 3)
        sides[beside < 0] = 0.0
        own = sides.sum(axis=1)
        own /= np.maximum(np.linalg.norm(own, axis=1), FLAT)[:, None]
        count = np.maximum(np.bincount(surfaces.shape, minlength=len(self.closed)), 1)
        centre = np.stack([np.bincount(surfaces.shape, s[:, k], len(self.closed)) / count for k in range(3)], axis=1)
        for vector, shut, other in ((normal, closed_b, self.shape_a), (own, closed_a, self.shape_b)):
            towards = np.einsum("kd,kd->k", vector, centre[other] - place)
            vector[~shut & (towards < 0.0)] *= -1.0
        direction = normal - own
        both = (self.shape_a == self.shape_b) | ~(closed_a | closed_b)
        direction[both] = self._shorter(s, e, beside, sides, normal, place)[both]
        self.towards, self.place = direction, place

    def _shorter(
        self, s: np.ndarray, e: np.ndarray, beside: np.ndarray, sides: np.ndarray, normal: np.ndarray, place: np.ndarray
    ) -> np.ndarray:
        """Where to an edge goes so that the curve on its faces gets shorter: R summed, less its slip along the edge.

        R_i leads from the crossing into face i along the line of intersection; the crossing of an edge that moves by d
        moves by ``d - (d . N) / (E . N) E``.
        """
        along = s[e[:, 1]] - s[e[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        total = np.zeros_like(along)
        for k in range(2):
            corners = self.surfaces.faces[np.maximum(beside[:, k], 0)]
            third = corners[np.arange(len(e)), np.argmax((corners[:, :, None] != e[:, None, :]).all(axis=2), axis=1)]
            inwards = s[third] - place
            r = np.cross(sides[:, k], normal)
            r *= np.sign(np.einsum("kd,kd->k", r, inwards - np.einsum("kd,kd->k", inwards, along)[:, None] * along))[
                :, None
            ]
            size = np.linalg.norm(r, axis=1)
            total += np.where((beside[:, k] >= 0) & (size > FLAT), 1.0 / np.maximum(size, FLAT), 0.0)[:, None] * r
        slope = np.einsum("kd,kd->k", along, normal)
        slope = np.where(np.abs(slope) < FLAT, np.where(slope < 0.0, -FLAT, FLAT), slope)
        return total - (np.einsum("kd,kd->k", along, total) / slope)[:, None] * normal

    def _take_sides(self, s: np.ndarray) -> None:
        """Vertices that are on the wrong side, for each pair of shapes that cross."""
        surfaces, n = self.surfaces, self.surfaces.vertices
        a, b = np.minimum(self.shape_a, self.shape_b), np.maximum(self.shape_a, self.shape_b)
        pairs, which = np.unique(np.stack([a, b], axis=1), axis=0, return_inverse=True)
        self.pair = np.full((len(self.closed), len(self.closed)), -1)
        self.wrong = np.zeros((len(pairs), n), dtype=bool)
        self.near_both = np.zeros(len(pairs), dtype=bool)
        for p, (first, second) in enumerate(pairs):  # pairs of bodies, few
            self.pair[first, second] = self.pair[second, first] = p
            here = which.ravel() == p
            wrong = np.zeros(n, dtype=bool)
            wrong[self.vertices[here].ravel()] = True
            self.near_both[p] = first == second or not (self.closed[first] or self.closed[second])
            if not self.near_both[p]:
                cut = self._cut_off(np.unique(self.found[here, 0]), (first, second))
                wrong |= cut
                self._along_thin_side(np.flatnonzero(here), self.shape_a[here] == first, s[cut])
            for _ in range(RINGS if self.near_both[p] else 1):
                more = wrong.copy()
                more[self._ends[wrong[self._ends[:, 0]], 1]] = True
                wrong = more
            self.wrong[p] = wrong & np.isin(surfaces.shape, (first, second))

    def _along_thin_side(self, here: np.ndarray, first: np.ndarray, inside: np.ndarray) -> None:
        """Crossings of two bodies part along the thin side of what they share, where it has one.

        ``here``: crossings; ``first``: whether their edges are those of the first body; ``inside`` (n, 3): what is cut off.
        """
        points = np.concatenate([self.place[here], inside])
        _, axes = np.linalg.eigh(np.cov(points.T, bias=True))
        thin, wide = np.ptp(points @ axes[:, :2], axis=0)
        side = np.where(first, 1.0, -1.0)
        along = self.towards[here] @ axes[:, 0]
        votes = float(side @ along)
        if thin < THIN * wide and abs(votes) > SURE * np.abs(along).sum():
            self.towards[here] = np.sign(votes) * side[:, None] * axes[:, 0]

    def _cut_off(self, crossing: np.ndarray, shapes: tuple[int, int]) -> np.ndarray:
        """Vertices of both shapes that edges which cross nothing do not join to most of their shape."""
        surfaces, n = self.surfaces, self.surfaces.vertices
        kept = np.ones(len(surfaces.edges), dtype=bool)
        kept[crossing] = False
        e = surfaces.edges[kept]
        _, part = connected_components(
            sp.coo_array((np.ones(len(e), np.int8), (e[:, 0], e[:, 1])), shape=(n, n)), directed=False
        )
        out = np.zeros(n, dtype=bool)
        for shape in shapes:
            mine = np.flatnonzero(surfaces.shape == shape)
            sizes = np.bincount(part[mine])
            out[mine] = sizes[part[mine]] < sizes.max()
        return out

    # Using ---------------------------------------------------------------------------------------------------------

    def without(self, contacts: Contacts) -> Contacts:
        """Contacts but those that point the wrong way."""
        if len(self.found) == 0 or contacts.count == 0:
            return contacts
        shape = self.surfaces.shape[contacts.vertices]
        p = self.pair[shape[:, 0], shape[:, 3]]
        wrong = self.wrong[np.maximum(p, 0)[:, None], contacts.vertices]
        first = np.arange(4) < np.where(contacts.kind == VERTEX_FACE, 1, 2)[:, None]
        a, b = (wrong & first).any(axis=1), (wrong & ~first).any(axis=1)
        out = np.where(self.near_both[np.maximum(p, 0)], a & b, a | b) & (p >= 0)
        return contacts.part(~out)

    @property
    def count(self) -> int:
        """Rows."""
        return len(self.used) if len(self.found) else 0

    def rows(self, arms: np.ndarray, points: PointMap) -> sp.bsr_array:
        """J of the crossings: the first row of each is the speed at which the edge parts from the face."""
        surfaces, m = self.surfaces, self.count
        vertices, weights = self.vertices[self.used], self.weights[self.used]
        weight = (weights[:, :, None] * surfaces.weights[vertices]).reshape(m, -1)
        point = surfaces.support[vertices].reshape(m, -1)
        row, column = np.nonzero(weight)
        return points.rows(row, point[row, column], weight[row, column], frames(self.direction)[row], arms, m)


def _normals(s: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals of faces (n, 3)."""
    x = s[faces]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]


def _barycentric(p: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Weights (n, 3) of points p (n, 3) in triangles x (n, 3, 3)."""
    u, v, w = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], p - x[:, 0]
    normal = np.cross(u, v)
    square = np.maximum(np.einsum("kd,kd->k", normal, normal), 1e-300)
    b = np.einsum("kd,kd->k", np.cross(u, w), normal) / square
    c = np.einsum("kd,kd->k", np.cross(w, v), normal) / square
    found = np.clip(np.stack([1.0 - b - c, c, b], axis=1), 0.0, 1.0)
    return found / found.sum(axis=1, keepdims=True)
