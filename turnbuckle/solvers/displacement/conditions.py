"""What joints ask for, evaluated for given poses: gaps of translation and of rotation, all joints of a kind at once.

A gap of translation is ``P_2' - P_1``, from the point of body a to the nearest permissible place in body b
(Displacement, 4.1). A gap of rotation is what body a still has to turn by relative to body b (4.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.rigid import FREE, JointParts
from turnbuckle.geometry.domains import Domain, Point, Ring, Segment, Sphere
from turnbuckle.geometry.quaternions import conjugate, cross, dot, logarithm, multiply, norm, rotate, twists

ALIGNED = 1e-12  # [rad], an angle limited to less holds two directions: both axes are one line
_WITH_PLACES = (*rigid.TRANSLATIONS, rigid.ROLLING)


@dataclass
class Poses:
    """Centres of mass x (n, 3) [m] and inertial frames q (n, 4) xyzw of all bodies."""

    x: np.ndarray
    q: np.ndarray


class Conditions:
    """The strict parts of the joints that act, sorted by kind.

    Preferential domains (stiffness, damping) and motors are forces, not conditions; of a soft segment or ring the line
    or plane stays strict.
    """

    def __init__(self, parts: JointParts, acting: np.ndarray, domains: Sequence[Domain] = ()) -> None:
        """``acting``: of joints, bool. ``domains``: what `JointParts.domain` numbers."""
        soft = parts.soft
        opened = soft & np.isin(parts.kind, (rigid.SEGMENT, rigid.RING))
        motor = np.isin(parts.kind, (rigid.MOTOR_AXIAL, rigid.MOTOR_TWIST, rigid.TIE))
        self.index = np.flatnonzero(acting[parts.joint] & (~soft | opened) & ~motor)
        self.index = self.index[np.argsort(parts.kind[self.index], kind="stable")]
        take = self.index
        self.kind, self.joint, self.a, self.b = (c[take] for c in (parts.kind, parts.joint, parts.a, parts.b))
        self.p_a, self.p_b, self.q_a, self.q_b = (c[take] for c in (parts.p_a, parts.p_b, parts.q_a, parts.q_b))
        self.lo = np.where(opened, np.where(parts.kind == rigid.RING, 0.0, -FREE), parts.lo)[take]
        self.hi = np.where(opened, FREE, parts.hi)[take]
        self.placed = np.flatnonzero(np.isin(self.kind, _WITH_PLACES))
        self.rolling = np.flatnonzero(self.kind == rigid.ROLLING)
        self.angle, self.twist, self.fixed = (
            np.flatnonzero(self.kind == k) for k in (rigid.ANGLE, rigid.TWIST, rigid.FIXED)
        )
        self._domains = self._grouped(parts, domains)

    def _grouped(self, parts: JointParts, domains: Sequence[Domain]) -> list[tuple[np.ndarray, Domain]]:
        """Rows of `placed` with the domain that answers for them."""
        kind, lo, hi = self.kind[self.placed], self.lo[self.placed], self.hi[self.placed]
        found: list[tuple[np.ndarray, Domain]] = []
        for k, make in ((rigid.SEGMENT, Segment), (rigid.RING, Ring), (rigid.SPHERE, Sphere)):
            rows = np.flatnonzero(kind == k)
            if len(rows):
                found.append((rows, make(lo[rows], hi[rows])))
        rows = np.flatnonzero(kind == rigid.POINT)
        if len(rows):
            found.append((rows, Point()))
        number = np.where(
            np.isin(kind, (rigid.CURVE, rigid.SURFACE, rigid.CALLABLE)), parts.domain[self.index][self.placed], -1
        )
        for d in np.unique(number[number >= 0]):
            found.append((np.flatnonzero(number == d), domains[d]))
        return found

    @property
    def domains(self) -> list[tuple[np.ndarray, Domain]]:
        """Rows of `placed`, and the domain in which their points must be."""
        return self._domains

    def sides(self, poses: Poses, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """P_a and P_b in the world, and the frame of b there (quaternions), of the conditions ``rows``."""
        a, b = self.a[rows], self.b[rows]
        p = poses.x[a] + rotate(poses.q[a], self.p_a[rows])
        o = poses.x[b] + rotate(poses.q[b], self.p_b[rows])
        return p, o, multiply(poses.q[b], self.q_b[rows])

    def frames(self, poses: Poses, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frames of a and of b in the world, quaternions."""
        return (
            multiply(poses.q[self.a[rows]], self.q_a[rows]),
            multiply(poses.q[self.b[rows]], self.q_b[rows]),
        )

    def translation_gaps(self, poses: Poses, start: Poses | None) -> tuple[np.ndarray, np.ndarray]:
        """Points of application on a (n, 3) and gaps (n, 3) [m] of the conditions `placed`.

        ``start``: poses at the start of the step, from which rolling counts; without, rolling holds the wheel up only.
        """
        p, o, frame = self.sides(poses, self.placed)
        local = rotate(conjugate(frame), p - o)
        near = local.copy()
        for rows, domain in self._domains:
            near[rows] = domain.nearest(local[rows])
        gap = rotate(frame, near - local)
        if len(self.rolling):
            rows = np.flatnonzero(self.kind[self.placed] == rigid.ROLLING)
            p[rows], gap[rows] = self._rolling_gaps(poses, start)
        return p, gap

    def held(self, poses: Poses, gap: np.ndarray) -> np.ndarray:
        """Projectors (n, 3, 3) on the directions in which the conditions `placed` may push: no friction along domains.

        All of a point and of a rolling wheel, those across a segment between its ends, else that of the gap alone.
        """
        kind, size = self.kind[self.placed], norm(gap)
        n = gap / np.where(size > 0.0, size, 1.0)[:, None]
        out = n[:, :, None] * n[:, None, :]
        out[(kind == rigid.POINT) | (kind == rigid.ROLLING)] = np.eye(3)
        rows = np.flatnonzero(kind == rigid.SEGMENT)
        if len(rows):
            axis = rotate(self.frames(poses, self.placed[rows])[1], np.array([[0.0, 0.0, 1.0]]))
            ended = np.abs(dot(axis, gap[rows])) > 1e-9 * size[rows]
            out[rows] = np.eye(3) - np.where(ended, 0.0, 1.0)[:, None, None] * axis[:, :, None] * axis[:, None, :]
        return out

    def contact_arms(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """From the centres of rolling wheels to where they touch, and the normals of the planes."""
        frame_a, frame_b = self.frames(poses, self.rolling)
        z = np.array([[0.0, 0.0, 1.0]])
        n, u = rotate(frame_b, z), rotate(frame_a, z)
        ball = self.lo[self.rolling] > 0.5
        down = np.where(ball[:, None], n, n - u * dot(u, n)[:, None])
        return -self.hi[self.rolling, None] * down / norm(down)[:, None], n

    def _rolling_gaps(self, poses: Poses, start: Poses | None) -> tuple[np.ndarray, np.ndarray]:
        """The way back out of the plane, and back along what has slipped since the start of the step."""
        rows = self.rolling
        p, o, _ = self.sides(poses, rows)
        arm, n = self.contact_arms(poses)
        k = p + arm
        gap = -dot(n, k - o)[:, None] * n
        if start is not None:
            p0, _, _ = self.sides(start, rows)
            middle_arm = 0.5 * (arm + self.contact_arms(start)[0])
            middle = 0.5 * (p + p0) + middle_arm
            a, b = self.a[rows], self.b[rows]
            slip = p - p0 + cross(logarithm(multiply(poses.q[a], conjugate(start.q[a]))), middle_arm)
            centre = 0.5 * (poses.x[b] + start.x[b])
            slip -= poses.x[b] - start.x[b]
            slip -= cross(logarithm(multiply(poses.q[b], conjugate(start.q[b]))), middle - centre)
            gap -= slip - dot(n, slip)[:, None] * n
        return k, gap

    def angle_gaps(self, frame_a: np.ndarray, frame_b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotation vectors (n, 3) that angles ask for, and which of them hold both axes on one line (n,)."""
        e_z, e_x = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
        a, b = rotate(frame_a, e_z), rotate(frame_b, e_z)
        normal = cross(b, a)
        sine = norm(normal)
        theta = np.arctan2(sine, dot(a, b))
        lo, hi = self.lo[self.angle], self.hi[self.angle]
        some = sine > ALIGNED
        normal = np.where(some[:, None], normal / np.where(some, sine, 1.0)[:, None], rotate(frame_b, e_x))
        return (np.clip(theta, lo, hi) - theta)[:, None] * normal, hi <= ALIGNED

    def twist_gaps(self, frame_a: np.ndarray, frame_b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Twists still to turn (n,) [rad], common axes (n, 3), and the twist of a rotation of 1 about them."""
        e_z = np.array([[0.0, 0.0, 1.0]])
        a, b = rotate(frame_a, e_z), rotate(frame_b, e_z)
        both = a + b
        size = norm(both)
        psi = twists(multiply(conjugate(frame_b), frame_a))
        lo, hi = self.lo[self.twist], self.hi[self.twist]
        axis = np.where((size > 1e-6)[:, None], both / np.where(size > 1e-6, size, 1.0)[:, None], b)
        return twist_gap(psi, lo, hi), axis, size / np.maximum(1.0 + dot(a, b), 1e-6)

    def fixed_gaps(self, frame_a: np.ndarray, frame_b: np.ndarray) -> np.ndarray:
        """Rotation vectors (n, 3) that take frames a onto frames b."""
        return logarithm(multiply(frame_b, conjugate(frame_a)))


def twist_gap(psi: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """What is missing from twists ``psi`` in (-pi, pi] to [lo, hi], the shorter way round.

    Where one limit is open, the twist ends at the half turn on that side, and the way back is to the other limit.
    """
    turn = 2.0 * np.pi
    no_lo, no_hi = lo <= -FREE, hi >= FREE
    lo, hi = np.where(no_lo, -np.pi, lo), np.where(no_hi, np.pi, hi)
    width = hi - lo
    above = np.mod(psi - lo, turn)  # from lo upwards
    outside = (above > width) & (width < turn)
    back, on = above - np.minimum(width, turn), turn - above  # down to hi, up to lo
    back, on = np.where(no_hi, np.inf, back), np.where(no_lo, np.inf, on)
    return np.where(outside, np.where(back <= on, -back, on), 0.0)
