"""Coordinates of joints and the directions in which they push, for given poses: what `contact_joints` closes.

Each part of a joint has up to three rows, in the places of `turnbuckle.constraints.joints` (FIRST equalities, then the
bounded coordinate). Row k of part p has the coordinate ``s[p, k]`` and moves it by

    ds/dt = force . (v_a - v_b) + t_a . w_a - t_b . w_b,    t_a = (at - x_a) x force + turn,    t_b alike,

so that a multiplier l pushes body a with ``l force`` and body b with ``-l force`` at one common point.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from turnbuckle.data import rigid
from turnbuckle.data.rigid import ROWS, JointParts
from turnbuckle.geometry.quaternions import conjugate, cross, dot, logarithm, matrices, multiply, norm, rotate, twists

LOOKED_UP = (rigid.CURVE, rigid.SURFACE, rigid.CALLABLE)
TINY = 1e-12


@dataclass
class PartRows:
    """Rows of all parts (p, ROWS); places that a part does not use are zero."""

    s: np.ndarray  # (p, ROWS) [m or rad]
    force: np.ndarray  # (p, ROWS, 3)
    turn: np.ndarray  # (p, ROWS, 3) [m, of rotations 1], torque of the row that is no force
    at: np.ndarray  # (p, 3) where forces act [m]


def middle(x0: np.ndarray, q0: np.ndarray, x1: np.ndarray, q1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The poses half way, places (n, 3) and quaternions (n, 4)."""
    q = q0 + np.where(dot(q0, q1) < 0.0, -1.0, 1.0)[:, None] * q1
    return 0.5 * (x0 + x1), q / norm(q)[:, None]


