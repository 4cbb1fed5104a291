"""Continuous collision detection of pairs of surfaces over one step: what the refinement of contacts calls every round.

Contact, section 3.2 (pairs that cross each other between two states) and 4.3 (the step commits when there are none).
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.contact.ccd_additive import HIT, NOT_FINITE, touch_pairs, walk_pairs
from turnbuckle.contact.ccd_bulk import LIMIT, TIGHTNESS
from turnbuckle.contact.ccd_threads import launch_over_threads, on_device
from turnbuckle.data.contact import Contacts, Pairs, Surfaces
from turnbuckle.data.errors import InputError

CLOSE = 1e-4  # of the gap at the start: what the time of impact of a hit leaves of it


@dataclass
class Walked:
    """What a step does to pairs."""

    hit: np.ndarray  # (n,) bool, comes nearer than its separation
    time: np.ndarray  # (n,) part of the step that is surely free, in [0, 1]; 1 without a hit
    gap: np.ndarray  # (n,) [m] the distance is at least this up to `time`

    @property
    def smallest_gap(self) -> float:
        """[m] no pair is nearer than this before its `time`; infinite without pairs."""
        return float(self.gap.min(initial=np.inf))


class Ccd:
    """CCD of the pairs of one set of surfaces, with its buffers kept from call to call."""

    def __init__(
        self,
        surfaces: Surfaces,
        device: str = "cpu",
        threads: int | None = None,
        tightness: float = TIGHTNESS,
        max_iterations: int = LIMIT,
    ) -> None:
        self.surfaces = surfaces
        self.device = device
        self.threads = threads
        self.tightness = tightness
        self.max_iterations = max_iterations
        self._faces = np.ascontiguousarray(surfaces.faces, dtype=np.int32)
        self._edges = np.ascontiguousarray(surfaces.edges, dtype=np.int32)
        self._topology = [on_device(self._faces, wp.int32, device), on_device(self._edges, wp.int32, device)]
        self._out: list[wp.array] = []

    def walk(self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray) -> Walked:
        """Hit, time and certified gap of all pairs whose vertices go straight from ``x0`` to ``x1`` (s, 3) [m].

        ``separation`` [m], one or (n,). The arrays of the answer are overwritten by the next call.
        """
        n = pairs.count
        inputs, separation, _ = self._inputs(pairs, x0, x1, separation)
        if not self._out or len(self._out[0]) < n:
            room = n + n // 2
            types = (wp.uint8, wp.float64, wp.float64)
            self._out = [wp.empty(room, dtype=t, device=self.device) for t in types]
        out = [on_device(separation, wp.float64, self.device), int(len(separation) > 1), self.tightness]
        launch_over_threads(walk_pairs, n, [*inputs, *out, self.max_iterations, *self._out], self.device, self.threads)
        status, time, gap = (array.numpy()[:n] for array in self._out)
        if n and status.max() == NOT_FINITE:
            bad = int(np.argmax(status == NOT_FINITE))
            raise InputError(
                f"continuous collision detection: pair {bad} (a {pairs.a[bad]}, b {pairs.b[bad]}) has a position that "
                "is not finite or beyond 1e150 m; halve the step"
            )
        return Walked(status == HIT, time, gap)

    def first_impacts(
        self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray
    ) -> tuple[Contacts, Walked]:
        """Contacts of the pairs that come nearer than ``separation`` (one or (n,)) [m], in the order of the pairs.

        Coefficients and normal are those of the closest points at the time of impact, when the gap (above
        ``separation``) has shrunk to at most `tightness` of what it was; ``distance`` is that at the start. A pair
        nearer than ``separation`` at the start has time 0.
        """
        walked = self.walk(pairs, x0, x1, separation)
        which = np.flatnonzero(walked.hit).astype(np.int32)
        m = len(which)
        inputs, separation, _keep = self._inputs(pairs, x0, x1, separation)
        time = self._closer(pairs, x0, x1, separation, which, np.ascontiguousarray(walked.time[which]))
        types = ((wp.int32, 4), (wp.float64, 4), (wp.float64, 3), (wp.float64, 1))
        out = [wp.empty(m * width, dtype=t, device=self.device) for t, width in types]
        when = [on_device(which, wp.int32, self.device), *inputs, on_device(time, wp.float64, self.device)]
        launch_over_threads(touch_pairs, m, [*when, *out], self.device, self.threads)
        corners, weights, normal, distance = (array.numpy() for array in out)
        contacts = Contacts(
            kind=pairs.kind[which],
            a=pairs.a[which],
            b=pairs.b[which],
            vertices=corners.reshape(m, 4),
            coefficients=weights.reshape(m, 4),
            normal=normal.reshape(m, 3),
            distance=distance,
            time=time,
        )
        return contacts, walked

    def _closer(
        self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: np.ndarray, which: np.ndarray, time: np.ndarray
    ) -> np.ndarray:
        """Times of the hits ``which`` found again more tightly: a vertex short of a face touches the border of it."""
        if not len(which):
            return time
        few = pairs.part(which)
        apart = separation[which] if len(separation) > 1 else separation
        inputs, apart, _keep = self._inputs(few, x0, x1, apart)
        types = (wp.uint8, wp.float64, wp.float64)
        out = [wp.empty(len(which), dtype=t, device=self.device) for t in types]
        asked = [on_device(apart, wp.float64, self.device), int(len(apart) > 1), CLOSE, self.max_iterations]
        launch_over_threads(walk_pairs, len(which), [*inputs, *asked, *out], self.device, self.threads)
        status, again, _ = (array.numpy() for array in out)
        return np.ascontiguousarray(np.where(status == HIT, np.maximum(again, time), time))

    def clear(self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray) -> int:
        """Pairs that come nearer than ``separation``: the step may be committed where there is none."""
        return int(self.walk(pairs, x0, x1, separation).hit.sum())

    def _inputs(
        self, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray
    ) -> tuple[list[wp.array], np.ndarray, list[np.ndarray]]:
        """Arrays of the kernels, the separation as an array, and what must stay alive for both."""
        shape = (self.surfaces.vertices, 3)
        if x0.shape != shape or x1.shape != shape:
            raise InputError(
                f"continuous collision detection: positions have the shapes {x0.shape} and {x1.shape}; give {shape}"
            )
        separation = np.atleast_1d(np.asarray(separation, dtype=np.float64))
        if len(separation) not in (1, pairs.count) or not (separation >= 0.0).all():
            raise InputError(
                f"continuous collision detection: separation is 0 or more [m], one or {pairs.count} numbers"
            )
        keep = [np.ascontiguousarray(v, dtype=np.int32) for v in (pairs.kind, pairs.a, pairs.b)]
        keep += [np.ascontiguousarray(x, dtype=np.float64) for x in (x0, x1)]
        lists = [on_device(v, wp.int32, self.device) for v in keep[:3]]
        ends = [on_device(v, wp.float64, self.device) for v in keep[3:]]
        return [*lists, *self._topology, *ends], separation, keep


def first_impacts(
    surfaces: Surfaces, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray
) -> Contacts:
    """`Ccd.first_impacts` once."""
    return Ccd(surfaces).first_impacts(pairs, x0, x1, separation)[0]


def clear(surfaces: Surfaces, pairs: Pairs, x0: np.ndarray, x1: np.ndarray, separation: float | np.ndarray) -> int:
    """Pairs that come nearer than ``separation`` in the step: 0 where it may be committed."""
    return Ccd(surfaces).clear(pairs, x0, x1, separation)
