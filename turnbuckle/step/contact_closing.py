"""Equality rows beside contact that change with the motion: joints, and point constraints on points of rigid bodies.

``E v = wanted`` is linear, joints are not: each look linearises all rows about the last motion, with directions half way
and gaps at its end, and is done when every gap is closed. Rows of mass points alone are linear: one look does.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.rows import Rows
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.contact_rows import PointMap

LOOKS = 40  # in a solve at most
CLOSED = 1e-11  # [m or rad]; round-off of large coordinates is added
SLOW = 0.7  # a gap that shrinks by less in a look, `PATIENCE` looks on end, closes no more
PATIENCE = 4


@dataclass
class Motion:
    """A tentative motion of one step."""

    v: np.ndarray  # (blocks, 3)
    x: np.ndarray  # (points, 3) at its end [m]
    bodies: np.ndarray  # (bodies, 3) centres at its end [m]
    q: np.ndarray  # (bodies, 4) xyzw


class Closing:
    """Rows of one attempt at a step of ``h``. ``points``: rows of point constraints that are no nails."""

    def __init__(
        self,
        h: float,
        points: Rows | None,
        point_map: PointMap,
        joints: ContactJoints,
        arms: np.ndarray,
        v0: np.ndarray,
    ) -> None:
        self.h, self.points, self.map, self.joints, self.arms, self.v0 = h, points, point_map, joints, arms, v0
        self.exists = points is not None or joints.exists
        self.e: sp.csr_array | None = None
        self.gap = 0.0  # [m or rad] left after the last look
        self.good = True  # whether all was closed, or there was nothing to close
        if joints.exists:
            joints.begin(h)
        if points is not None:
            self._prepare(points)

    def _prepare(self, points: Rows) -> None:
        self.weights = points.weights.tocsr()
        m = len(points.target)
        self.row = np.repeat(np.arange(m), np.diff(self.weights.indptr))
        self.held = np.tile(np.eye(3), (m, 1, 1)) if points.directions is None else points.directions
        self.kept = np.flatnonzero(np.abs(self.held).sum(axis=2).ravel() > 0.0)
        self.follows = self.map.body_of[self.weights.indices] >= 0
        self.constant: sp.csr_array | None = None

    def start(self) -> None:
        """Before the looks of one solve."""
        self.looks, self.stuck, self.best = 0, 0, np.inf

    def put(self, problem: ContactProblem, motion: Motion) -> ContactProblem:
        """The problem with all rows, about ``motion``."""
        v = motion.v.ravel()
        e, wanted = [], []
        a, load = problem.a, problem.load
        if self.points is not None:
            rows = self._point_rows(motion)
            e.append(rows)
            wanted.append(rows @ v - self._point_gaps(motion.x) / self.h)
        if self.joints.exists:
            asked = self.joints.ask(motion.v, self.v0, motion.bodies, motion.q)
            e.append(asked.e)
            wanted.append(asked.wanted)
            if asked.stiff is not None:
                a = (a + sp.bsr_array(asked.stiff, blocksize=(3, 3))).tobsr((3, 3))
                a.sort_indices()
            if asked.load is not None and load is not None:
                load = load + asked.load
        self.e = sp.vstack(e).tocsr()
        return replace(problem, a=a, load=load, e=self.e, wanted=np.concatenate(wanted))

    def closed(self, impulse: np.ndarray, motion: Motion) -> bool:
        """Whether ``motion``, which answers to the last `put` with ``impulse`` of its rows [N s], needs no other look."""
        self.looks += 1
        first = len(self.kept) if self.points is not None else 0
        worst, changed = 0.0, False
        if self.joints.exists:
            worst, changed = self.joints.settle(impulse[first:], motion.v, motion.bodies, motion.q)
        if self.points is not None:
            worst = max(worst, float(np.abs(self._point_gaps(motion.x)).max(initial=0.0)))
        self.gap = worst if np.isfinite(worst) else np.inf
        allowed = CLOSED + 64 * np.finfo(float).eps * float(np.abs(motion.x).max(initial=0.0))
        if changed:
            self.stuck, self.best = 0, np.inf
        elif self.gap > SLOW * self.best:
            self.stuck += 1
        else:
            self.stuck = 0
        self.best = min(self.best, self.gap)
        self.good = self.gap <= allowed and not changed
        return self.good or self.looks >= LOOKS or self.stuck >= PATIENCE

    def _point_rows(self, motion: Motion) -> sp.csr_array:
        if self.constant is not None:
            return self.constant
        arms = self.arms
        if self.follows.any():
            body = self.map.body_of
            there = np.flatnonzero(body >= 0)
            arms = arms.copy()
            arms[there] = 0.5 * (arms[there] + motion.x[there] - motion.bodies[body[there]])
        m = len(self.held)
        rows = self.map.rows(self.row, self.weights.indices, self.weights.data, self.held[self.row], arms, m)
        rows = rows.tocsr()[self.kept]
        if not self.follows.any():
            self.constant = rows
        return rows

    def _point_gaps(self, x: np.ndarray) -> np.ndarray:
        assert self.points is not None
        miss = self.weights @ x - self.points.target
        return np.einsum("rij,rj->ri", self.held, miss).ravel()[self.kept]
