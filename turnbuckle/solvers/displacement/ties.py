"""Weighted points of rigid bodies and mass points at a goal: the point constraints of Local under displacement.

A row asks ``P (sum_k w_k X_k) = P target``. A nail is one point of weight 1 and a target, two joined points have
weights 1 and -1, an attachment has 1 and its weights, negative. As (5)-(8), a rubber along the gap g pulls point k by
``w_k g``; with ``mu = 1 / sum_k w_k^2 / m_k`` for ``m1 m2 / (m1 + m2)``, body k takes ``t_k = mu w_k / m_k``.
"""

from dataclasses import dataclass, field

import numpy as np

from turnbuckle.geometry.quaternions import rotate
from turnbuckle.solvers.displacement.conditions import Poses


@dataclass
class PointTies:
    """Rows over weighted points, host arrays. Entries of row r are ``start[r]`` to ``start[r + 1]``."""

    start: np.ndarray  # (rows + 1,) int
    weight: np.ndarray  # (entries,)
    body: np.ndarray  # (entries,) int: rigid body, or -1: a mass point
    point: np.ndarray  # (entries,) int: number of the mass point, anything for a body
    local: np.ndarray  # (entries, 3) place in the body's inertial frame [m]
    target: np.ndarray  # (rows, 3) [m]
    directions: np.ndarray | None = None  # (rows, 3, 3) projectors on what is held; None: all is
    names: list[str] = field(default_factory=list)  # (rows,) constraint they belong to, for messages

    @property
    def count(self) -> int:
        """Rows."""
        return len(self.start) - 1

    @classmethod
    def none(cls) -> "PointTies":
        """No rows."""
        empty = np.zeros(0, dtype=np.int64)
        return cls(np.zeros(1, dtype=np.int64), np.zeros(0), empty, empty, np.zeros((0, 3)), np.zeros((0, 3)))


class TieRows:
    """`PointTies` made ready. Bodies and mass points are numbered together: mass point p is body ``bodies + p``."""

    def __init__(self, ties: PointTies, inverse_mass: np.ndarray, bodies: int) -> None:
        """``inverse_mass`` (bodies + mass points,) [1/kg], 0 where immobile."""
        self.ties = ties
        self.row = np.repeat(np.arange(ties.count), np.diff(ties.start))
        self.unit = np.where(ties.body >= 0, ties.body, bodies + ties.point)
        give = ties.weight * inverse_mass[self.unit]
        total = np.bincount(self.row, weights=ties.weight * give, minlength=ties.count)
        self.movable = total > 0.0
        self.share = give / np.where(self.movable, total, 1.0)[self.row]
        self.rigid = ties.body >= 0
        self.bodies = bodies

    def places(self, poses: Poses, points: np.ndarray) -> np.ndarray:
        """Where the points of all entries are (entries, 3) [m]."""
        ties = self.ties
        out = np.empty((len(self.unit), 3))
        r = self.rigid
        out[r] = poses.x[ties.body[r]] + rotate(poses.q[ties.body[r]], ties.local[r])
        out[~r] = points[ties.point[~r]]
        return out

    def gaps(self, places: np.ndarray) -> np.ndarray:
        """What is missing, (rows, 3) [m]."""
        ties = self.ties
        total = np.zeros((ties.count, 3))
        np.add.at(total, self.row, ties.weight[:, None] * places)
        gap = ties.target - total
        return gap if ties.directions is None else np.einsum("rij,rj->ri", ties.directions, gap)
