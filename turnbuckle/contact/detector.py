"""Detection for one step: what is near at its start, and what a motion crosses (Contact, 3.2)."""

import numpy as np

from turnbuckle.contact.broad import BroadPhase
from turnbuckle.contact.ccd_pairs import Ccd
from turnbuckle.contact.manifold import no_contacts
from turnbuckle.contact.proximity import Proximity
from turnbuckle.data.contact import VERTEX_FACE, Contacts, Pairs, Surfaces

REACH = 1.5  # of delta: pairs nearer than this are rows from the start
KEPT = 0.5  # of delta: the distance that continuous collision detection certifies
PARALLEL = 20_000  # vertices below which threads lose more at their meetings than they save
START = 0.9  # of the distance at the start: certified where that is less


class Detector:
    """Detection on one set of surfaces. ``moves`` (s,): vertices that may ever move."""

    def __init__(self, surfaces: Surfaces, moves: np.ndarray, device: str = "cpu", method: str = "bvh") -> None:
        self.surfaces = surfaces
        threads = 1 if surfaces.vertices < PARALLEL else None
        self.broad = BroadPhase(surfaces, device, method, moves=moves, threads=threads)
        self.ccd = Ccd(surfaces, device, threads)
        self.proximity = Proximity(surfaces, device, threads)
        self.reach = REACH
        self.smallest_gap = np.inf  # [m] certified by the last call of :meth:`crossed`
        self._largest = float(surfaces.delta.max(initial=0.0))

    def deltas(self, kind: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The distance that pairs keep (n,) [m], the mean of both sides."""
        s = self.surfaces
        face = kind == VERTEX_FACE
        out = np.empty(len(kind))
        out[face] = 0.5 * (s.delta[a[face]] + s.delta[s.faces[b[face], 0]])
        out[~face] = 0.5 * (s.delta[s.edges[a[~face], 0]] + s.delta[s.edges[b[~face], 0]])
        return out

    def near(self, x0: np.ndarray) -> Contacts:
        """Contacts of pairs that are near at ``x0`` (s, 3) [m]."""
        pairs = self.broad.candidates(x0, x0, self.reach * self.surfaces.delta)
        if pairs.count == 0:
            return no_contacts()
        return self.proximity.contacts(pairs, x0, self.reach * self.deltas(pairs.kind, pairs.a, pairs.b))

    def crossed(self, x0: np.ndarray, x1: np.ndarray) -> Contacts:
        """Contacts of pairs that come too near on the straight way from ``x0`` to ``x1``."""
        pairs = self.broad.candidates(x0, x1, self.surfaces.delta)
        self.smallest_gap = np.inf
        if pairs.count == 0:
            return no_contacts()
        keep = KEPT * self.deltas(pairs.kind, pairs.a, pairs.b)
        contacts, walked = self.ccd.first_impacts(pairs, x0, x1, keep)
        early = contacts.time <= 0.0
        if early.any():  # nearer than that from the start: ask for less
            which = np.flatnonzero(walked.hit)[early]
            few = Pairs(pairs.kind[which], pairs.a[which], pairs.b[which])
            again, _ = self.ccd.first_impacts(few, x0, x1, START * contacts.distance[early])
            contacts = _joined_in_order(contacts, ~early, again)
            walked = self.ccd.walk(pairs, x0, x1, 0.0) if contacts.count == 0 else walked
        self.smallest_gap = walked.smallest_gap
        return contacts


def _joined_in_order(contacts: Contacts, kept: np.ndarray, more: Contacts) -> Contacts:
    """Those that are kept, and others, sorted by kind, a and b."""
    names = list(Contacts.__dataclass_fields__)
    both = [np.concatenate([getattr(contacts, n)[kept], getattr(more, n)]) for n in names]
    order = np.lexsort((both[2], both[1], both[0]))
    return Contacts(*(values[order] for values in both))
