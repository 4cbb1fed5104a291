"""Small rotations of one iteration: of translation gaps, then of angles, then of twists (Displacement, 3.1 and 4.2).

Each kind sees the bodies as the rotations of its own joint before it will have left them.
"""

import numpy as np

from turnbuckle.geometry.quaternions import cross, exponential, matrices, multiply, norm, rotate
from turnbuckle.solvers.displacement.conditions import Conditions, Poses
from turnbuckle.solvers.displacement.mobility import Mobility
from turnbuckle.solvers.displacement.ties import TieRows


class Turning:
    """Rotations that joints and ties ask of their bodies."""

    def __init__(self, conditions: Conditions, mobility: Mobility, alpha: np.ndarray) -> None:
        """``alpha`` (joints,): factors of the user, NaN where found for each gap."""
        self._c, self._m, self._alpha = conditions, mobility, alpha
        self._turns = len(conditions.angle) + len(conditions.twist) + len(conditions.fixed) > 0

    def of_joints(
        self, poses: Poses, p: np.ndarray, gap: np.ndarray, placed: np.ndarray, part: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation vectors of bodies a of all joints, then of b (2 joints, 3); pulls of `placed`; angles missing.

        ``p``, ``gap``: points of application and gaps of the conditions `placed`, of the joints ``placed``.
        """
        c, m = self._c, self._m
        k = len(m.share_a)
        rows = c.placed
        arm_a, arm_b = p - poses.x[c.a[rows]], p + gap - poses.x[c.b[rows]]
        give_a, give_b = self._give(poses, rows)
        alpha = self._alpha[placed]
        pull = gap * alpha[:, None]
        found = np.isnan(alpha)
        if found.any():
            give = give_of_places(give_a, arm_a) + give_of_places(give_b, arm_b)
            pull = np.where(found[:, None], pulls(give, c.held(poses, gap), gap), pull)
        of_a, of_b = np.zeros((k, 3)), np.zeros((k, 3))
        pull = pull * part[:, None]
        np.add.at(of_a, placed, np.einsum("nij,nj->ni", give_a, cross(arm_a, pull)))
        np.subtract.at(of_b, placed, np.einsum("nij,nj->ni", give_b, cross(arm_b, pull)))
        angle = np.zeros(k)
        if self._turns:
            self._add_angles(poses, of_a, of_b, angle)
        return np.concatenate([of_a, of_b]), pull, angle

    def _add_angles(self, poses: Poses, of_a: np.ndarray, of_b: np.ndarray, angle: np.ndarray) -> None:
        """Add rotations for angles and suppressed rotations, then for twists; ``angle`` gets what is missing now."""
        c = self._c
        factor = np.where(np.isfinite(self._alpha), self._alpha, 1.0)
        if len(c.fixed):
            rows, joint = c.fixed, c.joint[c.fixed]
            np.maximum.at(angle, joint, norm(c.fixed_gaps(*c.frames(poses, rows))))
            want = c.fixed_gaps(*self._turned(poses, rows, of_a, of_b))
            give_a, give_b = self._give(poses, rows)
            impulse = _solve(give_a + give_b, want) * factor[joint, None]
            self._add(joint, give_a, give_b, impulse, of_a, of_b)
        if len(c.angle):
            rows, joint = c.angle, c.joint[c.angle]
            np.maximum.at(angle, joint, norm(c.angle_gaps(*c.frames(poses, rows))[0]))
            frame_a, frame_b = self._turned(poses, rows, of_a, of_b)
            want, aligned = c.angle_gaps(frame_a, frame_b)
            give_a, give_b = self._give(poses, rows)
            axis = rotate(frame_b, np.array([[0.0, 0.0, 1.0]]))
            impulse = _about(give_a + give_b, want, axis, aligned) * factor[joint, None]
            self._add(joint, give_a, give_b, impulse, of_a, of_b)
        if len(c.twist):
            rows, joint = c.twist, c.joint[c.twist]
            np.maximum.at(angle, joint, np.abs(c.twist_gaps(*c.frames(poses, rows))[0]))
            want, axis, rate = c.twist_gaps(*self._turned(poses, rows, of_a, of_b))
            give_a, give_b = self._give(poses, rows)
            give = np.einsum("ni,nij,nj->n", axis, give_a + give_b, axis) * rate
            impulse = (factor[joint] * want / np.where(give > 0.0, give, np.inf))[:, None] * axis
            self._add(joint, give_a, give_b, impulse, of_a, of_b)

    def _turned(
        self, poses: Poses, rows: np.ndarray, of_a: np.ndarray, of_b: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Frames as the joint's own rotations so far will leave them."""
        frame_a, frame_b = self._c.frames(poses, rows)
        joint = self._c.joint[rows]
        return multiply(exponential(of_a[joint]), frame_a), multiply(exponential(of_b[joint]), frame_b)

    def _give(self, poses: Poses, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations of a and of b for a unit of angular impulse, (n, 3, 3) each: ``t C``."""
        c, m = self._c, self._m
        a, b, joint = c.a[rows], c.b[rows], c.joint[rows]
        give_a = turned_tensors(poses.q[a], m.share_a[joint, None] * m.turning[a])
        return give_a, turned_tensors(poses.q[b], m.share_b[joint, None] * m.turning[b])

    @staticmethod
    def _add(
        joint: np.ndarray,
        give_a: np.ndarray,
        give_b: np.ndarray,
        impulse: np.ndarray,
        of_a: np.ndarray,
        of_b: np.ndarray,
    ) -> None:
        """Opposite impulses on both bodies."""
        np.add.at(of_a, joint, np.einsum("nij,nj->ni", give_a, impulse))
        np.subtract.at(of_b, joint, np.einsum("nij,nj->ni", give_b, impulse))

    def of_ties(
        self, poses: Poses, places: np.ndarray, missing: np.ndarray, ties: TieRows, alpha: float | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rotation vectors of the bodies of all entries (entries, 3), and pulls of the rows (rows, 3)."""
        turn = np.zeros_like(places)
        r = np.flatnonzero(ties.rigid)
        if len(r) == 0:
            return turn, missing if alpha is None else alpha * missing
        body = ties.ties.body[r]
        arm = places[r] - poses.x[body]
        give = turned_tensors(poses.q[body], ties.share[r, None] * self._m.turning[body])
        if alpha is None:
            total = np.zeros((len(missing), 3, 3))
            np.add.at(total, ties.row[r], ties.ties.weight[r, None, None] * give_of_places(give, arm))
            held = ties.ties.directions
            pull = pulls(total, np.tile(np.eye(3), (len(missing), 1, 1)) if held is None else held, missing)
        else:
            pull = alpha * missing
        turn[r] = np.einsum("nij,nj->ni", give, cross(arm, pull[ties.row[r]]))
        return turn, pull


def turned_tensors(q: np.ndarray, principal: np.ndarray) -> np.ndarray:
    """``R diag(principal) R^T`` (n, 3, 3)."""
    r = matrices(q)
    return (r * principal[:, None, :]) @ r.transpose(0, 2, 1)


def give_of_places(give: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """How places at ``arm`` (n, 3) follow a unit pull there by rotation alone: ``-[r] B [r]``, (n, 3, 3)."""
    x = np.zeros((len(arm), 3, 3))
    x[:, 0, 1], x[:, 0, 2], x[:, 1, 2] = -arm[:, 2], arm[:, 1], -arm[:, 0]
    x -= x.transpose(0, 2, 1)
    return x @ give @ x.transpose(0, 2, 1)


def pulls(give: np.ndarray, held: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Pulls (n, 3) within ``held`` that close gaps by rotation and translation together: ``P (I + give) P f = g``."""
    eye = np.eye(3)
    return np.linalg.solve(eye + held @ give @ held, gap[:, :, None])[:, :, 0]


def _solve(give: np.ndarray, want: np.ndarray) -> np.ndarray:
    """Impulses that turn by exactly ``want``; none where nothing can turn."""
    still = np.einsum("nii->n", give) <= 0.0
    safe = np.where(still[:, None, None], np.eye(3), give)
    return np.where(still[:, None], 0.0, np.linalg.solve(safe, want[:, :, None])[:, :, 0])


def _about(give: np.ndarray, want: np.ndarray, axis: np.ndarray, aligned: np.ndarray) -> np.ndarray:
    """Impulses for angles: along ``want``; where axes are held on one line, across them, exact in both ways."""
    size = norm(want)
    n = want / np.where(size > 0.0, size, 1.0)[:, None]
    m = cross(axis, n) * aligned[:, None]
    nn, nm, mm = (np.einsum("ni,nij,nj->n", s, give, t) for s, t in ((n, n), (n, m), (m, m)))
    mm = np.where(aligned, mm, 1.0)
    det = nn * mm - nm * nm
    some = det > 0.0
    safe = np.where(some, det, 1.0)
    along, across = np.where(some, size * mm / safe, 0.0), np.where(some, -size * nm / safe, 0.0)
    return along[:, None] * n + across[:, None] * m
