"""One step. This file names the stages; what they do is elsewhere."""

import math
import time

import numpy as np
import warp as wp

from turnbuckle.compute import Program, host
from turnbuckle.constraints.activation import break_rows, update_windows
from turnbuckle.constraints.points.own import OwnConstraint, check_own
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport, merge_reports
from turnbuckle.data.state import (
    ADD,
    BACKWARD,
    D_OVER_C,
    GRAVITY,
    INVERSE_C,
    INVERSE_H,
    MEMORY,
    PREVIOUS_H,
    PROJECT,
    TIME,
    H,
    Kinematics,
    State,
)
from turnbuckle.data.tables import Table
from turnbuckle.integrators import SCHEMES
from turnbuckle.step.articulated import Articulated
from turnbuckle.step.certificate import Certificate
from turnbuckle.step.goals import aim_again, move_goals
from turnbuckle.step.recording import Scratch, StepRecorder
from turnbuckle.step.scripts import follow_scripts
from turnbuckle.step.snapshot import Snapshot

TIED = 1e-12  # [m] what points held together with joints, in one system, may miss by on top
TOLERANCE = 1e-12  # of the scene's size: what a constraint may miss by in a step that is "ok"
NEWTON_LEFT = 1e-9  # of the scene's size: what the last Newton iteration may move a point by in a step that is "ok"
HALVINGS = 6  # of a step that turns a body too far, at most
ROUND_OFF = 64 * np.finfo(float).eps  # of the largest coordinate or speed: what floating point cannot resolve


