"""What the ways of one step come too near to: the ways start at the same place and differ little.

A step looks at several ways from x0: the one that its velocities lead, and those that each solution leads. At no time of
the step is a place of a surface farther from where it was on the last way than the ends of its vertices are apart. So no
gap is less than it was by more than the shifts of both sides, and only pairs that these may bring too near are walked
anew.

Pairs are all that may come nearer than delta on any way whose vertices end within a room of where a search thought they
would. Where some end farther away, the search is made again for those alone.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.contact.broad import BroadPhase
from turnbuckle.contact.ccd_additive import F64, GATHER, HIT, I32, NOT_FINITE, U8
from turnbuckle.contact.ccd_bulk import LIMIT, TIGHTNESS
from turnbuckle.contact.ccd_core import WALK
from turnbuckle.contact.ccd_threads import launch_over_threads, on_device
from turnbuckle.data.contact import Pairs, Surfaces
from turnbuckle.data.errors import InputError

wp.set_module_options({"enable_backward": False})

KEPT = 0.35  # of delta: what comes nearer is a hit, and gets rows where anything is in the way
ROOM = 0.1  # of delta: how far vertices may end from where a search of all thought
MORE = 0.3  # of delta: the same, of a search for those that went farther
MANY = 0.2  # of the vertices: where more end farther away, everything is searched anew


@wp.func_native(
    GATHER
    + """
    const int sides = kind ? 2 : 1;
    double shift_a = 0.0, shift_b = 0.0;
    for (int k = 0; k < 4; ++k) {
        const double s = shift.data[corner[k]];
        double& most = k < sides ? shift_a : shift_b;
        most = s > most ? s : most;
    }
    const double distance = 0.5 * (delta.data[corner[0]] + delta.data[corner[sides]]);
    const double left = gap_out.data[i] - shift_a - shift_b;
    if (left >= keep * distance) {
        gap_out.data[i] = left;
        status_out.data[i] = left < reach * distance ? 3 : 0;
        return;
    }
    double xi = keep * distance;
"""
    + WALK
    + """
    if (status) gap = -1e300;
    gap_out.data[i] = gap;
    status_out.data[i] = status ? status : gap < reach * distance ? 3 : 0;
