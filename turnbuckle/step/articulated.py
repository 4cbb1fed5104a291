"""Rigid bodies and joints in a step: what is recorded, what the host does around it, what is reported."""

import numpy as np
import warp as wp

from turnbuckle.compute import Program, host
from turnbuckle.constraints import rows as constraint_rows
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.rigid import DYNAMIC, ROWS, RigidState
from turnbuckle.data.state import H, State
from turnbuckle.data.tables import TIED
from turnbuckle.geometry.quaternions import conjugate, cross, rotate
from turnbuckle.integrators import SCHEMES
from turnbuckle.integrators.rigid_flight import close_positions
from turnbuckle.integrators.rigid_points import place_points, push_points, remember_points
from turnbuckle.integrators.rigid_projection import project_velocities
from turnbuckle.scene.build_rigid_bodies import inertial_pose
from turnbuckle.step.articulated_system import System, pack_active, unpack_active
from turnbuckle.step.displacement_stage import DisplacementStage
from turnbuckle.step.domain_search import DomainSearch
from turnbuckle.step.field_values import field_values
from turnbuckle.step.joint_certificate import JointCertificate
from turnbuckle.step.joint_messages import fast_joints, lost_joints, open_joints
from turnbuckle.step.rigid_measures import RigidMeasures
from turnbuckle.step.row_forces import write_row_forces

TOLERANCE = 1e-10  # [m, rad, m/s, rad/s]: what a joint may miss by in a step that is "ok"
LOST = 1e-4  # [m or rad]: joints that a step opens by more than this were lost, unless they were open before
GRAIN = 16  # points that a body is as much work as


