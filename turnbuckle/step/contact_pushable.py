"""Contacts that impulses can do something about: those between nails and what is scripted are left to detection.

A row whose blocks are all prescribed has no response. Such pairs may come as near as scripts take them, but not cross: what
does is halved, and named when no zone can follow it.
"""

from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.data.contact import Contacts, Pairs

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt

PRESCRIBED = 0.02  # of delta: the distance that is certified between what is prescribed


class Pushable:
    """What moves freely in one attempt."""

    def __init__(self, attempt: "Attempt") -> None:
        self.attempt = attempt
        stepper = attempt.stepper
        fixed = attempt.prescribed.fixed
        self.every = not (fixed & ~stepper.dynamics.never).any()  # no nails: one side of a pair is always free
        if not self.every:
            surfaces = stepper.surfaces
            held = fixed[stepper.dynamics.block_of(surfaces.support)] | (surfaces.weights == 0.0)
            self.held = held.all(axis=1)

    def of(self, contacts: Contacts) -> Contacts:
        """Those of which a vertex is free."""
        if self.every or contacts.count == 0:
            return contacts
        free = self._free(contacts)
        return contacts if free.all() else contacts.part(free)

    def crossed(self, s1: np.ndarray) -> Contacts | None:
        """What the way to ``s1`` crosses: of what is prescribed only what comes nearer than a trace of delta.

        None as in `Attempt.crossed`, which may have made another motion of the rough one: that is the one to walk along.
        """
        attempt = self.attempt
        found = attempt.crossed(s1, None if self.every else self.held)
        if found is None:
            return None
        found = self._in_the_way(found, attempt.stepper.surfaces.positions(attempt.x1))
        if found.count or not attempt.rough:
            return found
        attempt.rough = False  # nothing is left that a later round could add: solve in full
        full = attempt.solve(attempt.solved)
        return None if full is None else self.crossed(full)

    def _free(self, contacts: Contacts) -> np.ndarray:
        return ((contacts.coefficients != 0.0) & ~self.held[contacts.vertices]).any(axis=1)

    def _in_the_way(self, found: Contacts, s1: np.ndarray) -> Contacts:
        if self.every or found.count == 0:
            return found
        keep = self._free(found)
        rows = np.flatnonzero(~keep)
        if not len(rows):
            return found
        detector = self.attempt.stepper.detector
        kind, a, b = found.kind[rows], found.a[rows], found.b[rows]
        walked = detector.ccd.walk(Pairs(kind, a, b), self.attempt.s0, s1, PRESCRIBED * detector.deltas(kind, a, b))
        keep[rows[walked.hit]] = True
        detector.smallest_gap = min(detector.smallest_gap, walked.smallest_gap)
        return found.part(keep)
