"""The device side of rigid bodies and joints: structs of arrays, islands, and the plan of the sparse factor."""

from dataclasses import fields

import numpy as np
import scipy.sparse as sp
import warp as wp

from turnbuckle.constraints import rows as constraint_rows
from turnbuckle.constraints.joints.modes import limits_of_motors, row_modes
from turnbuckle.data import rigid
from turnbuckle.data.articulated import EQUAL, NONE, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import FREE, ROWS, JointParts, RigidState
from turnbuckle.data.rows import Rows
from turnbuckle.data.state import State
from turnbuckle.data.tables import TIED
from turnbuckle.linalg.block_ldl import make_plan
from turnbuckle.linalg.block_ldl import upload as upload_matrix
from turnbuckle.linalg.elimination import eliminate


class System:
    """All arrays of one layout of joints and ties. What evolves in it is `rows.impulse1` and `rows.active`."""

    def __init__(self, model: Model, state: State) -> None:
        self.device = model.device
        bodies = model.rigid
        self.ties = constraint_rows.collect(state, max(state.dt, 1e-3), TIED)
        weights = self.ties.weights.tocsr()
        weights.sort_indices()
        self.joint_parts = state.parts.count
        self.parts_total = self.joint_parts + len(self.ties.target)
        entries = _tie_entries(model, weights)
        self.entries = entries
        dynamic = np.flatnonzero(bodies.motion == rigid.DYNAMIC)
        node_of_body = np.full(bodies.count, -1)
        node_of_body[dynamic] = np.arange(len(dynamic))
        tied = np.unique(entries.point[entries.body < 0])
        self.tied = tied
        self.node_of_entry = np.where(
            entries.body >= 0, node_of_body[entries.body], len(dynamic) + np.searchsorted(tied, entries.point)
        )
        movable = len(dynamic) + len(tied)
        near = [_present(node_of_body[[a, b]]) for a, b in zip(state.parts.a, state.parts.b, strict=True)]
        near += [
            _present(self.node_of_entry[lo:hi]) for lo, hi in zip(weights.indptr[:-1], weights.indptr[1:], strict=True)
        ]
        joint_rows, modes = row_modes(state.parts)
        self.rows = np.r_[joint_rows, np.full(len(self.ties.target), 3)].astype(np.int32)
        elimination = eliminate(movable, near)
        sizes = np.r_[np.full(len(dynamic), 6), np.full(len(tied), 3), self.rows]
        self.plan = make_plan(elimination, sizes)
        self.matrix = upload_matrix(self.plan, self.device)
        self.dynamic, self.node_of_body, self.movable = dynamic, node_of_body, movable
        self._make_islands(model, near)
        self.parts = self._make_parts(state, weights, modes)
        self.row_table = self._make_rows(state, modes)
        self.points_mass = wp.array(model.mass[tied] if len(tied) else np.ones(1), dtype=wp.float64, device=self.device)
        self.constant_bodies = self._constant(model)
        self.scratch = {
            name: wp.zeros(bodies.count, dtype=wp.vec3d, device=self.device)
            for name in ("v_free", "l_free", "momentum", "push", "turn")
        }
        n = max(len(tied), 1)
        self.tied_index = self._put(tied if len(tied) else np.zeros(1), wp.int32)
        self.x_free, self.tied_push, self.tied_blow = (
            wp.zeros(n, dtype=wp.vec3d, device=self.device) for _ in range(3)
        )
        self.slaves = self._make_slaves(model)
        touched = outside_contact(model, state, self)
        inside = ~touched[self.island_of[: len(dynamic)]] & (bodies.damping[dynamic] == 0.0).all(axis=1)
        self.internal_bodies = dynamic[inside]  # that nothing outside holds

    def _put(self, values: np.ndarray, kind: object) -> wp.array:
        values = np.ascontiguousarray(values)
        if len(values) == 0:
            values = np.zeros((1, *values.shape[1:]))
        return wp.array(values, dtype=kind, device=self.device)

    def _make_islands(self, model: Model, near: list[np.ndarray]) -> None:
        """Islands as eliminated."""
        order, number = self.plan.elimination.island, self.plan.elimination.number
        island_of = np.searchsorted(order, number, side="right") - 1
        count = len(order) - 1
        nd = len(self.dynamic)
        bodies, points, parts = np.arange(nd), np.arange(len(self.tied)), np.arange(len(near))
        islands = Islands()
        islands.node = self._put(order, wp.int32)
        for name, nodes, shown in (
            ("body", bodies, self.dynamic),
            ("point", nd + points, points),
            ("part", self.movable + parts, parts),
        ):
            of = island_of[nodes]
            by = np.argsort(of, kind="stable")
            setattr(islands, f"{name}_start", self._put(np.searchsorted(of[by], np.arange(count + 1)), wp.int32))
            setattr(islands, name, self._put(shown[by], wp.int32))
            if name != "part":
                setattr(islands, f"{name}_node", self._put(number[nodes[by]], wp.int32))
        nodes = np.zeros(model.rigid.count, dtype=np.int64)
        nodes[self.dynamic] = number[:nd]
        islands.node_of = self._put(nodes, wp.int32)
        islands.iterations = wp.zeros(max(count, 1), dtype=wp.int32, device=self.device)
        islands.worst = wp.zeros(max(count, 1), dtype=wp.float64, device=self.device)
        islands.angle = wp.zeros(max(count, 1), dtype=wp.float64, device=self.device)
        islands.warm = wp.zeros(1, dtype=wp.float64, device=self.device)
        islands.paper = int(model.rigid_motion == "paper")
        self.islands, self.island_count, self.island_of = islands, count, island_of

    def _make_parts(self, state: State, weights: sp.csr_array, modes: np.ndarray) -> Parts:
        given, n = state.parts, self.parts_total
        extra = n - given.count
        number = self.plan.elimination.number
        p = Parts()
        kinds = {"kind": wp.int32, "a": wp.int32, "b": wp.int32, "p_a": wp.vec3d, "p_b": wp.vec3d, "q_a": wp.quatd,
                 "q_b": wp.quatd}  # fmt: skip
        fill = {"kind": rigid.TIE, "lo": -FREE, "hi": FREE, "max_force": FREE}
        for f in fields(JointParts):
            if f.name in ("joint", "domain"):
                continue
            old = getattr(given, f.name)
            tail = np.full((extra, *old.shape[1:]), fill.get(f.name, 0), dtype=old.dtype)
            setattr(p, f.name, self._put(np.concatenate([old, tail]), kinds.get(f.name, wp.float64)))
        p.rows = self._put(self.rows, wp.int32)
        p.on = self._put(np.r_[self.switches(state), np.ones(extra)], wp.int32)
        self.acting = wp.clone(p.on)  # what is measured; `on` is what the kernels close
        partner = np.full(n, -1)
        partner[: given.count] = limits_of_motors(given, modes)
        p.partner = self._put(partner, wp.int32)
        p.normal = wp.zeros(max(3 * n, 1), dtype=wp.vec3d, device=self.device)
        p.normal0 = wp.zeros(max(3 * n, 1), dtype=wp.vec3d, device=self.device)
        p.node = self._put(number[self.movable :], wp.int32)
        for side in "ab":
            nodes = np.r_[self.node_of_body[getattr(given, side)], np.full(extra, -1)].astype(np.int64)
            place, above = self._places(np.arange(n), nodes)
            setattr(p, f"place_{side}", self._put(place, wp.int32))
            setattr(p, f"above_{side}", self._put(above, wp.int32))
        starts = np.r_[np.zeros(given.count, dtype=np.int64), weights.indptr]
        p.tie = self._put(starts, wp.int32)
        e = self.entries
        p.tie_body = self._put(e.body, wp.int32)
        p.tie_point = self._put(np.where(e.body < 0, np.searchsorted(self.tied, e.point), 0), wp.int32)
        p.tie_local = self._put(e.local, wp.vec3d)
        p.tie_weight = self._put(weights.data, wp.float64)
        of = given.count + np.repeat(np.arange(extra), np.diff(weights.indptr))
        place, above = self._places(of, self.node_of_entry)
        p.tie_place = self._put(place, wp.int32)
        p.tie_above = self._put(above, wp.int32)
        p.goal = wp.zeros(max(n, 1), dtype=wp.vec3d, device=self.device)
        p.goal_rate = wp.zeros(max(n, 1), dtype=wp.vec3d, device=self.device)
        self.aim(p, self.ties)
        return p

    def aim(self, parts: Parts, ties: Rows) -> None:
        """Goals of ties."""
        for array, values in ((parts.goal, ties.target), (parts.goal_rate, ties.rate)):
            whole = np.zeros((array.shape[0], 3))
            whole[self.joint_parts : self.joint_parts + len(values)] = values
            array.assign(whole)

    def _places(self, part: np.ndarray, node: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the blocks of (part, node) start, -1 where the node does not move, and whether they lie as (node, part)."""
        number, plan = self.plan.elimination.number, self.plan
        place, above = np.full(len(part), -1), np.zeros(len(part), dtype=np.int64)
        use = node >= 0
        i, j = number[self.movable + part[use]], number[node[use]]
        low, high = np.minimum(i, j), np.maximum(i, j)
        n = len(number)
        keys = np.repeat(np.arange(n), np.diff(plan.column)) * n + plan.row
        place[use] = plan.block[np.searchsorted(keys, low * n + high)]
        above[use] = j > i  # stored in the column of the part, as (node, part)
        return place, above

    def switches(self, state: State) -> np.ndarray:
        """Which parts act, (parts,) int."""
        on = np.zeros(state.parts.count, dtype=np.int64)
        for joint in state.joints.values():
            if joint.acting:
                on[joint.parts] = 1
        return on

    def _make_rows(self, state: State, modes: np.ndarray) -> RowTable:
        n = max(ROWS * self.parts_total, 1)
        table = RowTable()
        whole = np.full((self.parts_total, ROWS), int(EQUAL), dtype=np.int32)
        whole[: len(modes)] = modes
        table.mode = self._put(whole.ravel() if n > 1 else np.full(1, int(NONE)), wp.int32)
        table.changes = wp.zeros(n, dtype=wp.int32, device=self.device)
        for name in ("s", "s0", "rate0"):
            setattr(table, name, wp.zeros(n, dtype=wp.float64, device=self.device))
        for name in ("line", "at", "t_a", "t_b", "line0", "at0", "t0", "line_mid", "t_mid"):
            setattr(table, name, wp.zeros(n, dtype=wp.vec3d, device=self.device))
        keep = state.impulse.shape == (2, n)
        table.impulse, table.impulse1 = (
            self._put(state.impulse[k] if keep else np.zeros(n), wp.float64) for k in range(2)
        )
        active, dropped = unpack_active(state.active) if keep else (np.zeros(n), np.ones(n))
        table.active, table.dropped = self._put(active, wp.int32), self._put(dropped, wp.int32)
        return table

    def _constant(self, model: Model) -> dict[str, wp.array]:
        b = model.rigid
        free = (b.motion == rigid.DYNAMIC).astype(float)
        return {
            "dynamic": self._put(free, wp.int32),
            "mass": self._put(b.mass, wp.float64),
            "inverse_mass": self._put(free / b.mass, wp.float64),
            "inertia": self._put(b.inertia, wp.vec3d),
            "inverse_inertia": self._put(free[:, None] / b.inertia, wp.vec3d),
            "damping": self._put(b.damping, wp.vec2d),
        }

    def _make_slaves(self, model: Model) -> tuple[wp.array, wp.array, wp.array, int]:
        """Body, point and local place of all points of rigid bodies."""
        points = np.flatnonzero(model.body_of >= 0)
        return (
            self._put(model.body_of[points], wp.int32),
            self._put(points, wp.int32),
            self._put(local_places(model, points), wp.vec3d),
            len(points),
        )

    def bodies(self, now: RigidState, ahead: RigidState, loads: RigidState) -> Bodies:
        """The struct for a step from ``now`` to ``ahead`` with the forces of ``loads``."""
        b = Bodies()
        for name, array in {**self.constant_bodies, **self.scratch}.items():
            setattr(b, name, array)
        b.force, b.torque = loads.force, loads.torque
        for name in "xqvw":
            setattr(b, f"{name}0", getattr(now, name))
            setattr(b, f"{name}1", getattr(ahead, name))
        return b

    def tied_points(self, x: wp.array, v: wp.array, memory: wp.array, lags: bool = False) -> TiedPoints:
        """The struct for mass points at ``x``, ``v``; ``lags``: v lags by a step, ``memory`` is Verlet's w."""
        t = TiedPoints()
        t.point, t.mass, t.x_free, t.push = self.tied_index, self.points_mass, self.x_free, self.tied_push
        t.blow = self.tied_blow
        t.x, t.v, t.memory, t.lags = x, v, memory, int(lags)
        return t


def pack_active(active: np.ndarray, dropped: np.ndarray) -> np.ndarray:
    """Both columns of rows as one, for the state."""
    return active + 10 * dropped


def unpack_active(packed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``active`` (-1, 0, 1) and ``dropped`` (0, 1) of rows."""
    dropped = (packed + 1) // 10
    return packed - 10 * dropped, dropped


class _Entries:
    """Columns of all ties, one after the other."""

    def __init__(self, body: np.ndarray, point: np.ndarray, local: np.ndarray) -> None:
        self.body, self.point, self.local = body, point, local


def _tie_entries(model: Model, weights: sp.csr_array) -> _Entries:
    point = weights.indices.astype(np.int64)
    return _Entries(model.body_of[point], point, local_places(model, point))


def local_places(model: Model, points: np.ndarray) -> np.ndarray:
    """Places of points of rigid bodies in the inertial frames of their bodies (n, 3) [m]; 0 for mass points."""
    return model.rigid.local[points] if len(model.rigid.local) else np.zeros((len(points), 3))


def _present(nodes: np.ndarray) -> np.ndarray:
    return np.unique(nodes[nodes >= 0])


def outside_contact(model: Model, state: State, system: System) -> np.ndarray:
    """Which islands something that does not move touches (islands,) bool: their momentum may change."""
    touched = np.zeros(system.island_count, dtype=bool)
    still = model.rigid.motion != rigid.DYNAMIC
    parts = np.arange(system.joint_parts)
    held = still[state.parts.a] | still[state.parts.b]
    touched[system.island_of[system.movable + parts[held]]] = True
    touched[system.island_of[system.movable + system.joint_parts :]] = True
    return touched
