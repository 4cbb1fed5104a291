"""Reactions of joints at the committed state.

The accelerations ``a = M^-1 (f + J^T lambda)`` keep the rates of all rows as they are: ``J a + (dJ/dt) v = 0``. Directions
come from the last velocity projection; ``(dJ/dt) v`` is a central difference of J v along the motion.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
import warp as wp

from turnbuckle.data import rigid
from turnbuckle.data.articulated import LIMIT, MOTOR, NONE, SOFT
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import FREE, ROWS, RigidState
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import conjugate, exponential, multiply, rotate
from turnbuckle.integrators.rigid_points import row_directions
from turnbuckle.step.coordinates import coordinates

DIFFERENCE = 1e-4  # [rad or relative] along the motion
DENSE = 1200  # rows up to which a least-norm solution is computed densely


def reactions(model: Model, state: State, articulated: Any) -> tuple[np.ndarray, np.ndarray]:
    """Forces on body1 [N], and torques about the joint's place [N m], of all parts, (parts, 3) each, world axes."""
    n = state.parts.count
    articulated.update_windows(max(state.dt, 1e-9))  # joints that act from now on
    if articulated.system.joint_parts != n:
        articulated.follow()  # joints were added or removed since the last step
    system = articulated.system
    bodies = model.rigid
    now = {name: getattr(state.rigid, name).numpy().copy() for name in "xqvw"}
    line, t_a, t_b = _rows(system, state, now["x"], now["q"])
    speed = max(float(np.abs(now["v"]).max()), float(np.abs(now["w"]).max()), 1e-12)
    h = DIFFERENCE / speed
    ends = []
    for sign in (1.0, -1.0):
        x = now["x"] + sign * h * now["v"]
        q = multiply(exponential(sign * h * now["w"]), now["q"])
        ends.append(_rates(state, _rows(system, state, x, q), now["v"], now["w"]))
    bias = (ends[0] - ends[1]) / (2.0 * h)
    rate = _rates(state, (line, t_a, t_b), now["v"], now["w"])
    which = _acting(state, system, now, rate)
    articulated.loads(state.rigid, state.time)
    free = _free_accelerations(model, state, now)
    multipliers = np.zeros(ROWS * n)
    rows = np.flatnonzero(which)
    jacobian = _jacobian(state, line, t_a, t_b, rows, bodies.count)
    moves = np.repeat(bodies.motion == rigid.DYNAMIC, 6)
    inverse = _inverse_masses(model, now["q"])
    free[bodies.motion == rigid.DYNAMIC] += (inverse @ _tied(state, articulated, now["q"]).ravel()).reshape(-1, 6)[
        bodies.motion == rigid.DYNAMIC
    ]
    s = (jacobian[:, moves] @ inverse[moves][:, moves] @ jacobian[:, moves].T).tocsr()
    right = -(bias[rows] + jacobian @ free.ravel())
    multipliers[rows] = _least(s, right)
    given = _known(state, system, now, rate)
    multipliers += given
    if given.any():  # what soft rows and motors push changes what the others must hold
        push = _jacobian(state, line, t_a, t_b, np.arange(ROWS * n), bodies.count).T @ given
        extra = -(jacobian[:, moves] @ (inverse[moves][:, moves] @ push[moves]))
        multipliers[rows] += _least(s, extra)
    force = (multipliers[:, None] * line).reshape(n, ROWS, 3).sum(axis=1)
    turn = (multipliers[:, None] * t_a).reshape(n, ROWS, 3).sum(axis=1)
    arm = rotate(now["q"][state.parts.a], state.parts.p_a)
    return force, turn - np.cross(arm, force)