"""
)
def _look_at(kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, shift: F64, delta: F64,
             keep: wp.float64, reach: wp.float64, tightness: wp.float64, limit: int, status_out: U8, gap_out: F64, i: int): ...  # fmt: skip


@wp.kernel
def look_at_pairs(begin: int, kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, shift: F64,
                  delta: F64, keep: wp.float64, reach: wp.float64, tightness: wp.float64, limit: int, status_out: U8, gap_out: F64):  # fmt: skip
    """CCD of pair i of surfaces on the way from ``x0`` to ``x1``, unless its gap on the last way is worth enough still.

    ``shift`` (s,) is how far the ends of vertices are from where they were on the last way; asked for is ``keep`` times
    the mean of the ``delta`` of both sides. A pair that keeps less has no gap; one that keeps less than ``reach`` times
    that gets the status 3.
    """
    _look_at(kinds, a, b, faces, edges, x0, x1, shift, delta, keep, reach, tightness, limit, status_out, gap_out,
             begin + wp.tid())  # fmt: skip


@dataclass
class _Found:
    """Pairs of one search, and what is certified of them on the last way."""

    pairs: Pairs
    gap: np.ndarray  # (n,) [m], far below zero for those that were not walked, and for hits
    status: np.ndarray  # (n,) uint8


class Ways:
    """Ways of one step from ``x0`` (s, 3) [m]. A first search thought that they end at ``ends``, within ``room`` (s,)."""

    def __init__(
        self, surfaces: Surfaces, broad: BroadPhase, device: str, threads: int | None, x0: np.ndarray, reach: float
    ) -> None:
        self.reach = reach
        self.surfaces, self.broad, self.device, self.threads = surfaces, broad, device, threads
        self.x0 = np.ascontiguousarray(x0)
        self.room = ROOM * surfaces.delta
        self.ends = self.x0
        self.last = self.x0
        self.found: list[_Found] = []
        self._hits: Pairs | None = None  # of the last way
        self._topology = [on_device(v, wp.int32, device) for v in (surfaces.faces, surfaces.edges)]

    def know(self, pairs: Pairs, ends: np.ndarray, room: np.ndarray) -> None:
        """Take over a search: ``pairs`` are all that any way needs whose vertices end within ``room`` (s,) of ``ends``."""
        self.found = [self._unseen(pairs)]
        self.ends, self.room, self.last, self._hits = ends, room, ends, None

    def look(self, x1: np.ndarray) -> Pairs:
        """Pairs that come nearer than `KEPT` of delta on the way to ``x1`` (s, 3) [m], sorted."""
        x1 = np.ascontiguousarray(x1)
        if self._hits is not None and np.array_equal(x1, self.last):
            return self._hits
        self._search(x1)
        shift = np.sqrt(np.einsum("sd,sd->s", x1 - self.last, x1 - self.last))
        ends = [on_device(x, wp.float64, self.device) for x in (self.x0, x1, shift, self.surfaces.delta)]
        for found in self.found:
            self._walk(found, ends)
        self.last = x1
        hits = [found.pairs.part(np.flatnonzero(found.status == HIT)) for found in self.found]
        self._hits = hits[0] if len(hits) == 1 else self._joined(hits)
        return self._hits

    @staticmethod
    def _joined(hits: list[Pairs]) -> Pairs:
        both = [np.concatenate([getattr(h, name) for h in hits]) for name in ("kind", "a", "b")]
        once = np.unique(np.stack(both, axis=1), axis=0)  # later searches find again what earlier ones did
        return Pairs(*(np.ascontiguousarray(once[:, k]) for k in range(3)))

    def near(self) -> Pairs:
        """Pairs of the first search that come nearer than `reach` of delta on the last way, and so all that begin so near."""
        found = self.found[0]
        return found.pairs.part(np.flatnonzero(found.status))

    def smallest_gap(self) -> float:
        """[m] that all pairs keep which were no hits in the last look."""
        assert self._hits is not None
        gaps = [found.gap[found.status != HIT] if self._hits.count else found.gap for found in self.found]
        return min((float(gap.min(initial=np.inf)) for gap in gaps), default=np.inf)

    def _search(self, x1: np.ndarray) -> None:
        """Add the pairs of vertices that end elsewhere than was thought."""
        away = x1 - self.ends
        far = np.einsum("sd,sd->s", away, away) > self.room**2
        if self.found and not far.any():
            return
        if (
            not self.found
            or far.mean() > MANY
            or sum(more.pairs.count for more in self.found[1:]) > self.found[0].pairs.count
        ):
            self.room = ROOM * self.surfaces.delta
            self.know(self.broad.candidates(self.x0, x1, self.surfaces.delta + 2.0 * self.room), x1, self.room)
            return
        self.ends = np.where(far[:, None], x1, self.ends)
        self.room = np.where(far, MORE * self.surfaces.delta, self.room)
        more = self.broad.candidates(self.x0, self.ends, self.surfaces.delta + 2.0 * self.room, only=far)
        self.found.append(self._unseen(more))

    @staticmethod
    def _unseen(pairs: Pairs) -> _Found:
        return _Found(pairs, np.full(pairs.count, -np.inf), np.zeros(pairs.count, dtype=np.uint8))

    def _walk(self, found: _Found, ends: list[wp.array]) -> None:
        pairs, n = found.pairs, found.pairs.count
        if n == 0:
            return
        lists = [on_device(v, wp.int32, self.device) for v in (pairs.kind, pairs.a, pairs.b)]
        out = [on_device(found.status, wp.uint8, self.device), on_device(found.gap, wp.float64, self.device)]
        inputs = [*lists, *self._topology, *ends, KEPT, self.reach, TIGHTNESS, LIMIT, *out]
        launch_over_threads(look_at_pairs, n, inputs, self.device, self.threads)
        if wp.get_device(self.device).is_cuda:
            found.status, found.gap = (array.numpy() for array in out)
        if (found.status == NOT_FINITE).any():
            k = int(np.argmax(found.status == NOT_FINITE))
            raise InputError(
                f"continuous collision detection: pair {k} (a {pairs.a[k]}, b {pairs.b[k]}) has a position that is not "
                "finite or beyond 1e150 m; halve the step"
            )
