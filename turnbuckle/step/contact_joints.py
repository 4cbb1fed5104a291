"""Joints in a step with contact: equality rows ``E v = wanted`` that close them exactly at the end of the step.

Directions of forces are those half way between the poses at both ends of the step, gaps are measured at its end: for a
tentative motion v the rows ask for ``E v - gap / h``; the motion that answers asks anew, until every gap is closed
(linear, by about h |w| / 2 a look). So nothing drifts, both bodies of a joint get opposite forces at one point, and
energy is never gained.

* Limits act as rows where they would be passed, and are let go where their impulse would pull (an active set).
* Soft parts push with ``f = k d + c ds/dt`` of the end of the step while they are left, and never pull; of ``lo = hi`` they
  are springs. They enter A with ``h c + h^2 k``: stable at any stiffness.
* A motor is a row with a bounded impulse; beyond its bound it is a load. Against a limit that is reached it rests.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from turnbuckle.compute import host
from turnbuckle.constraints.joints.modes import limits_of_motors, row_modes
from turnbuckle.data import rigid
from turnbuckle.data.articulated import AT, EQUAL, LIMIT, MOTOR, NONE, SOFT
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import DYNAMIC, FREE, ROWS
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import matrices
from turnbuckle.step.contact_joint_looks import Look, aligned, look_up
from turnbuckle.step.contact_joint_rows import JointGeometry, PartRows, middle, unwound

CLOSED = 1e-12  # [m or rad] what a row may be left with; round-off of large coordinates is added
AT_LIMIT = 1e-9  # [m or rad] this near to a limit at the start, a row begins as active
SLIGHT = 1e-12  # of the diagonal: what keeps rows that repeat each other solvable
CHANGES = 4  # of a row's activity in a step before it stays on
UNBOUND = 1e299  # [N or N m]


@dataclass
class Asked:
    """What joints ask of the velocities of blocks, linearised about a tentative motion."""

    e: sp.csr_array  # (k, 3 n)
    wanted: np.ndarray  # (k,) [m/s or rad/s]
    stiff: sp.csr_array | None  # (3 n, 3 n), to be added to A [kg]
    load: np.ndarray | None  # (3 n,) [N s], to be added to the load


class ContactJoints:
    """The joints of one state, in blocks of velocity: points first, then v and w of each body, the world first."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.points = model.points
        self.blocks = model.points + 2 * model.rigid.count
        self._layout: tuple = ()
        self.impulse = np.zeros(0)
        self.follow()

    @property
    def exists(self) -> bool:
        """Whether any joint acts."""
        return bool(self.on.any())

    def follow(self) -> None:
        """Catch up with joints that were added, removed, switched or broken."""
        joints = self.state.joints
        acting = [name for name, joint in joints.items() if joint.acting]
        layout = (id(self.state.parts), self.state.parts.count, tuple(acting))
        if layout == self._layout:
            return
        self._layout = layout
        parts = self.state.parts
        self.on = np.zeros(parts.count, dtype=bool)
        for name in acting:
            self.on[joints[name].parts] = True
        moves = self.model.rigid.motion == DYNAMIC
        self.on &= moves[parts.a] | moves[parts.b]
        _, self.modes = row_modes(parts)
        self.limit_of = limits_of_motors(parts, self.modes)
        straight = (parts.kind == rigid.ANGLE) & (self.modes[:, 1] == EQUAL)
        self.geometry = JointGeometry(parts, straight)
        self.modes[~self.on] = NONE
        self.twist = np.isin(parts.kind, (rigid.TWIST, rigid.MOTOR_TWIST))
        self.impulse = np.zeros(parts.count * ROWS)
        self.looks = self.geometry.looked_up[self.on[self.geometry.looked_up]]

    # A step --------------------------------------------------------------------------------------------------------

    def begin(self, h: float) -> None:
        """From the state, a step of ``h`` [s]."""
        self.h = h
        self.x0, self.q0 = np.array(host(self.state.rigid.x)), np.array(host(self.state.rigid.q))
        self.rows0 = self.geometry.rows(self.x0, self.q0)
        parts = self.state.parts
        s0 = self.rows0.s
        lo, hi = parts.lo[:, None], parts.hi[:, None]
        one, turn = self.twist[:, None], 2.0 * np.pi
        for more in (-turn, turn):  # a twist near its ends, a turn more or less where that is nearer to its limits
            s0 = np.where(
                one & (np.abs(_outside(s0 + more, lo, hi)) < np.abs(_outside(s0, lo, hi)) - 1e-9), s0 + more, s0
            )
        self.s0 = s0
        self.look0 = look_up(self.state, self.looks, self.geometry.local(self.x0, self.q0))
        self.modes[self.looks] = NONE  # until the first look
        self.active = np.zeros((parts.count, ROWS), dtype=np.int8)
        limit = self.modes == LIMIT
        self.active[limit & (s0 <= lo + AT_LIMIT)] = 1
        self.active[limit & (s0 >= hi - AT_LIMIT)] = -1
        self.changes = np.zeros((parts.count, ROWS), dtype=np.int8)
        self.push = np.zeros((parts.count, ROWS))  # of motors that are loads [N s]
        self.rate = self._rates()

    def _rates(self) -> np.ndarray:
        """Mean rates that motors drive with in this step (p,); a place is approached exponentially."""
        parts = self.state.parts
        slow = parts.time_constant > 0.0
        left = parts.target - self.s0[:, 0]
        left = np.where(self.twist, unwound(left, np.zeros(len(left))), left)
        tau = np.where(slow, parts.time_constant, 1.0)
        return np.where(slow, left * (1.0 - np.exp(-self.h / tau)) / self.h, parts.target)

    def _at(self, x1: np.ndarray, q1: np.ndarray) -> tuple[PartRows, PartRows, np.ndarray]:
        """Rows half way, those at the end, and places half way. Coordinates at the end go on from those at the start."""
        xm, qm = middle(self.x0, self.q0, x1, q1)
        mid, end = self.geometry.rows(xm, qm), self.geometry.rows(x1, q1)
        end.s = np.where(self.twist[:, None], unwound(end.s, self.s0), end.s)
        rolling, slip = self.geometry.slip(mid, self.x0, self.q0, x1, q1)
        end.s[rolling, 1:] = slip
        if len(self.looks):
            self._look(mid, end, qm, x1, q1)
        return mid, end, xm

    def _look(self, mid: PartRows, end: PartRows, qm: np.ndarray, x1: np.ndarray, q1: np.ndarray) -> None:
        """Rows of curves, surfaces and domains of the user: what is held where the point is at the end."""
        p = self.geometry.local(x1, q1)
        now: Look = look_up(self.state, self.looks, p)
        i = self.looks
        end.s[i] = np.einsum("ikd,id->ik", now.directions, p[i] - now.point)
        held = np.arange(ROWS) < now.count[:, None]
        self.modes[i] = np.where(held, np.where(now.one_sided, int(LIMIT), int(EQUAL)), int(NONE))
        along = 0.5 * (now.directions + aligned(self.look0, now))
        size = np.linalg.norm(along, axis=2, keepdims=True)
        along = np.where(size > 0.5, along / np.maximum(size, 0.5), now.directions)
        mid.force[i] = self.geometry.to_world(along, qm, i)

    def _gaps(self, s: np.ndarray) -> np.ndarray:
        """What rows miss by (p, ROWS) [m or rad]; of limits that of the side which is active."""
        parts = self.state.parts
        lo, hi = parts.lo[:, None], parts.hi[:, None]
        looked = np.zeros((parts.count, 1), dtype=bool)
        looked[self.looks] = True
        gap = np.where(self.modes == EQUAL, s, 0.0)
        at = s - lo
        at = np.where(self.twist[:, None], unwound(at, np.zeros_like(at)), at)
        gap = np.where(self.modes == AT, at, gap)
        side = np.where(self.active > 0, s - np.where(looked, 0.0, lo), s - hi)
        gap = np.where((self.modes == LIMIT) & (self.active != 0), side, gap)
        way = s - self.s0
        way = np.where(self.twist[:, None], unwound(way, np.zeros_like(way)), way)
        return np.where(self.modes == MOTOR, way - self.h * self.rate[:, None], gap)

    def _held(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of E as (part, k)."""
        held = (self.modes == EQUAL) | (self.modes == AT) | ((self.modes == LIMIT) & (self.active != 0))
        held |= (self.modes == MOTOR) & (self.active == 0)
        return np.nonzero(held)

    def ask(self, v: np.ndarray, v0: np.ndarray, x1: np.ndarray, q1: np.ndarray) -> Asked:
        """Rows about the motion ``v`` (blocks, 3), which leads to poses ``x1``, ``q1``; it starts with ``v0``."""
        h, g = self.h, self.geometry
        mid, end, xm = self._at(x1, q1)
        part, k = self._held()
        e = g.jacobian(mid, xm, part, k, self.points, self.blocks)
        wanted = e @ v.ravel() - self._gaps(end.s)[part, k] / h
        stiff = load = None
        part, k = np.nonzero((self.modes == SOFT) & (self.active != 0))
        if len(part):
            parts = self.state.parts
            j = g.jacobian(mid, xm, part, k, self.points, self.blocks)
            spring = h * parts.stiffness[part]
            weight = h * (spring + parts.damping[part])
            gap = self._beyond(end.s)[part, k] - h * (j @ v.ravel())
            stiff = (j.T @ sp.diags_array(weight) @ j).tocsr()
            load = -(j.T @ (spring * gap + weight * (j @ v0.ravel())))
        part, k = np.nonzero((self.modes == MOTOR) & (self.active != 0))
        if len(part):
            j = g.jacobian(mid, xm, part, k, self.points, self.blocks)
            load = (0.0 if load is None else load) + j.T @ self.push[part, k]
        return Asked(e, wanted, stiff, load)

    def _beyond(self, s: np.ndarray) -> np.ndarray:
        """Of soft rows that act, the signed distance beyond the side which they are at [m or rad]."""
        parts = self.state.parts
        return s - np.where(self.active > 0, parts.lo[:, None], parts.hi[:, None])

    def settle(self, impulse: np.ndarray, v: np.ndarray, x1: np.ndarray, q1: np.ndarray) -> tuple[float, bool]:
        """What the rows that acted still miss by [m or rad], and whether others should act now.

        ``impulse`` (k,) of the rows of the last `ask` [N s], ``v`` (blocks, 3) the motion that answered it.
        """
        part, k = self._held()
        total = np.zeros((self.state.parts.count, ROWS))
        total[part, k] = impulse
        mid, end, xm = self._at(x1, q1)
        self.last, self.middle_x, self.middle_q = mid, *middle(self.x0, self.q0, x1, q1)
        worst = float(np.abs(self._gaps(end.s)[part, k]).max(initial=0.0))
        before, push = self.active.copy(), self.push.copy()
        self._revise_limits(total, end.s)
        self._revise_soft(mid, end.s, xm, v, total)
        self._revise_motors(total, end.s)
        changed = self.active != before
        self.changes += changed
        self.impulse = total.ravel()
        return worst, bool(changed.any() or (self.push != push).any())

    def missed(self, x1: np.ndarray, q1: np.ndarray) -> float:
        """The largest gap of the rows that act, for bodies that end at ``x1``, ``q1`` [m or rad]."""
        _, end, _ = self._at(x1, q1)
        part, k = self._held()
        return float(np.abs(self._gaps(end.s)[part, k]).max(initial=0.0))

    def _revise_limits(self, impulse: np.ndarray, s: np.ndarray) -> None:
        parts = self.state.parts
        limit = self.modes == LIMIT
        lo, hi = np.repeat(parts.lo[:, None], ROWS, axis=1), np.repeat(parts.hi[:, None], ROWS, axis=1)
        lo[self.looks], hi[self.looks] = 0.0, FREE
        idle = limit & (self.active == 0)
        pulls = limit & (impulse * self.active < 0.0) & (self.changes < CHANGES)
        self.active[idle & (s < lo - CLOSED)] = 1
        self.active[idle & (s > hi + CLOSED)] = -1
        self.active[pulls] = 0
        self.active[self.modes == NONE] = 0

    def _revise_soft(self, mid: PartRows, s: np.ndarray, xm: np.ndarray, v: np.ndarray, total: np.ndarray) -> None:
        """f = max(0, k d + c ds/dt) to either side, where the coordinate is beyond it at an end of the step."""
        part, k = np.nonzero(self.modes == SOFT)
        if not len(part):
            return
        parts, h = self.state.parts, self.h
        rate = self.geometry.jacobian(mid, xm, part, k, self.points, self.blocks) @ v.ravel()
        s1, s0, lo, hi = s[part, k], self.s0[part, k], parts.lo[part], parts.hi[part]
        stiffness, damping = parts.stiffness[part], parts.damping[part]
        below, above = -(stiffness * (s1 - lo) + damping * rate), stiffness * (s1 - hi) + damping * rate
        wanted = np.where((below > 0.0) & ((s1 < lo) | (s0 < lo)), 1, 0)
        wanted = np.where((above > 0.0) & ((s1 > hi) | (s0 > hi)), -1, wanted)
        wanted = np.where(lo == hi, 1, wanted)
        wanted = np.where(self.changes[part, k] >= CHANGES, self.active[part, k], wanted)
        self.active[part, k] = wanted
        total[part, k] = h * np.where(wanted > 0, below, np.where(wanted < 0, -above, 0.0))

    def project(self, v: np.ndarray, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Velocities ``v`` (blocks, 3) put on the strict rows of joints at ``x``, ``q``, the end of the step.

        Those of the step are means over it, and lead out of joints that turn by about h |w| / 2. The shortest way in the
        metric of masses: momentum stays, energy never grows. Limits and motors are left to the step.
        """
        part, k = np.nonzero((self.modes == EQUAL) | (self.modes == AT))
        if not self.exists or not len(part):
            return v
        end = self.geometry.rows(x, q)
        if len(self.looks):
            now = look_up(self.state, self.looks, self.geometry.local(x, q))
            end.force[self.looks] = self.geometry.to_world(now.directions, q, self.looks)
        e = self.geometry.jacobian(end, x, part, k, 0, 2 * len(x))
        bodies = self.model.rigid
        moves = bodies.motion == DYNAMIC
        inverse = np.zeros((2 * len(x), 3, 3))
        inverse[::2][moves] = np.eye(3) / bodies.mass[moves, None, None]
        turn = matrices(q[moves])
        inverse[1::2][moves] = np.einsum("bij,bj,bkj->bik", turn, 1.0 / bodies.inertia[moves], turn)
        w = sp.bsr_array((inverse, np.arange(2 * len(x)), np.arange(2 * len(x) + 1))).tocsr()
        across = (w @ e.T).tocsc()
        s = (e @ across).tocsc()
        s = (s + sp.diags_array(SLIGHT * s.diagonal() + 1e-300)).tocsc()
        factor = spla.splu(s, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        own = v[self.points :].ravel()
        for _ in range(2):
            own = own - across @ factor.solve(e @ own)
        return np.concatenate([v[: self.points], own.reshape(-1, 3)])

    def elastic_energy(self) -> float:
        """Energy in soft rows at the state [J]."""
        soft = (self.modes == SOFT).any(axis=1)
        if not soft.any():
            return 0.0
        parts = self.state.parts
        s = self.geometry.rows(host(self.state.rigid.x), host(self.state.rigid.q)).s
        s = np.where(self.twist[:, None], unwound(s, self.s0), s) if hasattr(self, "s0") else s
        beyond = np.where(self.modes == SOFT, _outside(s, parts.lo[:, None], parts.hi[:, None]), 0.0)
        return float(0.5 * parts.stiffness @ (beyond * beyond).sum(axis=1))

    def _revise_motors(self, impulse: np.ndarray, s: np.ndarray) -> None:
        part = np.flatnonzero(self.modes[:, 0] == MOTOR)
        if not len(part):
            return
        most = self.h * self.state.parts.max_force[part]
        free = most >= UNBOUND * self.h
        most = np.where(free, 0.0, most)
        active, l = self.active[part, 0].astype(int), impulse[part, 0]  # noqa: E741
        gap = self._gaps(s)[part, 0]
        wanted = np.where((active == 0) & ~free & (np.abs(l) > most), np.sign(l), active).astype(int)
        faster = (active != 0) & (gap * active > CLOSED) & (self.changes[part, 0] < CHANGES)
        wanted = np.where(faster, 0, wanted)
        limit = self.limit_of[part]
        side = np.where(limit >= 0, self.active.ravel()[limit], 0)
        against = (side != 0) & (self.rate[part] * side <= 0.0)
        wanted = np.where(against, -side, np.where(free, 0, wanted))
        self.active[part, 0] = wanted
        self.push[part, 0] = most * wanted
        impulse[part, 0] = np.where(wanted != 0, self.push[part, 0], l)


def _outside(s: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """How far outside of [lo, hi], signed."""
    return np.maximum(s - hi, 0.0) + np.minimum(s - lo, 0.0)