def unwound(s: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Angles ``s``, whole turns more or less, nearest to ``near`` [rad]."""
    return near + np.remainder(s - near + np.pi, 2.0 * np.pi) - np.pi


class JointGeometry:
    """All parts of a state's joints."""

    def __init__(self, parts: JointParts, straight: np.ndarray) -> None:
        """``straight`` (p,) bool: angles of 0, which hold two directions."""
        self.parts, self.straight = parts, straight
        self.of = {kind: np.flatnonzero(parts.kind == kind) for kind in np.unique(parts.kind)}
        self.looked_up = np.flatnonzero(np.isin(parts.kind, LOOKED_UP))

    def local(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """P_a in the frame of b (p, 3) [m]."""
        p, o, _, frame_b = self._sides(x, q)
        return rotate(conjugate(frame_b), p - o)

    def to_world(self, directions: np.ndarray, q: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Directions (k, ROWS, 3) in the frames of b of the parts ``part`` (k,), for bodies turned by ``q``."""
        turned = matrices(multiply(q[self.parts.b[part]], self.parts.q_b[part]))
        return np.einsum("ide,ike->ikd", turned, directions)

    def rows(self, x: np.ndarray, q: np.ndarray) -> PartRows:
        """All rows but those that are looked up, for bodies at ``x`` (n, 3), ``q`` (n, 4) xyzw."""
        count = self.parts.count
        p, o, frame_a, frame_b = self._sides(x, q)
        out = PartRows(np.zeros((count, ROWS)), np.zeros((count, ROWS, 3)), np.zeros((count, ROWS, 3)), p.copy())
        if not count:
            return out
        a, b = matrices(frame_a).transpose(0, 2, 1), matrices(frame_b).transpose(0, 2, 1)  # [i, k]: axis k
        d = p - o
        for kind, i in self.of.items():
            if kind == rigid.POINT:
                out.s[i], out.force[i] = d[i], np.eye(3)
            elif kind in (rigid.SEGMENT, rigid.MOTOR_AXIAL):
                axes = b[i] if kind == rigid.SEGMENT else np.roll(b[i], 1, axis=1)
                out.s[i], out.force[i] = np.einsum("ikd,id->ik", axes, d[i]), axes
            elif kind == rigid.RING:
                z = b[i, 2]
                height = dot(d[i], z)
                radial = d[i] - height[:, None] * z
                radius = norm(radial)
                away = np.where((radius > TINY)[:, None], radial / np.maximum(radius, TINY)[:, None], b[i, 0])
                out.s[i, 0], out.s[i, 1] = height, radius
                out.force[i, 0], out.force[i, 1] = z, away
            elif kind == rigid.SPHERE:
                size = norm(d[i])
                out.s[i, 0] = size
                out.force[i, 0] = np.where((size > TINY)[:, None], d[i] / np.maximum(size, TINY)[:, None], b[i, 2])
            elif kind == rigid.ANGLE:
                self._angle(out, i, a[i, 2], b[i])
            elif kind in (rigid.TWIST, rigid.MOTOR_TWIST):
                out.s[i, 0] = twists(multiply(conjugate(frame_b[i]), frame_a[i]))
                both = a[i, 2] + b[i, 2]
                out.turn[i, 0] = both / np.maximum(1.0 + dot(a[i, 2], b[i, 2]), 1e-9)[:, None]
            elif kind == rigid.FIXED:
                out.s[i] = logarithm(multiply(conjugate(frame_b[i]), frame_a[i]))
                out.turn[i] = b[i]
            elif kind == rigid.ROLLING:
                self._rolling(out, i, p[i], o[i], a[i, 2], b[i])
        return out

    def _angle(self, out: PartRows, i: np.ndarray, z_a: np.ndarray, b: np.ndarray) -> None:
        n = cross(b[:, 2], z_a)
        sine, cosine = norm(n), dot(b[:, 2], z_a)
        theta = np.arctan2(sine, cosine)
        out.s[i, 0] = theta
        out.turn[i, 0] = np.where((sine > TINY)[:, None], n / np.maximum(sine, TINY)[:, None], b[:, 0])
        two = np.flatnonzero(self.straight[i])
        j = i[two]
        # the rotation vector from z_b to z_a, along both axes of b across: beyond a right angle it still leads back
        vector = out.turn[j, 0] * theta[two, None]
        out.turn[j, 0], out.turn[j, 1] = b[two, 0], b[two, 1]
        out.s[j, 0], out.s[j, 1] = dot(vector, b[two, 0]), dot(vector, b[two, 1])

    def _rolling(
        self, out: PartRows, i: np.ndarray, p: np.ndarray, o: np.ndarray, axle: np.ndarray, b: np.ndarray
    ) -> None:
        """Height over the plane; two rows of velocity of what touches, whose ``s`` is `slip`."""
        n = b[:, 2]
        ball = (self.parts.lo[i] > 0.5)[:, None]
        down = np.where(ball, n, n - axle * dot(axle, n)[:, None])
        touch = p - self.parts.hi[i, None] * down / norm(down)[:, None]
        out.at[i] = touch
        out.s[i, 0] = dot(n, touch - o)
        out.force[i] = b[:, [2, 0, 1]]

    def slip(
        self, mid: PartRows, x0: np.ndarray, q0: np.ndarray, x1: np.ndarray, q1: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rolling parts, and how far each has slipped from poses 0 to poses 1 along rows 1 and 2 (k, 2) [m]."""
        i = self.of.get(rigid.ROLLING, np.zeros(0, dtype=np.int64))
        a, b = self.parts.a[i], self.parts.b[i]
        touch = mid.at[i]
        moved = x1 - x0
        turned = logarithm(multiply(q1, conjugate(q0)))
        centre = 0.5 * (x0 + x1)
        way = moved[a] + cross(turned[a], touch - centre[a]) - moved[b] - cross(turned[b], touch - centre[b])
        return i, np.einsum("ikd,id->ik", mid.force[i, 1:], way)

    def _sides(self, x: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """P_a and P_b, and the frames of both sides, in the world."""
        parts = self.parts
        a, b = parts.a, parts.b
        p = x[a] + rotate(q[a], parts.p_a)
        o = x[b] + rotate(q[b], parts.p_b)
        return p, o, multiply(q[a], parts.q_a), multiply(q[b], parts.q_b)

    def jacobian(
        self, rows: PartRows, x: np.ndarray, part: np.ndarray, k: np.ndarray, points: int, blocks: int
    ) -> sp.csr_array:
        """Rows (part, k) over block velocities, (rows, 3 blocks); ``x`` (n, 3) the places that ``rows`` belong to."""
        m = len(part)
        a, b = self.parts.a[part].astype(np.int64), self.parts.b[part].astype(np.int64)
        line, turn, at = rows.force[part, k], rows.turn[part, k], rows.at[part]
        values = np.stack([line, cross(at - x[a], line) + turn, -line, -cross(at - x[b], line) - turn], axis=1)
        first = points + 2 * np.stack([a, a, b, b], axis=1) + np.array([0, 1, 0, 1])
        columns = 3 * first[:, :, None] + np.arange(3)
        numbers = np.broadcast_to(np.arange(m)[:, None, None], columns.shape)
        return sp.csr_array((values.ravel(), (numbers.ravel(), columns.ravel())), shape=(m, 3 * blocks))