class Articulated:
    """The stage of rigid bodies of one model and state."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.ahead = RigidState.at_rest(model.rigid.count, model.device)
        self._system: System | None = None  # made by `follow`
        self.exists = model.rigid.count > 1
        self._damped = bool(model.rigid.damping.any())
        self._were_loaded = True  # loads of the last step may still be on the device
        self.opened = np.inf  # what joints missed by after the last step [m or rad]
        self._halves = 1.0 if model.rigid_motion == "paper" else 2.0  # of a step in which the position impulses act

    def follow(self) -> None:
        """Catch up with joints or ties that were added, removed or switched, and with bodies that were put elsewhere."""
        self._stay()
        self._system = System(self.model, self.state)
        self.opened = np.inf
        self.certificate = JointCertificate(self.state, self.model.device)
        self.search = DomainSearch(self.state, self.system)
        self.measures = RigidMeasures(self.model, self.state, self.system)
        self.displacement = None
        if self.model.solver == "displacement":
            self.displacement = DisplacementStage(self.model, self.state, self.system)
            self._let_fly()
        self.moving_ties = any(
            g.acting and (g.moving or g.kind == "velocity") for g in self.state.groups.values()
        ) and bool(len(self.system.ties.target))

    @property
    def system(self) -> System:
        """The arrays of the layout that `follow` has last seen, made where there are none yet."""
        if self._system is None:
            self.follow()
        assert self._system is not None
        return self._system

    @property
    def _follows(self) -> bool:
        """Whether the arrays are those of the joints that there are now; else all follows before the next step."""
        return self._system is not None and self._system.joint_parts == self.state.parts.count

    def _stay(self) -> None:
        """What does not move is at the end of a step where it is at its start."""
        for name in "xqvw":
            getattr(self.ahead, name).assign(getattr(self.state.rigid, name))

    def _let_fly(self) -> None:
        """Under the displacement solver no part acts in the kernels."""
        self.system.parts.on.zero_()

    def drive(self) -> None:
        """Tell the device the targets of motors."""
        if self._follows:
            targets = self.system.parts.target.numpy()
            targets[: self.state.parts.count] = self.state.parts.target
            self.system.parts.target.assign(targets)
            if self.displacement is not None:
                self.displacement.prepare()

    # Around a step -------------------------------------------------------------------------------------------------

    def prepare(self, dt: float) -> None:
        """Scripted poses at the end of the step, goals of ties, where Newton's method starts."""
        state, system = self.state, self.system
        table = system.row_table
        self._before = [(a, host(a).copy()) for a in (table.impulse, table.impulse1, table.active, table.dropped)]
        warm = dt / state.dt if state.dt > 0.0 else 0.0
        _write(system.islands.warm, np.array([warm]))
        trajectories = self.model.rigid.trajectories
        if trajectories:
            self._script(state.time + dt)
        if self.moving_ties:
            goals = constraint_rows.collect(state, dt, TIED)
            system.aim(system.parts, goals)
            if self.displacement is not None:
                self.displacement.aim(goals.target)

    def _script(self, t: float) -> None:
        bodies, ahead = self.model.rigid, self.ahead
        arrays = {name: getattr(ahead, name).numpy() for name in "xqvw"}
        for b, trajectory in bodies.trajectories.items():
            origin, turn = trajectory.pose(t)  # type: ignore[attr-defined]
            rate, spin = trajectory.rates(t)  # type: ignore[attr-defined]
            x, arrays["q"][b] = inertial_pose(bodies, b, origin, turn)
            arrays["x"][b] = x
            arrays["w"][b] = spin
            arrays["v"][b] = rate + np.cross(spin, x - origin)
        for name, values in arrays.items():
            getattr(ahead, name).assign(values)

    def loads(self, at: RigidState, time: float) -> None:
        """All loads but gravity, written into ``at`` [N, N m]; raises FloatingPointError when one is not finite."""
        bodies, pushes = self.model.rigid, self.state.loads
        x, q, v, w = (host(getattr(at, name)) for name in "xqvw")
        force, torque = pushes.force.copy(), pushes.torque.copy()
        if pushes.at.any():
            torque += cross(rotate(q, pushes.at), pushes.force)
        for f in self.model.rigid_fields:
            b = f.bodies
            place, speed, arm = x[b], v[b], None
            if f.at.any():
                arm = rotate(q[b], f.at)
                place, speed = place + arm, speed + cross(w[b], arm)
            given = (place, speed, time, bodies.mass[b])
            value = field_values(f.name, f.force, *given)
            turn = np.zeros_like(value) if f.torque is None else field_values(f.name, f.torque, *given)
            if not (np.isfinite(value).all() and np.isfinite(turn).all()):
                raise FloatingPointError(f"force '{f.name}' is not finite at t = {time:g} s on '{bodies.names[b[0]]}'")
            force[b] += value  # a field names each body once
            torque[b] += turn if arm is None else turn + cross(arm, value)
        _write(at.force, force)
        _write(at.torque, torque)

    @property
    def loaded(self) -> bool:
        """Whether anything but gravity and joints acts on rigid bodies."""
        return bool(self.model.rigid_fields) or bool(self.state.loads.force.any() or self.state.loads.torque.any())

    def restore(self) -> None:
        """Take back what a failed step has changed."""
        for array, values in self._before:
            array.assign(values)

    def commit(self, dt: float) -> None:
        """The end of the step becomes the state."""
        state, system = self.state, self.system
        state.rigid, self.ahead = self.ahead, state.rigid
        self.opened = float(host(system.islands.worst).max())
        if self.loaded or self._damped:
            works = [self._powers(at) for at in (state.rigid, self.ahead)]
            state.work += 0.5 * dt * (works[0][0] + works[1][0])
            state.dissipation += 0.5 * dt * (works[0][1] + works[1][1])
        table = system.row_table
        state.impulse, state.active = (
            np.stack([host(table.impulse), host(table.impulse1)]),
            pack_active(host(table.active), host(table.dropped)),
        )
        if len(system.ties.target):
            write_row_forces(state, system.ties, self.tie_forces(dt), add=False)

    def _powers(self, at: RigidState) -> tuple[float, float]:
        """Power of loads, and what linear and angular damping take [W]; those of joints are not in it."""
        bodies = self.model.rigid
        q, v, w = (host(getattr(at, name)) for name in "qvw")
        moves = (bodies.motion == DYNAMIC).astype(float)
        work = float(moves @ np.sum(host(at.force) * v + host(at.torque) * w, axis=1))
        local = rotate(conjugate(q), w)
        spin = np.sum(bodies.inertia * local * local, axis=1)
        lost = bodies.damping[:, 0] * bodies.mass * np.sum(v * v, axis=1) + bodies.damping[:, 1] * spin
        return work, float(moves @ lost)

    def tie_forces(self, dt: float) -> np.ndarray:
        """Mean forces of ties in the last step (ties, 3) [N]."""
        table, n = self.system.row_table, ROWS * self.system.joint_parts
        total = self._halves * host(table.impulse)[n:] + host(table.impulse1)[n:]
        return total[: 3 * len(self.system.ties.target)].reshape(-1, 3) / dt

    def went_wrong(self) -> bool:
        """Whether the step turned a body too far, or Newton's method was lost: a smaller step may do."""
        return not float(host(self.system.islands.angle).max()) <= self.model.max_rotation or self.lost()

    def lost(self) -> bool:
        """Whether joints that were closed came apart in the step."""
        worst = float(host(self.system.islands.worst).max())
        return not worst <= max(LOST, 10.0 * self.opened)

    def lost_joints(self) -> str:
        """What came apart in the step that was lost, the worst first."""
        return lost_joints(self.state, self._measured(self.ahead), LOST)

    # Recording -----------------------------------------------------------------------------------------------------

    def record_positions(self, p: Program, params: wp.array, x: wp.array, v: wp.array, memory: wp.array) -> None:
        """Record the flight of all bodies to poses that close all joints, and where their points are then."""
        s = self.system
        bodies = s.bodies(self.state.rigid, self.ahead, self.state.rigid)
        tied = s.tied_points(x, v, memory, SCHEMES[self.model.integrator].velocity_memory)
        if len(s.tied):
            p.launch(remember_points, len(s.tied), [tied])
            p.barrier()
        given = [params, s.islands, bodies, tied, s.parts, s.row_table, s.matrix]
        if self.search.parts and self.displacement is None:
            start = self.state.rigid
            p.host(lambda: self.search.begin(start))
        p.launch(close_positions, s.island_count, [*given, 1], GRAIN)
        p.barrier()
        ahead, now = self.ahead, self.state.rigid
        if self.search.parts and self.displacement is None:
            p.host(lambda: self.search.settle(given, ahead))
        if len(s.tied):  # once, however often the flight was closed
            p.launch(push_points, len(s.tied), [tied, self._halves])
            p.barrier()
        if self.displacement is not None:
            stage = self.displacement
            p.host(lambda: stage.correct(now, ahead, x, v, memory, float(host(params)[H])))
        self._record_points(p, bodies, x, v)

    def record_velocities(self, p: Program, params: wp.array, x: wp.array, v: wp.array, memory: wp.array) -> None:
        """Record the projection of velocities, those of points, and the measurement of joints."""
        s = self.system
        bodies = s.bodies(self.state.rigid, self.ahead, self.ahead)
        ahead = self.ahead
        p.host(lambda: self._loads_ahead(ahead))
        tied = s.tied_points(x, v, memory, SCHEMES[self.model.integrator].velocity_memory)
        p.launch(
            project_velocities, s.island_count, [params, s.islands, bodies, tied, s.parts, s.row_table, s.matrix], GRAIN
        )
        p.barrier()
        self._record_points(p, bodies, x, v)
        self.certificate.record(p, s.acting, s.parts, bodies)
        start = s.bodies(self.state.rigid, ahead, self.state.rigid)
        self.measures.record(p, params, start, ahead)

    def _loads_ahead(self, ahead: RigidState) -> None:
        if self.loaded:
            self.loads(ahead, self.state.time + float(host(self.state.params)[H]))
            self._were_loaded = True
        elif self._were_loaded:
            for state in (ahead, self.state.rigid):
                state.force.zero_()
                state.torque.zero_()
            self._were_loaded = False

    def _record_points(self, p: Program, bodies: object, x: wp.array, v: wp.array) -> None:
        body, point, local, count = self.system.slaves
        p.launch(place_points, count, [body, point, local, bodies, x, v])
        p.barrier()

    def place_points(self) -> None:
        """Put the points of rigid bodies where their bodies are now (poses were written by hand)."""
        system, state = self.system, self.state
        self._stay()
        bodies = system.bodies(state.rigid, state.rigid, state.rigid)
        body, point, local, count = self.system.slaves
        wp.launch(
            place_points,
            count,
            inputs=[0, body, point, local, bodies, state.now.x, state.now.v],
            device=self.model.device,
        )
        state.stale = True

    # Reporting -----------------------------------------------------------------------------------------------------

    def report(self, report: StepReport, dt: float, size: float) -> None:
        """Residuals, energies, momentum and iterations of the step that ends at ``ahead``."""
        state, system = self.state, self.system
        if self.displacement is None:
            report.iterations["equality"] = int(host(system.islands.iterations).max())
        elif self.displacement.result is not None:
            report.iterations["displacement"] = self.displacement.result.iterations
            if not self.displacement.result.converged:
                report.messages.append(self.displacement.result.warning())
        energies, (linear, angular) = self.measures.read(self.ahead)
        for name, value in energies.items():
            report.energies[name] = report.energies.get(name, 0.0) + value
        report.momentum_error = (max(report.momentum_error[0], linear), max(report.momentum_error[1], angular))
        if state.parts.count == 0:
            return
        values = self._measured(self.ahead)
        if any(j.acting for j in state.joints.values()):
            report.active["joint"] = sum(j.acting for j in state.joints.values())
            worst = values.max(axis=1)
            report.position_residual["joint"], report.position_residual["joint_rotation"] = (
                float(worst[0]),
                float(worst[1]),
            )
            report.rate_residual["joint"], report.rate_residual["joint_rotation"] = float(worst[2]), float(worst[3])
            allowed = TOLERANCE + 64 * np.finfo(float).eps * size
            if self.displacement is None and not (worst <= allowed).all():
                report.messages.append(open_joints(state, values, allowed))
            elif self.displacement is not None and (told := fast_joints(state, values, dt, self.model.size)):
                report.messages.append(told)

    def residuals(self) -> np.ndarray:
        """[m], [rad], [m/s], [rad/s] of each part after the last step, shape (4, parts); 0 where none was taken yet."""
        if not self._follows:
            return np.zeros((4, self.state.parts.count))
        return self._measured(self.state.rigid)[:, : self.state.parts.count]

    def _measured(self, at: RigidState) -> np.ndarray:
        values = self.certificate.read()
        if self.search.parts:
            here = self.search.numbers
            if np.isfinite(at.x.numpy()).all():
                values[0, here], values[2, here] = self.search.residuals(at), self.search.rates(at)
            else:
                values[:, here] = np.inf
        return values

    def break_joints(self, dt: float) -> list[str]:
        """Switch off for good joints whose mean force or torque of the step has passed their limit; their names."""
        state = self.state
        limited = [
            j for j in state.joints.values() if j.acting and (np.isfinite(j.break_force) or np.isfinite(j.break_torque))
        ]
        if not limited:
            return []
        broken = []
        force, torque = self.mean_reactions(dt)
        for joint in limited:
            f, t = force[joint.parts].sum(axis=0), torque[joint.parts].sum(axis=0)
            if np.linalg.norm(f) > joint.break_force or np.linalg.norm(t) > joint.break_torque:
                joint.broken, joint.acting = True, False
                broken.append(joint.name)
        if broken:
            self._switch_parts()
        return broken

    def mean_reactions(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean force on body1 [N], and torque about the joint's place [N m], of each part in the last step (parts, 3)."""
        table, n = self.system.row_table, self.state.parts.count
        impulse, impulse1 = (host(a)[: ROWS * n] / dt for a in (table.impulse, table.impulse1))
        impulse = self._halves * impulse
        l0, l1, t0, t1 = (host(a)[: ROWS * n] for a in (table.line_mid, table.line, table.t_mid, table.t_a))
        force = (impulse[:, None] * l0 + impulse1[:, None] * l1).reshape(n, ROWS, 3).sum(axis=1)
        turn = (impulse[:, None] * t0 + impulse1[:, None] * t1).reshape(n, ROWS, 3).sum(axis=1)
        arm = rotate(self.state.rigid.q.numpy()[self.state.parts.a], self.state.parts.p_a)
        return force, turn - np.cross(arm, force)

    def update_windows(self, dt: float) -> None:
        """Switch joints on and off as their windows ask."""
        state, changed = self.state, False
        slack = 1e-6 * dt
        for joint in state.joints.values():
            wanted = joint.enabled and not joint.broken and joint.start <= state.time + slack < joint.end
            if wanted != joint.acting:
                joint.acting = wanted
                changed = True
        if changed and self._follows:
            self._switch_parts()

    def _switch_parts(self) -> None:
        """Tell the device which parts act; under the displacement solver its kernels close none."""
        self.opened = np.inf  # joints that begin to act may be open, and repeat others
        self.system.row_table.dropped.fill_(1)
        active, _ = unpack_active(self.state.active)
        self.state.active = pack_active(active, np.ones_like(active))
        on = np.ones(self.system.parts.on.shape[0], dtype=np.int32)
        on[: self.state.parts.count] = self.system.switches(self.state)
        self.system.acting.assign(on)
        if self.displacement is None:
            self.system.parts.on.assign(on)
        else:
            self.displacement.prepare()


def _write(array: wp.array, values: np.ndarray) -> None:
    if array.device.is_cpu:
        host(array)[:] = values
    else:
        array.assign(values)
