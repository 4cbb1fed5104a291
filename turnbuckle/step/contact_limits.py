"""Strain limits (Provot 1995 asks the same of cloth) as rows of the contact problem: springs that do not stretch on.

``|x_j - x_i| <= length`` at the end of the step. The ball is the cut of its tangent half spaces ``d . (x_j - x_i) <=
length``, so each look takes the direction d of the last motion, and pairs that this motion left too long join in. Forces
are opposite, along the line through both points where they end, and never push: a limit takes no momentum and adds no
energy. The rows have no friction.
"""

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from turnbuckle.step.contact_rows import frames

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt

NEAR = 0.98  # of the longest length: limits that are nearer than this act from the start
ALLOWED = 1e-3  # of the length by which a pair may be longer
LOOKS = 12  # in a solve at most


class Limits:
    """Strain limits of one attempt."""

    def __init__(self, attempt: "Attempt") -> None:
        self.attempt = attempt
        limits = attempt.stepper.model.strain_limits
        self.pairs, self.length = limits.pairs.astype(np.int64), limits.length
        self.used = np.zeros(0, dtype=np.int64)  # limits that are rows
        self.impulse = np.zeros((0, 3))  # in their frames [N s]
        self.direction = np.zeros((0, 3))  # from the first point to the second
        self.exists = len(self.pairs) > 0
        self.over = 0.0  # the largest strain beyond its limit that the last look left [1]
        if self.exists:
            d, length = self._spans(attempt.x0)
            fixed = attempt.prescribed.fixed[self.pairs].all(axis=1)
            self.held = ~fixed
            self._take(np.flatnonzero((length > NEAR * self.length) & self.held), d)

    @property
    def count(self) -> int:
        """Rows."""
        return len(self.used)

    def _spans(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d = x[self.pairs[:, 1]] - x[self.pairs[:, 0]]
        length = np.linalg.norm(d, axis=1)
        return d / np.maximum(length, 1e-300)[:, None], length

    def _take(self, which: np.ndarray, d: np.ndarray) -> None:
        """More rows."""
        self.used = np.concatenate([self.used, which])
        self.impulse = np.concatenate([self.impulse, np.zeros((len(which), 3))])
        self.direction = d[self.used]

    def start(self) -> None:
        """Before the looks of one solve."""
        self.looks = 0

    def rows(self) -> sp.bsr_array:
        """J, 3 x 3 blocks of frames: the first row is the rate at which a pair gets shorter."""
        m, blocks = self.count, self.attempt.stepper.dynamics.n
        frame = frames(self.direction)
        i, j = self.pairs[self.used].T
        data = np.stack(
            [np.where((i < j)[:, None, None], frame, -frame), np.where((i < j)[:, None, None], -frame, frame)], axis=1
        )
        index = np.sort(np.stack([i, j], axis=1), axis=1).astype(np.int32)
        indptr = (2 * np.arange(m + 1)).astype(np.int32)
        return sp.bsr_array((data.reshape(-1, 3, 3), index.ravel(), indptr), shape=(3 * m, 3 * blocks))

    def floor(self) -> np.ndarray:
        """Lower bound of that rate (m,) [m/s]."""
        x = self.attempt.x0
        i, j = self.pairs[self.used].T
        now = np.einsum("md,md->m", self.direction, x[j] - x[i])
        return (now - self.length[self.used]) / self.attempt.h

    def kept(self, impulse: np.ndarray, x1: np.ndarray) -> bool:
        """Whether the motion to ``x1``, which answers to the last rows with ``impulse``, keeps all limits well enough.

        If not, the rows turn to where it leads.
        """
        self.impulse = impulse
        d, length = self._spans(x1)
        over = np.where(self.held, length / self.length - 1.0, 0.0)
        self.over = float(over.max(initial=0.0))
        self.looks += 1
        if self.over <= ALLOWED or self.looks >= LOOKS:
            return True
        new = np.setdiff1d(np.flatnonzero(over > 0.0), self.used)
        self._take(new, d)
        return False


def stacked(parts: list[sp.bsr_array]) -> sp.bsr_array:
    """Matrices of 3 x 3 blocks below each other."""
    counts = np.cumsum([0, *(len(p.indices) for p in parts)])
    indptr = np.concatenate([[0], *(p.indptr[1:] + first for p, first in zip(parts, counts, strict=False))])
    data = np.concatenate([p.data.reshape(-1, 3, 3) for p in parts])
    indices = np.concatenate([p.indices for p in parts]).astype(np.int32)
    rows = sum(p.shape[0] for p in parts)
    return sp.bsr_array((data, indices, indptr.astype(np.int32)), shape=(rows, parts[0].shape[1]))