def _rows(system: Any, state: State, x: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions of all rows of joints for given poses, (rows, 3) each."""
    n = ROWS * state.parts.count
    there = RigidState.at_rest(len(x), system.device)
    there.x.assign(x)
    there.q.assign(q)
    bodies = system.bodies(there, there, there)
    nothing = wp.zeros(1, dtype=wp.vec3d, device=system.device)
    points = system.tied_points(nothing, nothing, nothing)
    table = system.row_table
    kept = [wp.clone(a) for a in (table.line, table.t_a, table.t_b, table.s)]
    wp.launch(row_directions, state.parts.count, inputs=[0, bodies, points, system.parts, table], device=system.device)
    out = tuple(a.numpy()[:n].copy() for a in (table.line, table.t_a, table.t_b))
    for array, old in zip((table.line, table.t_a, table.t_b, table.s), kept, strict=True):
        wp.copy(array, old)
    return out  # type: ignore[return-value]


def _rates(state: State, rows: tuple[np.ndarray, ...], v: np.ndarray, w: np.ndarray) -> np.ndarray:
    line, t_a, t_b = rows
    a, b = np.repeat(state.parts.a, ROWS), np.repeat(state.parts.b, ROWS)
    return np.sum(line * (v[a] - v[b]) + t_a * w[a] - t_b * w[b], axis=1)


def _acting(state: State, system: Any, now: dict[str, np.ndarray], rate: np.ndarray) -> np.ndarray:
    """Rows that hold: equalities, and limits that are reached and pressed."""
    n = state.parts.count
    mode = system.row_table.mode.numpy()[: ROWS * n]
    used = (np.arange(ROWS)[None] < system.rows[:n, None]).ravel()
    on = np.repeat(system.switches(state), ROWS) > 0
    pressed = system.row_table.active.numpy()[: ROWS * n] != 0
    motor = (mode == MOTOR) & (system.row_table.active.numpy()[: ROWS * n] == 0)
    return (
        used
        & on
        & (((mode != NONE) & (mode != LIMIT) & (mode != SOFT) & (mode != MOTOR)) | ((mode == LIMIT) & pressed) | motor)
    )


def _known(state: State, system: Any, now: dict[str, np.ndarray], rate: np.ndarray) -> np.ndarray:
    """Forces of soft rows and of motors at their limit, (rows,)."""
    n = state.parts.count
    out = np.zeros(ROWS * n)
    mode = system.row_table.mode.numpy()[: ROWS * n].reshape(n, ROWS)
    on = system.switches(state) > 0
    soft = np.flatnonzero((mode == SOFT).any(axis=1) & on)
    if len(soft):
        row = ROWS * soft + np.argmax(mode[soft] == SOFT, axis=1)
        s = coordinates(state.parts, soft, now["x"], now["q"])
        off = np.maximum(s - state.parts.hi[soft], 0.0) + np.minimum(s - state.parts.lo[soft], 0.0)
        outside = (off != 0.0) | (state.parts.lo[soft] == state.parts.hi[soft])
        out[row] = -state.parts.stiffness[soft] * off - np.where(outside, state.parts.damping[soft] * rate[row], 0.0)
    active = system.row_table.active.numpy()[: ROWS * n].reshape(n, ROWS)
    motor = np.flatnonzero((mode[:, 0] == MOTOR) & on & (active[:, 0] != 0))
    limited = state.parts.max_force[motor] < FREE  # one without limit rests against its stop
    out[ROWS * motor] = np.where(limited, active[motor, 0] * np.minimum(state.parts.max_force[motor], FREE), 0.0)
    return out


def _jacobian(
    state: State, line: np.ndarray, t_a: np.ndarray, t_b: np.ndarray, rows: np.ndarray, bodies: int
) -> sp.csr_array:
    part = rows // ROWS
    columns = np.concatenate(
        [6 * state.parts.a[part][:, None] + np.arange(6), 6 * state.parts.b[part][:, None] + np.arange(6)], axis=1
    )
    values = np.concatenate([line[rows], t_a[rows], -line[rows], -t_b[rows]], axis=1)
    index = np.repeat(np.arange(len(rows)), 12)
    return sp.csr_array((values.ravel(), (index, columns.ravel())), shape=(len(rows), 6 * bodies))


def _inverse_masses(model: Model, q: np.ndarray) -> sp.csr_array:
    n = model.rigid.count
    blocks = np.zeros((n, 6, 6))
    axes = np.stack([rotate(q, np.tile(e, (n, 1))) for e in np.eye(3)], axis=2)
    blocks[:, :3, :3] = np.eye(3) / model.rigid.mass[:, None, None]
    blocks[:, 3:, 3:] = axes @ (axes.transpose(0, 2, 1) / model.rigid.inertia[:, :, None])
    return sp.block_diag(list(blocks), format="csr")


def _free_accelerations(model: Model, state: State, now: dict[str, np.ndarray]) -> np.ndarray:
    """Accelerations (n, 6) without joints; those of scripted bodies by differences of their rates."""
    b, w, q = model.rigid, now["w"], now["q"]
    force, torque = state.rigid.force.numpy(), state.rigid.torque.numpy()
    out = np.zeros((b.count, 6))
    out[:, :3] = state.gravity + force / b.mass[:, None] - b.damping[:, :1] * now["v"]
    spin = rotate(q, b.inertia * rotate(conjugate(q), w))
    turn = torque - np.cross(w, spin) - b.damping[:, 1:] * spin
    out[:, 3:] = rotate(q, rotate(conjugate(q), turn) / b.inertia)
    out[b.motion != rigid.DYNAMIC] = 0.0
    for body, trajectory in b.trajectories.items():
        h = 1e-3
        rates = [trajectory.rates(state.time + k * h) for k in (-1, 1)]  # type: ignore[attr-defined]
        (v0, w0), (v1, w1) = rates
        origin, _ = trajectory.pose(state.time)  # type: ignore[attr-defined]
        arm, spin_rate = now["x"][body] - origin, (w1 - w0) / (2.0 * h)
        out[body, 3:] = spin_rate
        out[body, :3] = (v1 - v0) / (2.0 * h) + np.cross(spin_rate, arm) + np.cross(w[body], np.cross(w[body], arm))
    return out


def _tied(state: State, articulated: Any, q: np.ndarray) -> np.ndarray:
    """What point constraints pushed the bodies with in the last step, forces and torques (bodies, 6)."""
    system = articulated.system
    out = np.zeros((len(q), 6))
    if len(system.ties.target) == 0 or state.dt <= 0.0 or articulated.displacement is not None:
        return out
    weights = system.ties.weights.tocsr()
    weights.sort_indices()
    of = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    force = weights.data[:, None] * articulated.tie_forces(state.dt)[of]
    own = system.entries.body >= 0
    body = system.entries.body[own]
    np.add.at(out[:, :3], body, force[own])
    np.add.at(out[:, 3:], body, np.cross(rotate(q[body], system.entries.local[own]), force[own]))
    return out


def _least(s: sp.csr_array, right: np.ndarray) -> np.ndarray:
    """A solution of ``s y = right``, the least where there are many."""
    if s.shape[0] == 0:
        return right
    if s.shape[0] <= DENSE:
        return np.linalg.lstsq(s.toarray(), right, rcond=1e-11)[0]
    try:
        y = spla.splu(s.tocsc()).solve(right)
        if np.isfinite(y).all() and np.abs(s @ y - right).max() <= 1e-8 * max(np.abs(right).max(), 1.0):
            return y
    except RuntimeError:
        pass
    return spla.lsqr(s, right, atol=1e-14, btol=1e-14, iter_lim=20000)[0]
