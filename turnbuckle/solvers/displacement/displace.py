"""The iteration in displacements (Displacement, sections 3 and 4): all corrections of an iteration at once.

An iteration computes for each joint the small rotations of its translation gap, (14) or (18), adds those of its angle
and of its twist (4.2), weights them by ``1 / max(n_i, n_j)``, sums them on each body (3.2) and turns the bodies by the
exponential of the sums. Then, scheme one: it applies the translations (15) of the same gaps; scheme two: it translates
by the gaps that are left *after* the combined rotation (19).

With ``alpha`` a number, ``alpha m1 m2 / (m1 + m2)`` stands for the factor in (14), (15), (18), (19); 1 is the paper's
choice. For slender bodies that turns too far: a rod pulled at its end turns by three times the gap, and a chain of rods
diverges. Without a number, the pull f that takes the place of ``alpha g`` is found for each gap g from
``(I + B) f = g``, where B is how the gap follows rotations (18). Then rotation and translation stay in the proportion
of (13) after both are applied, one joint alone closes in one iteration and keeps its angular momentum to first order,
and chains converge. In scheme two (19) then closes all that is left.

It stops when the weighted corrections of every joint are within the tolerance (2.2). They are looked at one by one, not
summed on the bodies: where joints contradict each other the sums vanish, and nothing would be said. What the joints are
still open by is in the result.

Angles and twists: a joint turns a and b by ``J_a^-1 L`` and ``-J_b^-1 L``, which keeps angular momentum.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse

from turnbuckle.data.rigid import Joint, JointParts, RigidBodies
from turnbuckle.geometry.domains import Domain
from turnbuckle.geometry.quaternions import exponential, multiply, norm
from turnbuckle.solvers.displacement.conditions import Conditions, Poses
from turnbuckle.solvers.displacement.mobility import mobility
from turnbuckle.solvers.displacement.options import DisplacementOptions, DisplacementResult
from turnbuckle.solvers.displacement.ties import PointTies, TieRows
from turnbuckle.solvers.displacement.turning import Turning

STUCK = 1e-10  # of the largest gap: sums of corrections below it move nothing, joints contradict each other


class Displacement:
    """A set of joints and ties made ready; `solve` brings bodies from where free motion took them onto it."""

    def __init__(
        self,
        bodies: RigidBodies,
        parts: JointParts,
        joints: Sequence[Joint],
        options: DisplacementOptions,
        *,
        acting: np.ndarray | None = None,
        domains: Sequence[Domain] = (),
        ties: PointTies | None = None,
        point_mass: np.ndarray | None = None,
    ) -> None:
        """``acting``: of joints, bool, else those enabled and not broken. ``point_mass`` (m,) [kg], 0: held."""
        self.options = options
        joints = list(joints)
        self.names = [joint.name for joint in joints]
        if acting is None:
            acting = np.array([joint.enabled and not joint.broken for joint in joints], dtype=bool)
        self.acting = acting
        self.conditions = Conditions(parts, acting, domains)
        self.mobility = mobility(bodies, joints, options.mobility == "user_parameter")
        self.count = bodies.count
        mass = np.zeros(0) if point_mass is None else np.asarray(point_mass, dtype=float)
        inverse = np.concatenate(
            [self.mobility.inverse_mass, np.where(mass > 0.0, 1.0 / np.where(mass > 0.0, mass, 1.0), 0.0)]
        )
        self.ties = TieRows(PointTies.none() if ties is None else ties, inverse, self.count)
        alphas = np.array([joint.alpha for joint in joints], dtype=float)
        if options.alpha is not None:
            alphas = np.where(np.isfinite(alphas), alphas, options.alpha)
        self._weigh(joints, inverse > 0.0)
        self._turning = Turning(self.conditions, self.mobility, alphas)  # NaN: found for each gap
        self._exact = np.where(np.isfinite(alphas), alphas, 1.0)[self._placed]

    def _weigh(self, joints: list[Joint], movable: np.ndarray) -> None:
        """Weights of joints and ties, and the matrices that sum weighted corrections on bodies and mass points.

        n_i counts joints and ties, not their parts. The world and whatever else is not moved by corrections counts 0:
        it cannot be pulled too far.
        """
        a = np.array([joint.a for joint in joints], dtype=np.int64)
        b = np.array([joint.b for joint in joints], dtype=np.int64)
        acts = np.zeros(len(joints), dtype=bool)
        acts[self.conditions.joint] = True
        total, units, rows = len(movable), self.ties.unit, self.ties.row
        n = np.bincount(np.concatenate([a[acts], b[acts], units]), minlength=total)
        n = np.where(movable, n, 0)
        most = np.zeros(self.ties.ties.count, dtype=np.int64)
        np.maximum.at(most, rows, n[units])
        if self.options.weights == "sum":
            w_joint, w_tie = np.ones(len(joints)), np.ones(len(most))
        else:
            w_joint = 1.0 / np.maximum(np.maximum(n[a], n[b]), 1)
            w_tie = 1.0 / np.maximum(most, 1)
        k, shape = len(joints), (total, 2 * len(joints) + len(units))
        columns = np.arange(shape[1])
        self._weight = np.concatenate([w_joint, w_joint, w_tie[rows]])
        self._sum = sparse.csr_array((self._weight, (np.concatenate([a, b, units]), columns)), shape=shape)
        placed = self.conditions.joint[self.conditions.placed]
        share = np.bincount(placed, minlength=k)[placed]
        self._a, self._b, self._placed = a, b, placed
        self._part = 1.0 / np.maximum(share, 1)  # a joint with two translation conditions takes half of each

    def solve(
        self,
        x: np.ndarray,
        q: np.ndarray,
        points: np.ndarray | None = None,
        *,
        start: tuple[np.ndarray, np.ndarray] | None = None,
        watch: Callable[[Poses, float], None] | None = None,
    ) -> DisplacementResult:
        """Move bodies x (n, 3), q (n, 4) and mass points (m, 3) until all corrections are within the tolerance.

        ``start``: x and q at the start of the step, needed by rolling. ``watch`` is called after each iteration with
        the poses and the largest gap before it.
        """
        options, c, ties = self.options, self.conditions, self.ties
        poses = Poses(np.array(x, dtype=float), np.array(q, dtype=float))
        begin = None if start is None else Poses(*start)
        points = np.zeros((0, 3)) if points is None else np.array(points, dtype=float)
        units, k, stop = self.count + len(points), len(self.names), getattr(options, "stop", "corrections")
        share = np.concatenate([self.mobility.share_a, self.mobility.share_b])
        history: list[float] = []
        stuck = False
        iteration = 0
        while True:
            p, gap = c.translation_gaps(poses, begin)
            places = ties.places(poses, points)
            missing = ties.gaps(places)
            turns, pull, angle = self._turning.of_joints(poses, p, gap, self._placed, self._part)
            largest = max(norm(gap).max(initial=0.0), norm(missing).max(initial=0.0), angle.max(initial=0.0))
            history.append(float(largest))
            tie_turns, tie_pull = self._turning.of_ties(poses, places, missing, ties, options.alpha)
            turns = np.concatenate([turns, tie_turns])
            measured = largest
            if stop == "corrections":
                joint_gap = np.zeros(k)
                np.maximum.at(joint_gap, self._placed, norm(gap))
                tie_share = np.abs(ties.share) * norm(missing)[ties.row]
                moves = np.concatenate([share * np.tile(joint_gap, 2), tie_share])
                measured = float((self._weight * np.maximum(moves, norm(turns))).max(initial=0.0))
            converged = measured <= options.tolerance
            if converged or stuck or iteration >= options.max_iterations or not np.isfinite(largest):
                break
            rotation = (self._sum @ turns)[: self.count]
            rotation = _limited(rotation, options.max_rotation)
            poses = Poses(poses.x, multiply(exponential(rotation), poses.q))
            if options.scheme == 2:
                _, gap = c.translation_gaps(poses, begin)
                pull = (self._exact * self._part)[:, None] * gap
                tie_pull = ties.gaps(ties.places(poses, points)) * (1.0 if options.alpha is None else options.alpha)
            total = np.zeros((k, 3))
            np.add.at(total, self._placed, pull)
            pulls = share[:, None] * np.concatenate([total, -total])
            shift = self._sum @ np.concatenate([pulls, ties.share[:, None] * tie_pull[ties.row]])
            poses = Poses(poses.x + shift[: self.count], poses.q)
            points = points + shift[self.count : units]
            stuck = max(norm(shift).max(initial=0.0), norm(rotation).max(initial=0.0)) < STUCK * largest
            iteration += 1
            if watch is not None:
                watch(poses, largest)
        return self._result(poses, points, iteration, bool(converged), (gap, missing, angle), history)

    def _result(
        self, poses: Poses, points: np.ndarray, iterations: int, converged: bool,
        left: tuple[np.ndarray, np.ndarray, np.ndarray], history: list[float],
    ) -> DisplacementResult:  # fmt: skip
        gap, missing, angle = left
        of_joint = np.zeros(len(self.names))
        np.maximum.at(of_joint, self._placed, norm(gap))
        names = self.names + (self.ties.ties.names or [f"tie {r}" for r in range(len(missing))])
        gaps = np.concatenate([of_joint, norm(missing)])
        angles = np.concatenate([angle, np.zeros(len(missing))])
        return DisplacementResult(poses.x, poses.q, points, iterations, converged, names, gaps, angles, history)


def _limited(rotation: np.ndarray, most: float) -> np.ndarray:
    """Rotation vectors, none longer than ``most`` [rad]: small rotations add up, large ones do not (2.3)."""
    size = norm(rotation)
    return rotation * np.minimum(1.0, most / np.where(size > 0.0, size, 1.0))[:, None]


def displace(
    bodies: RigidBodies,
    parts: JointParts,
    joints: Sequence[Joint],
    x1: np.ndarray,
    q1: np.ndarray,
    options: DisplacementOptions,
    *,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    acting: np.ndarray | None = None,
    domains: Sequence[Domain] = (),
    ties: PointTies | None = None,
    points: np.ndarray | None = None,
    point_mass: np.ndarray | None = None,
) -> DisplacementResult:
    """Bring bodies from where free motion took them (x1, q1) onto their joints. For many steps, `Displacement`."""
    prepared = Displacement(
        bodies, parts, joints, options, acting=acting, domains=domains, ties=ties, point_mass=point_mass
    )
    return prepared.solve(x1, q1, points, start=start)
