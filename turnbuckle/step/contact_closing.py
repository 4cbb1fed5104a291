"""Equality rows beside contact that change with the motion: joints, and point constraints on points of rigid bodies.

``E v = wanted`` is linear, joints are not: each look linearises all rows about the last motion, with directions half way
and gaps at its end, and is done when every gap is closed. Rows of mass points alone are linear: one look does.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.rows import Rows
from turnbuckle.linalg.block_matrix import diagonal_blocks
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.contact_rows import PointMap

LOOKS = 40  # in a solve at most
CLOSED = 1e-11  # [m or rad]; round-off of large coordinates is added
SLOW = 0.7  # a gap that shrinks by less in a look, `PATIENCE` looks on end, closes no more
PATIENCE = 4
SMALL = 0.1  # part of the tolerance of contact that corrections without contact may move velocities by
POLISH = 12  # corrections at most
SLIGHT = 1e-12  # of the diagonal: what keeps rows that repeat each other solvable


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
        self._local: sp.csr_array | None = None
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
        self.changed = changed
        self.allowed = CLOSED + 64 * np.finfo(float).eps * float(np.abs(motion.x).max(initial=0.0))
        if changed:
            self.stuck, self.best = 0, np.inf
        elif self.gap > SLOW * self.best:
            self.stuck += 1
        else:
            self.stuck = 0
        self.best = min(self.best, self.gap)
        self.good = self.gap <= self.allowed and not changed
        return self.good or self.looks >= LOOKS or self.stuck >= PATIENCE

    def polish(
        self, problem: ContactProblem, motion: Motion, tolerance: float, move: Callable[[np.ndarray], Motion]
    ) -> bool:
        """Close what is left when it is below what contact is solved to: by impulses of the rows alone.

        Another solve would move velocities by its own tolerance [m/s], and gaps with them. ``move(v)`` makes a motion the
        tentative one. True where all is closed.
        """
        if self.changed or not self.gap <= SMALL * tolerance * self.h:
            return False
        for _ in range(POLISH):
            asked = self.put(problem, motion)
            free = np.ones(len(motion.v)) if problem.fixed is None else (~problem.fixed).astype(float)
            e = (asked.e @ sp.diags_array(np.repeat(free, 3))).tocsr()
            across = (self._inverse(problem) @ e.T).tocsc()
            s = (e @ across).tocsc()
            s = (s + sp.diags_array(SLIGHT * s.diagonal() + 1e-300)).tocsc()
            factor = spla.splu(s, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            missing = asked.wanted - asked.e @ motion.v.ravel()
            motion = move(motion.v + (across @ factor.solve(missing)).reshape(-1, 3))
            self.gap = self._worst(motion)
            self.good = self.gap <= self.allowed
            if self.good:
                return True
        return False

    def _inverse(self, problem: ContactProblem) -> sp.csr_array:
        """D_A^-1, the metric of the corrections."""
        if self._local is None:
            a, n = problem.a, len(problem.free) // 3
            own = diagonal_blocks(a.data, a.indptr, a.indices)
            self._local = sp.bsr_array((np.linalg.inv(own), np.arange(n), np.arange(n + 1)), shape=a.shape).tocsr()
        return self._local

    def _worst(self, motion: Motion) -> float:
        """The largest gap of all rows that act [m or rad]."""
        worst = self.joints.missed(motion.bodies, motion.q) if self.joints.exists else 0.0
        if self.points is not None:
            worst = max(worst, float(np.abs(self._point_gaps(motion.x)).max(initial=0.0)))
        return worst

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
