"""What the joints of a scene hold at its start, as rows: a force l on body1 and -l on body0 with the torques t_a and t_b.

Rows of equality alone: limits, preferential domains and motors leave their coordinate free. A rolling wheel has two rows
of velocity besides the one that keeps it on its plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.rigid import Joint
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import conjugate, matrices, rotate
from turnbuckle.solvers.displacement.conditions import Conditions, Poses


@dataclass(frozen=True)
class JointRows:
    """Rows (r,) between bodies a and b."""

    joint: np.ndarray  # (r,) number in the list of joints
    turning: np.ndarray  # (r,) bool: of rotation
    a: np.ndarray
    b: np.ndarray
    force: np.ndarray  # (r, 3) [1]
    torque_a: np.ndarray  # (r, 3) [m], of rows of rotation [1]
    torque_b: np.ndarray

    def rates(self, v: np.ndarray, w: np.ndarray) -> np.ndarray:
        """How fast the rows open (r,) [m/s or rad/s] when the bodies move with ``v``, ``w`` (n, 3)."""
        moved = np.sum(self.force * (v[self.a] - v[self.b]), axis=1)
        return moved + np.sum(self.torque_a * w[self.a] - self.torque_b * w[self.b], axis=1)


class _Rows:
    """Rows in the making."""

    def __init__(self, conditions: Conditions, poses: Poses) -> None:
        self.c, self.poses = conditions, poses
        self.found: list[tuple[np.ndarray, ...]] = []

    def forces(self, which: np.ndarray, at: np.ndarray, n: np.ndarray) -> None:
        a, b, x = self.c.a[which], self.c.b[which], self.poses.x
        self._add(which, False, n, np.cross(at - x[a], n), np.cross(at - x[b], n))

    def torques(self, which: np.ndarray, t: np.ndarray) -> None:
        self._add(which, True, np.zeros_like(t), t, t)

    def _add(self, which: np.ndarray, turning: bool, *columns: np.ndarray) -> None:
        c = self.c
        self.found.append((c.joint[which], np.full(len(which), turning), c.a[which], c.b[which], *columns))


def joint_rows(state: State, joints: list[Joint], acting: np.ndarray) -> JointRows:
    """The rows of those of ``joints`` that are ``acting``, at the poses of ``state``."""
    c = Conditions(state.parts, acting, state.domains)
    poses = Poses(state.rigid.x.numpy(), state.rigid.q.numpy())
    rows = _Rows(c, poses)
    if len(c.placed):
        p, o, frame = c.sides(poses, c.placed)
        local = rotate(conjugate(frame), p - o)
        for which, domain in c.domains:
            held = domain.held(local[which])
            r, k = np.nonzero((np.arange(3) < held.count[:, None]) & ~held.one_sided)
            at = which[r]
            rows.forces(c.placed[at], p[at], rotate(frame[at], held.directions[r, k]))
    if len(c.rolling):
        arm, n = c.contact_arms(poses)
        p, _, frame = c.sides(poses, c.rolling)
        axes = matrices(frame).transpose(0, 2, 1)
        for k in range(3):
            rows.forces(c.rolling, p + arm, axes[:, k])
    if len(c.fixed):
        for e in np.eye(3):
            rows.torques(c.fixed, np.tile(e, (len(c.fixed), 1)))
    if len(c.angle):
        frame_a, frame_b = c.frames(poses, c.angle)
        axes_b = matrices(frame_b).transpose(0, 2, 1)
        straight = c.hi[c.angle] <= 0.0
        cone = ~straight & (c.lo[c.angle] >= c.hi[c.angle])
        for k in range(2):
            rows.torques(c.angle[straight], axes_b[straight, k])
        n = np.cross(axes_b[cone, 2], rotate(frame_a[cone], np.array([[0.0, 0.0, 1.0]])))
        size = np.linalg.norm(n, axis=1, keepdims=True)
        rows.torques(c.angle[cone], np.where(size > 1e-12, n / np.maximum(size, 1e-12), axes_b[cone, 0]))
    if len(c.twist):
        _, axis, rate = c.twist_gaps(*c.frames(poses, c.twist))
        exact = c.lo[c.twist] >= c.hi[c.twist]
        rows.torques(c.twist[exact], (axis * rate[:, None])[exact])
    if not rows.found:
        none, empty = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return JointRows(none, none.astype(bool), none, none, empty, empty, empty)
    return JointRows(*(np.concatenate(column) for column in zip(*rows.found, strict=True)))


def acting_at_start(state: State) -> tuple[list[Joint], np.ndarray]:
    """All joints, and which of them act at the start (joints,) bool."""
    joints = list(state.joints.values())
    return joints, np.array([j.enabled and j.start <= 0.0 < j.end for j in joints], dtype=bool)
