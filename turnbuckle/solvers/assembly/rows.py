"""All that joints and ties hold, linearised at given poses: residuals and their derivatives, for Newton steps.

Unknowns are small motions of the bodies in scaled units, six each: ``sqrt(m) dx`` and ``sqrt(J) dR`` along the
principal axes, so that the shortest step is the one that moves the least mass.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from turnbuckle.geometry.quaternions import conjugate, cross, dot, logarithm, matrices, multiply, norm, rotate
from turnbuckle.solvers.displacement.conditions import Conditions, Poses
from turnbuckle.solvers.displacement.mobility import Mobility
from turnbuckle.solvers.displacement.ties import TieRows

STILL = 1e-24  # of the largest row, squared: a row that moves nothing


@dataclass
class RowSet:
    """Rows ``s + J d = 0``, or ``>= 0`` where ``sided``."""

    s: np.ndarray  # (r,) [m], of rotations in radians times the radius of gyration
    sided: np.ndarray  # (r,) bool
    jacobian: sparse.csr_array  # (r, 6 bodies)

    @property
    def broken(self) -> np.ndarray:
        """What counts against the rows: s, and of one-sided rows what is below 0."""
        return np.where(self.sided, np.minimum(self.s, 0.0), self.s)


@dataclass
class _Chunk:
    """Rows between two bodies: a force l on a and -l on b with the torques t_a and t_b."""

    s: np.ndarray
    sided: np.ndarray
    a: np.ndarray
    b: np.ndarray
    l: np.ndarray  # noqa: E741  (as in the equations)
    t_a: np.ndarray
    t_b: np.ndarray


class Linearised:
    """Makes `RowSet`s of the same joints and ties for changing poses."""

    def __init__(self, conditions: Conditions, mobility: Mobility, ties: TieRows, bodies: int) -> None:
        """Ties here are of rigid bodies alone."""
        self._c, self._ties, self._n = conditions, ties, bodies
        inverse = mobility.inverse_mass
        moving = inverse > 0.0
        self.mean_mass = float(np.mean(1.0 / inverse[moving])) if moving.any() else 1.0
        # principal moments from C = m / J
        turning = np.where(moving[:, None], mobility.turning * inverse[:, None], 0.0)
        self._linear = np.sqrt(inverse * self.mean_mass)
        self._angular = np.sqrt(turning * self.mean_mass)
        some = mobility.turning[mobility.turning > 0.0]
        self.size = float(np.median(1.0 / np.sqrt(some))) if len(some) else 1.0  # [m], radius of gyration

    def rows(self, poses: Poses) -> RowSet:
        """All rows at ``poses`` that can be moved; limits that are not reached are left out."""
        every = self.every_row(poses)
        square = every.jacobian.multiply(every.jacobian).sum(axis=1) if len(every.s) else np.zeros(0)
        keep = np.flatnonzero(square > STILL * square.max(initial=0.0))
        return RowSet(every.s[keep], every.sided[keep], every.jacobian[keep])

    def every_row(self, poses: Poses) -> RowSet:
        """The same, with those between bodies that cannot move."""
        chunks = [chunk for chunk in (*self._places(poses), *self._turns(poses)) if len(chunk.s)]
        s = [chunk.s for chunk in chunks]
        sided = [chunk.sided for chunk in chunks]
        entries = []
        first = 0
        for chunk in chunks:
            index = first + np.arange(len(chunk.s))
            entries += [(index, chunk.a, chunk.l, chunk.t_a), (index, chunk.b, -chunk.l, -chunk.t_b)]
            first += len(index)
        if self._ties.ties.count:
            tie_s, tie_entries = self._tie_rows(poses, first)
            s.append(tie_s)
            sided.append(np.zeros(len(tie_s), bool))
            entries += tie_entries
            first += len(tie_s)
        values = np.concatenate(s) if first else np.zeros(0)
        return RowSet(
            values, np.concatenate(sided) if first else np.zeros(0, bool), self._matrix(entries, first, poses)
        )

    def moved(self, poses: Poses, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Translations and rotation vectors (bodies, 3) in the world of a step (6 bodies,) in scaled units."""
        step = step.reshape(-1, 6)
        return self._linear[:, None] * step[:, :3], rotate(poses.q, self._angular * step[:, 3:])

    def _matrix(self, entries: list, count: int, poses: Poses) -> sparse.csr_array:
        """The derivative in scaled units."""
        if not entries:
            return sparse.csr_array((count, 6 * self._n))
        index = np.concatenate([e[0] for e in entries])
        body = np.concatenate([e[1] for e in entries])
        force, torque = np.concatenate([e[2] for e in entries]), np.concatenate([e[3] for e in entries])
        values = np.concatenate(
            [self._linear[body, None] * force, self._angular[body] * rotate(conjugate(poses.q[body]), torque)], axis=1
        )
        columns = 6 * body[:, None] + np.arange(6)
        rows = np.broadcast_to(index[:, None], columns.shape)
        matrix = sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(count, 6 * self._n))
        return matrix.tocsr()

    def _places(self, poses: Poses) -> list[_Chunk]:
        """Rows of translation."""
        c, chunks = self._c, []
        if len(c.placed) == 0:
            return []
        p, o, frame = c.sides(poses, c.placed)
        local = rotate(conjugate(frame), p - o)
        for rows, domain in c.domains:
            held = domain.held(local[rows])
            value = np.einsum("nkd,nd->nk", held.directions, local[rows] - held.point)
            which, k = np.nonzero(np.arange(3) < held.count[:, None])
            at = rows[which]
            chunks.append(self._forces(c.placed[at], value[which, k], held.one_sided[which, k], p[at],
                                       rotate(frame[at], held.directions[which, k]), poses))  # fmt: skip
        if len(c.rolling):
            arm, n = c.contact_arms(poses)
            p, o, _ = c.sides(poses, c.rolling)
            chunks.append(self._forces(c.rolling, dot(n, p + arm - o), np.zeros(len(n), bool), p + arm, n, poses))
        return chunks

    def _forces(
        self, rows: np.ndarray, s: np.ndarray, sided: np.ndarray, at: np.ndarray, n: np.ndarray, poses: Poses
    ) -> _Chunk:
        a, b = self._c.a[rows], self._c.b[rows]
        return _Chunk(s, sided, a, b, n, cross(at - poses.x[a], n), cross(at - poses.x[b], n))

    def _torques(self, rows: np.ndarray, s: np.ndarray, t: np.ndarray) -> _Chunk:
        s, t = s * self.size, t * self.size
        return _Chunk(s, np.zeros(len(s), bool), self._c.a[rows], self._c.b[rows], np.zeros_like(t), t, t)

    def _turns(self, poses: Poses) -> list[_Chunk]:
        """Rows of rotation. Limits of angles and twists that are kept have no row."""
        c, chunks = self._c, []
        if len(c.fixed):
            frame_a, frame_b = c.frames(poses, c.fixed)
            turn = logarithm(multiply(frame_a, conjugate(frame_b)))
            axes = np.tile(np.eye(3), (len(turn), 1))
            chunks.append(self._torques(np.repeat(c.fixed, 3), turn.ravel(), axes))
        if len(c.angle):
            frame_a, frame_b = c.frames(poses, c.angle)
            want, aligned = c.angle_gaps(frame_a, frame_b)
            size = norm(want)
            exact = c.lo[c.angle] >= c.hi[c.angle]
            one = np.flatnonzero(~aligned & ((size > 0.0) | exact))
            axis = self._cone_axes(frame_a[one], frame_b[one])
            chunks.append(self._torques(c.angle[one], -dot(want[one], axis), axis))
            two = np.flatnonzero(aligned)
            both = matrices(frame_b[two]).transpose(0, 2, 1)[:, :2]
            s = -np.einsum("nkd,nd->nk", both, want[two])
            chunks.append(self._torques(np.repeat(c.angle[two], 2), s.ravel(), both.reshape(-1, 3)))
        if len(c.twist):
            want, axis, rate = c.twist_gaps(*c.frames(poses, c.twist))
            some = np.flatnonzero((want != 0.0) | (c.lo[c.twist] >= c.hi[c.twist]))
            chunks.append(self._torques(c.twist[some], -want[some], axis[some] * rate[some, None]))
        return chunks

    @staticmethod
    def _cone_axes(frame_a: np.ndarray, frame_b: np.ndarray) -> np.ndarray:
        """The axes about which a turns to open its angle."""
        e_z = np.array([[0.0, 0.0, 1.0]])
        n = cross(rotate(frame_b, e_z), rotate(frame_a, e_z))
        size = norm(n)
        other = rotate(frame_b, np.array([[1.0, 0.0, 0.0]]))
        return np.where((size > 1e-12)[:, None], n / np.where(size > 1e-12, size, 1.0)[:, None], other)

    def _tie_rows(self, poses: Poses, first: int) -> tuple[np.ndarray, list]:
        """Three rows a tie."""
        ties, t = self._ties, self._ties.ties
        places = ties.places(poses, np.zeros((0, 3)))
        gap = ties.gaps(places)
        held = np.tile(np.eye(3), (t.count, 1, 1)) if t.directions is None else t.directions
        entries = []
        for k in range(3):
            force = t.weight[:, None] * held[ties.row, k]
            torque = cross(places - poses.x[t.body], force)
            entries.append((first + 3 * ties.row + k, t.body, force, torque))
        return -gap.ravel(), entries
