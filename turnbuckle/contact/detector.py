"""Detection for one step: what is near at its start, and what a motion crosses (Contact, 3.2)."""

import math

import numpy as np

from turnbuckle.contact.broad import BroadPhase
from turnbuckle.contact.ccd_pairs import Ccd
from turnbuckle.contact.ghosts import Ghosts
from turnbuckle.contact.manifold import first_met, joined, no_contacts
from turnbuckle.contact.proximity import Proximity
from turnbuckle.contact.repeats import first_of_each
from turnbuckle.contact.surface import closed_shapes
from turnbuckle.contact.ways import KEPT, Ways
from turnbuckle.data.contact import VERTEX_FACE, Contacts, Pairs, Surfaces

REACH = 1.5  # of delta: pairs nearer than this are rows from the start
CLEAR = 0.2  # of delta: the distance that continuous collision detection certifies; what comes nearer is in the way
PARALLEL = 8_000  # vertices below which threads lose more at their meetings than they save
SHORT = 4.0  # of the reach: one search for what is near and for what is on the way pays where motions are shorter
FLAT = 0.25  # [rad] edges whose faces turn by less are inside of a face
START = 0.9  # of the distance at the start: certified where that is less


class Detector:
    """Detection on one set of surfaces. ``moves`` (s,): vertices that may ever move."""

    def __init__(self, surfaces: Surfaces, moves: np.ndarray, device: str = "cpu", method: str = "bvh") -> None:
        self.surfaces, self.device = surfaces, device
        self.threads = threads = 1 if surfaces.vertices < PARALLEL else None
        self.broad = BroadPhase(surfaces, device, method, moves=moves, threads=threads)
        self.ccd = Ccd(surfaces, device, threads)
        self.proximity = Proximity(surfaces, device, threads)
        self.reach = REACH
        half = 0.5 * surfaces.delta
        self._deltas = half, half[surfaces.faces[:, 0]], half[surfaces.edges[:, 0]]
        self._ways: Ways | None = None  # of this step
        self.ghosts = Ghosts(surfaces)
        self._way = np.zeros((0, 3)), np.zeros((0, 3))  # both ends of the last motion that was looked at
        self.smallest_gap = np.inf  # [m] certified by the last call of :meth:`crossed`
        self._closed = closed_shapes(surfaces)[surfaces.shape]  # by vertex

    def deltas(self, kind: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The distance that pairs keep (n,) [m], the mean of both sides."""
        of_vertices, of_faces, of_edges = self._deltas
        face = kind == VERTEX_FACE
        out = np.empty(len(kind))
        out[face] = of_vertices[a[face]] + of_faces[b[face]]
        out[~face] = of_edges[a[~face]] + of_edges[b[~face]]
        return out

    def forget(self) -> None:
        """Begin a step: what it finds depends on nothing that was found before."""
        self._ways = None

    def near(self, x0: np.ndarray, towards: np.ndarray | None = None) -> Contacts:
        """Contacts of pairs that are near at ``x0`` (s, 3) [m].

        ``towards`` (s, 3) [m]: where vertices would end if nothing happened; the search then serves `crossed` as well,
        for motions that end close to that.
        """
        reach = self.reach * self.surfaces.delta
        ahead = towards is not None and float(np.linalg.norm(towards - x0, axis=1).sum()) < SHORT * reach.sum()
        pairs = self.broad.candidates(x0, towards if ahead else x0, reach)  # type: ignore[arg-type]
        if ahead:  # found: all that come nearer than reach; `crossed` asks for delta, and both sides may end elsewhere
            assert towards is not None
            self._ways = self._ways_from(x0)
            self._ways.know(pairs, towards, 0.5 * (self.reach - 1.0) * self.surfaces.delta)
            self._ways.look(towards)
            pairs = self._ways.near()
        if pairs.count == 0:
            return no_contacts()
        return self.proximity.contacts(pairs, x0, of_delta=self.reach)

    def _ways_from(self, x0: np.ndarray) -> Ways:
        return Ways(self.surfaces, self.broad, self.device, self.threads, x0, self.reach)

    def chosen(self, found: Contacts, x0: np.ndarray) -> Contacts:
        """Of what a motion crosses, what says most: that which each place meets first, from the right side.

        A motion that leads through a body meets its front, then its back from inside, and a row for the back would hold
        what crosses inside. And the edges inside of a flat face meet nothing that its vertices, those of the other side
        and outlines do not; no more do ghosts. Both sides of a sharp fold are there for themselves, since they are nearest
        where they are one. Whatever is left out and still in the way is found in the next round.
        """
        found = each_place_once(found)
        fold = (found.distance < self.deltas(found.kind, found.a, found.b)) & self.ghosts.in_folds(found)
        ghost = self.ghosts.find(found, *self._way)
        face = found.kind == VERTEX_FACE
        normals, vertex_normals = self._outwards(x0)
        outside = np.ones(found.count, dtype=bool)
        flat = np.zeros(found.count, dtype=bool)
        v, f = found.a[face], found.b[face]
        n = found.normal[face]
        outside[face] = ~((self._closed[self.surfaces.faces[f, 0]] & (_dot(n, normals[f]) < 0.0))
                          | (self._closed[v] & (_dot(n, vertex_normals[v]) > 0.0)))  # fmt: skip
        n = found.normal[~face]
        for edge, sign in ((found.a[~face], 1.0), (found.b[~face], -1.0)):
            sides = self.surfaces.edge_faces[edge]
            one, two = normals[sides[:, 0]], normals[sides[:, 1]]
            both = (sides >= 0).all(axis=1)
            out = sign * _dot(n, one + two)
            outside[~face] &= ~(self._closed[self.surfaces.edges[edge, 0]] & (out > 0.0))
            flat[~face] |= both & (_dot(one, two) > math.cos(FLAT))
        tiers = (outside & ~flat & ~ghost, outside & ~ghost, ~ghost, outside & ~flat, outside)
        kept = next((some for some in tiers if some.any()), ~fold)
        return joined(found.part(fold), first_met(found.part(kept & ~fold)))

    def _nearest_at_start(self, contacts: Contacts, early: np.ndarray) -> np.ndarray:
        """What is asked of pairs that are too near at the start, least over those that share a vertex with a contact (m,).

        Else what lies so near on one triangle would run into the border of the next, which keeps more.
        """
        least = np.full(self.surfaces.vertices, np.inf)
        used = contacts.coefficients[early] != 0.0
        given = np.broadcast_to(START * contacts.distance[early, None], used.shape)
        np.minimum.at(least, contacts.vertices[early][used], given[used])
        return least[contacts.vertices].min(axis=1, initial=np.inf)

    def _outwards(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals of faces and of vertices (their sums) at ``x``; a row of zeros for face -1."""
        faces = self.surfaces.faces
        normal = np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        count = self.surfaces.vertices
        sums = [np.bincount(faces.ravel(), np.repeat(normal[:, k], 3), minlength=count) for k in range(3)]
        return np.concatenate([normal, np.zeros((1, 3))]), np.stack(sums, axis=1)

    def crossed(self, x0: np.ndarray, x1: np.ndarray, clear: float = CLEAR, held: np.ndarray | None = None) -> Contacts:
        """Contacts of pairs that come too near on the straight way from ``x0`` to ``x1``.

        Where any comes nearer than ``clear`` of delta, these are all that come nearer than `KEPT` of it: rows leave more
        room than a way needs, so that what they push aside is not in the way of the next. Contacts between ``held``
        vertices (s,) bool are told if they are nearer than `KEPT`, whatever others do.
        """
        self._way = x0, x1
        if self._ways is None or not np.array_equal(x0, self._ways.x0):
            self._ways = self._ways_from(x0)
        pairs = self._ways.look(x1)
        gap = self._ways.smallest_gap()
        contacts = no_contacts()
        if pairs.count:
            contacts, closer = self._nearer(pairs, x0, x1, clear, held)
            gap = min(gap, closer)
        # what is farther away than delta is not looked for
        self.smallest_gap = min(gap, float(self.surfaces.delta.min())) if np.isfinite(gap) else gap
        return contacts

    def _nearer(
        self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, clear: float, held: np.ndarray | None
    ) -> tuple[Contacts, float]:
        """Contacts of pairs that come nearer than `KEPT` of delta, and the gap of those that are none [m]."""
        deltas = self.deltas(pairs.kind, pairs.a, pairs.b)
        keep = KEPT * deltas
        contacts, walked = self.ccd.first_impacts(pairs, x0, x1, keep)
        gap, hit = walked.gap.copy(), np.flatnonzero(walked.hit)
        early = contacts.time <= 0.0
        if early.any():  # nearer than that from the start: ask for less, of what they pass on their way, too
            less = self._nearest_at_start(contacts, early)
            ask = np.where(early, START * contacts.distance, np.minimum(keep[hit], less))
            anew = early | (less < keep[hit])
            again, walked = self.ccd.first_impacts(pairs.part(hit[anew]), x0, x1, ask[anew])
            gap[hit[anew]] = walked.gap
            contacts = _joined_in_order(contacts, ~anew, again)
        if contacts.count:
            hits = Pairs(contacts.kind, contacts.a, contacts.b)
            least = np.minimum(clear * self.deltas(hits.kind, hits.a, hits.b), START * contacts.distance)
            closer = self.ccd.walk(hits, x0, x1, least)
            free = np.ones(contacts.count, dtype=bool)
            if held is not None:
                free = ((contacts.coefficients != 0.0) & ~held[contacts.vertices]).any(axis=1)
            if not closer.hit[free].any():
                return contacts.part(~free), min(float(gap.min()), closer.smallest_gap)
        return contacts, float(gap.min())


def each_place_once(found: Contacts) -> Contacts:
    """Of contacts at one place of an edge or a vertex, which several pairs share, the earliest."""
    shared = (found.coefficients != 0.0).sum(axis=1) < 4
    order = np.argsort(found.time, kind="stable")
    first = np.empty(found.count, dtype=bool)
    first[order] = first_of_each(found.vertices[order], found.coefficients[order], shared[order])
    return found if first.all() else found.part(first)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("nd,nd->n", a, b)


def _joined_in_order(contacts: Contacts, kept: np.ndarray, more: Contacts) -> Contacts:
    """Those that are kept, and others, sorted by kind, a and b."""
    names = list(Contacts.__dataclass_fields__)
    both = [np.concatenate([getattr(contacts, n)[kept], getattr(more, n)]) for n in names]
    order = np.lexsort((both[2], both[1], both[0]))
    return Contacts(*(values[order] for values in both))