class Stepper:
    """Advances one state of one model. Everything it holds besides them can be rebuilt at any time."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.scheme = SCHEMES[model.integrator]()
        self._ahead = Kinematics.zeros(model.points, model.device)
        self._layout = -1
        self._damped = model.damped
        self._ramping = 0  # constraints in gradual activation after the last step
        self.scratch = Scratch(model)
        self.articulated = Articulated(model, state)

    def add(self, constraint: OwnConstraint) -> None:
        """Let a constraint that you wrote act from the next step (see `turnbuckle.constraints.points.own`).

        It is not part of the state: a resumed run adds it again. Raises `InputError`, and `ConflictError` naming both.
        """
        check_own(constraint, self.scratch.own, self.model, self.state)
        self.scratch.own.append(constraint)
        self.state.layout += 1  # what is recorded lacks it

    def step(self, dt: float) -> StepReport:
        """Advance the state by ``dt`` [s]. When the report says "failed", the state is the last good one.

        A step that turns a rigid body by more than the model's `max_rotation` goes back and is taken in two halves.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt must be a positive number of seconds, got {dt}")
        report = self._once(dt, last=False)
        if report is not None:
            return report
        start, opened, ramping = Snapshot(self.state), self.articulated.opened, self._ramping
        report = self._halved(dt, HALVINGS)
        if report.status == "failed":  # a failure in any part of the step takes all of it back
            start.restore(self.state)
            self._prepare(dt)
            self.articulated.opened, self._ramping = opened, ramping
            report.time, report.energies = self.state.time, dict(self.state.energies)
        return report

    def _halved(self, dt: float, depth: int) -> StepReport:
        """The step in two halves, each halved again where it must be."""
        reports: list[StepReport] = []
        for _ in range(2):
            report = self._once(0.5 * dt, last=depth == 1)
            reports.append(report if report is not None else self._halved(0.5 * dt, depth - 1))
            if reports[-1].status == "failed":
                return reports[-1]
        self.state.steps -= 1  # both halves are one step
        return merge_reports(*reports)

    def _once(self, dt: float, last: bool) -> StepReport | None:
        """One step; None when it turned a body too far or opened joints, and was taken back (never where it is ``last``)."""
        began = time.perf_counter()
        model, state, scheme = self.model, self.state, self.scheme
        update_windows(model, state, dt)
        if self.articulated.exists:
            self.articulated.update_windows(dt)
        self._prepare(dt)
        move_goals(state, scheme, dt)
        if self.articulated.exists:
            self.articulated.prepare(dt)
        ramped = self._ramped()
        before = [(a, a.numpy().copy()) for t in ramped for a in (t.phase, t.ramp.step)]
        try:
            if state.stale:
                self._program("evaluate").run()
                state.dissipation_power = self._damping_power()
                state.field_power = self.scratch.field_power
                if self.articulated.exists:
                    self.articulated.loads(state.rigid, state.time)
            elif dt != state.dt:
                if scheme.lands_later:
                    aim_again(state, dt)
                before.append((state.now.memory, state.now.memory.numpy().copy()))
                self._program("change_dt").run()
            program = self._program("step")
            program.run()
            follow_scripts(model, state.now, self._ahead, state.time + dt, dt, scheme.velocity_memory)
        except (FloatingPointError, np.linalg.LinAlgError) as error:
            self._restore(before)
            return self._failed(dt, str(error))
        if self.articulated.exists and not last and self.articulated.went_wrong():
            self._restore(before)
            return None
        if self.articulated.exists and self.articulated.lost():
            self._restore(before)
            what = f"joints came apart: {self.articulated.lost_joints()}"
            return self._failed(dt, what, "take a smaller dt, see what pulls on them, and whether they can be closed")
        report = self._report(dt, program, ramped)
        if report.status == "failed":
            self._restore(before)
        else:
            self._commit(dt, report)
        report.seconds["total"] = time.perf_counter() - began
        return report

    # Stages --------------------------------------------------------------------------------------------------------

    def _record_step(self, r: StepRecorder) -> None:
        p, scheme, ahead = r.program, self.scheme, r.ahead
        p.stage("integration")
        scheme.predict(r)
        p.stage("constraints")
        on = scheme.landing(r)
        counted = self.model.device_arrays["counted_mass"]
        memory = ahead.memory if scheme.velocity_memory else r.scratch("no memory")
        self.certificate.record_momentum(p, counted, ahead.x, ahead.v, "before")
        p.barrier()
        r.land(on)
        p.barrier()
        if self.articulated.exists:
            p.stage("joints")
            self.articulated.record_positions(p, r.params, on.x, on.v, memory)
            p.stage("constraints")
        if scheme.finishes_velocity:
            self.certificate.record_momentum(p, counted, ahead.x, ahead.v, "landed")
            p.barrier()
            scheme.finish(r)
            self.certificate.record_momentum(p, counted, ahead.x, ahead.v, "finished")
            p.barrier()
            r.constrain_velocity(ahead.v)
        if self.articulated.exists:
            p.stage("joints")
            self.articulated.record_velocities(p, r.params, ahead.x, ahead.v, memory)
        p.stage("forces")
        r.forces(ahead.x, ahead.v, ahead.force, 1.0)
        p.stage("integration")
        scheme.remember(r)
        p.stage("report")
        if scheme.implicit:
            p.host(lambda: r.work.row_forces() if r.work.row_forces else None)
        if scheme.lands_later:
            r.find_places(ahead.x)  # places were found for the step after this one
        self.certificate.record(p, counted, ahead.x, ahead.v, scheme.lands_later)

    def _record_evaluate(self, r: StepRecorder) -> None:
        r.forces(r.now.x, r.now.v, r.now.force, 0.0)
        r.find_places(r.now.x)
        self.scheme.restart(r)

    def _record_change_dt(self, r: StepRecorder) -> None:
        self.scheme.change_dt(r)

    # Around them ---------------------------------------------------------------------------------------------------

    def _prepare(self, dt: float) -> None:
        state, scheme = self.state, self.scheme
        if state.layout != self._layout:
            self._layout = state.layout
            self._programs: dict[tuple[str, int], Program] = {}
            self.scratch.follow(self.model, state)
            self.certificate = Certificate(state, self.model.points, self.model.device, self.scheme.finishes_velocity)
            if self.articulated.exists:
                self.articulated.follow()
        c, d = scheme.response(dt)
        paper = self.model.response == "paper"
        params = host(state.params)
        params[H], params[TIME] = dt, state.time
        params[GRAVITY : GRAVITY + 3] = state.gravity
        params[INVERSE_C], params[D_OVER_C] = 1.0 / c, d / c
        if scheme.lands_later:
            params[D_OVER_C] = 1.0 / dt
        params[PROJECT] = 0.0 if paper or scheme.lands_later else 1.0
        params[MEMORY] = 1.0 if scheme.velocity_memory else 0.0
        params[ADD] = 1.0 if scheme.adds_landing and not paper else 0.0
        params[BACKWARD] = 1.0 if scheme.goal_rate == "backward" else 0.0
        params[PREVIOUS_H], params[INVERSE_H] = state.dt, 1.0 / dt
        if not state.params.device.is_cpu:
            state.params.assign(params)

    def _program(self, name: str) -> Program:
        key = (name, id(self.state.now))
        if key not in self._programs:
            recorder = StepRecorder(self.model, self.state, self.scratch, self.state.now, self._ahead)
            getattr(self, f"_record_{name}")(recorder)
            self._programs[key] = recorder.program.finish()
        return self._programs[key]

    def _commit(self, dt: float, report: StepReport) -> None:
        state = self.state
        power = self._damping_power()
        state.dissipation += 0.5 * dt * (power + state.dissipation_power)
        state.dissipation_power = power
        fields = self.scratch.field_power
        state.work += dt * (self.certificate.power() + 0.5 * (state.field_power + fields))
        state.field_power = fields
        state.now, self._ahead = self._ahead, state.now
        if self.articulated.exists:
            self.articulated.commit(dt)
        state.time += dt
        state.steps += 1
        state.dt = dt
        state.stale = False
        state.activated = False
        self._ramping = report.ramping
        report.energies["work"], report.energies["dissipation"] = state.work, state.dissipation
        state.energies = report.energies
        report.broken = break_rows(self.model, state)
        if self.articulated.exists:
            report.broken += self.articulated.break_joints(dt)
        if report.broken:
            report.messages.append("broke: " + ", ".join(report.broken[:5]))

    def _damping_power(self) -> float:
        if not self._damped:
            return 0.0
        return float(host(self.scratch.spring_power).sum() + host(self.scratch.block_power).sum())

    def _elastic_energy(self) -> float:
        return float(host(self.scratch.spring_energy).sum() + host(self.scratch.block_energy).sum())

    def _ramped(self) -> list[Table]:
        """Tables in which some row may be in gradual activation."""
        kinds = {g.kind for g in self.state.groups.values() if g.acting and g.ramp_steps > 0}
        return [getattr(self.state.tables, kind) for kind in sorted(kinds)]

    def _restore(self, before: list[tuple[wp.array, np.ndarray]]) -> None:
        for array, values in before:
            array.assign(values)
        if self.articulated.exists:
            self.articulated.restore()

    def _report(self, dt: float, program: Program, ramped: list[Table]) -> StepReport:
        state, scheme = self.state, self.scheme
        report = StepReport(time=state.time + dt, dt=dt, seconds=dict(program.seconds))
        kinetic, gravity, linear, farthest, fastest = self.certificate.totals()
        elastic = self._elastic_energy()
        if not math.isfinite(kinetic + gravity + elastic + farthest + fastest):
            return self._failed(dt, "positions or velocities are no longer finite numbers")
        report.energies = {"kinetic": float(kinetic), "elastic": elastic, "gravity": float(gravity)}
        report.momentum_error = self.certificate.momentum_error(linear, farthest)
        for group in state.groups.values():
            if group.acting:
                report.active[group.kind] = report.active.get(group.kind, 0) + int((~group.broken).sum())
        report.ramping = int(sum((t.phase.numpy() > 0).sum() for t in ramped))
        settling = scheme.lands_later and (state.activated or report.ramping < self._ramping)
        allowed = TOLERANCE * self.model.size + ROUND_OFF * farthest + TIED * float(self.articulated.exists)
        allowed_rate = TOLERANCE * max(self.model.size, fastest) + ROUND_OFF * (
            farthest / dt if scheme.lands_later else 0.0
        )
        for kind in report.active:
            position, rate = self.certificate.residuals(kind)
            report.position_residual[kind], report.rate_residual[kind] = position, rate
            if not settling and (position > allowed or rate > allowed_rate) and self.model.response == "exact":
                report.messages.append(f"{kind} constraints are missed by {position:.2e} m and {rate:.2e} m/s")
        for own in self.scratch.own:
            position, rate = own.residual(self._ahead.x.numpy(), self._ahead.v.numpy())
            report.position_residual[own.name], report.rate_residual[own.name] = position, rate
            if not settling and (position > allowed or rate > allowed_rate) and self.model.response == "exact":
                report.messages.append(f"'{own.name}' is missed by {position:.2e} m and {rate:.2e} m/s")
        left = self.scratch.newton_last
        if left > NEWTON_LEFT * self.model.size:
            report.messages.append(f"Newton's method stopped while it still moved points by {left:.1e} m")
        if self.articulated.exists:
            self.articulated.report(report, dt, farthest)
            if not math.isfinite(sum(report.energies.values())):
                return self._failed(dt, "poses or velocities of rigid bodies are no longer finite numbers")
        report.settling = settling
        if settling:
            report.messages.append("explicit Euler meets new constraints in their second step")
        if report.ramping:
            report.messages.append(f"{report.ramping} constraints are in gradual activation")
        report.status = "degraded" if report.messages else "ok"
        return report

    def _failed(self, dt: float, what: str, advice: str = "") -> StepReport:
        advice = advice or "take a smaller dt, more damping or less stiffness, or an implicit integrator"
        if what.startswith("force "):
            advice = "mend the force field"
        elif what.startswith("displacement: "):
            advice = "bring the parts together with assemble, or look at the joints named"
        return StepReport(
            status="failed", messages=[f"{what}; the last good state stands: {advice}"], time=self.state.time, dt=dt,
            energies=dict(self.state.energies),
        )  # fmt: skip
