"""What a committed step with contact tells about itself: residuals, forces of constraints, energies, momentum."""

from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.compute import Program, host
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.rows import Rows
from turnbuckle.data.state import INVERSE_H, TIME, H, State
from turnbuckle.step.certificate import Certificate
from turnbuckle.step.contact_certificate import contact_conditions
from turnbuckle.step.row_forces import write_row_forces

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt

ALLOWED = 1e-10  # [m] what point constraints may miss by in a step that is "ok", over round-off
ROUND_OFF = 64 * np.finfo(float).eps  # of the largest coordinate


class ContactReports:
    """Measures the committed steps of one state."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self._layout = -1

    def measure(self, attempt: "Attempt", v: np.ndarray, report: StepReport) -> None:
        """Fill ``report`` for the state as committed, with block velocities ``v`` (n, 3) of the state."""
        assert attempt.solution is not None
        problem, r = attempt.problem, attempt.solution.impulse
        report.contact_residual = contact_conditions(problem, attempt.v.ravel(), r)
        left = self._unexplained(attempt)
        self._write_forces(attempt, left)
        self._momentum(attempt, left, report)
        self._energies(attempt, left, v, report)
        self._points(attempt, report)

    def _unexplained(self, attempt: "Attempt") -> np.ndarray:
        """``A (v - v0) - load - J^T r - E^T l`` (n, 3) [N s]: what prescribed blocks were pushed with, and solver errors."""
        problem, solution = attempt.problem, attempt.solution
        assert solution is not None
        left = problem.a @ (attempt.v.ravel() - problem.free)
        if problem.load is not None:
            left = left - problem.load
        self.pushed = (problem.j.T @ solution.impulse.ravel()).reshape(-1, 3)
        left = left.reshape(-1, 3) - self.pushed
        if problem.e is not None and len(solution.equality):
            left = left - (problem.e.T @ solution.equality).reshape(-1, 3)
        return left

    def _write_forces(self, attempt: "Attempt", left: np.ndarray) -> None:
        h = attempt.h
        nails: Rows | None = attempt.nails
        if nails is not None:
            write_row_forces(self.state, nails, left[nails.weights.indices] / h, add=False)
        closing = attempt.closing
        if closing.points is not None:
            force = np.zeros(closing.held.shape[0] * 3)
            force[closing.kept] = attempt.solution.equality[: len(closing.kept)] / h  # type: ignore[union-attr]
            force = np.einsum("rij,ri->rj", closing.held, force.reshape(-1, 3))
            write_row_forces(self.state, closing.points, force, add=False)

    def _momentum(self, attempt: "Attempt", left: np.ndarray, report: StepReport) -> None:
        """Momentum that the step made of nothing, over ``sum m |v|``, weight and impulses (angular: and over the largest |x|)."""
        model, dynamics, points = self.model, attempt.stepper.dynamics, self.model.points
        free = ~attempt.prescribed.fixed
        wrong = np.where(free[:, None], left, 0.0)
        linear = wrong[:points].sum(axis=0) + wrong[points::2].sum(axis=0)
        size = float(np.maximum(model.mass, 0.0) @ np.linalg.norm(attempt.v[:points], axis=1))
        size += float(
            model.rigid.mass[dynamics.dynamic] @ np.linalg.norm(attempt.v[points::2][dynamics.dynamic], axis=1)
        )
        weight = float(np.maximum(model.mass, 0.0).sum() + model.rigid.mass[dynamics.dynamic].sum())
        size += weight * float(np.linalg.norm(self.state.gravity)) * attempt.h
        size += float(np.linalg.norm(attempt.solution.impulse, axis=1).sum())  # type: ignore[union-attr]
        far = float(np.abs(attempt.x1[free[:points]]).max(initial=0.0)) if points else 0.0
        far = max(far, float(np.abs(attempt.bx1[dynamics.dynamic]).max(initial=0.0)))
        if size > 0.0 and far > 0.0:
            angular = np.cross(attempt.x1, wrong[:points]).sum(axis=0) + np.cross(attempt.bx1, wrong[points::2]).sum(
                axis=0
            )
            angular = angular + wrong[points + 1 :: 2].sum(axis=0)
            report.momentum_error = (
                float(np.linalg.norm(linear)) / size,
                float(np.linalg.norm(angular)) / (size * far),
            )

    def _energies(self, attempt: "Attempt", left: np.ndarray, v: np.ndarray, report: StepReport) -> None:
        """Energies of the state, work, and what was lost.

        Work is that of scripts, nails, loads, and of letting apart what is too near (what that lifts and strains). Backward Euler loses energy by
        itself, too (``|v1 - v0|^2 / 2`` in the metric of masses is the loss of an impact, and of any other change), so under it
        dissipation is what is missing: by damping, friction, impacts and the scheme. Other schemes: damping, and
        what impulses take at the mean of the velocities before and after them.
        """
        state, dynamics, h = self.state, attempt.stepper.dynamics, attempt.h
        problem, fixed = attempt.problem, attempt.prescribed.fixed
        work = -float(np.sum(self.pushed[fixed] * attempt.v[fixed]))
        nailed = fixed & ~dynamics.never
        work += float(np.sum((left + self.pushed)[nailed] * attempt.v[nailed]))
        work += float(np.sum(attempt.given * attempt.v))
        dynamics.refresh(h)
        if attempt.energy0 is None:
            contact = -float(attempt.kept_impulse.ravel() @ (problem.j @ (0.5 * (attempt.v0 + v)).ravel()))
            lost = contact + h * dynamics.system.dissipation_power()
        else:
            apart = h * (attempt.v - attempt.kept_velocity)
            work += attempt.handed - dynamics.work_of_forces(apart)
            end = dynamics.energy(v, attempt.x1, attempt.bx1, attempt.q1) + attempt.stepper.joints.elastic_energy()
            lost = work - (end - attempt.energy0)
        state.work += work
        state.dissipation += lost
        report.energies = {
            "kinetic": dynamics.kinetic(v, attempt.q1),
            "elastic": dynamics.system.elastic_energy(),
            "gravity": dynamics.gravity_energy(attempt.x1, attempt.bx1),
            "work": state.work,
            "dissipation": state.dissipation,
        }
        state.energies = report.energies

    def _points(self, attempt: "Attempt", report: StepReport) -> None:
        """Residuals of point constraints, measured on the state alone."""
        state = self.state
        for group in state.groups.values():
            if group.acting:
                report.active[group.kind] = report.active.get(group.kind, 0) + int((~group.broken).sum())
        if not report.active:
            return
        params = host(state.params)
        params[H], params[INVERSE_H], params[TIME] = attempt.h, 1.0 / attempt.h, state.time
        if self._layout != state.layout:
            self._layout = state.layout
            self._certificate = Certificate(state, self.model.points, self.model.device, False)
            self._program = Program(self.model.device)
            mass = self.model.device_arrays["counted_mass"]
            self._certificate.record(self._program, mass, state.now.x, state.now.v, False)
            self._program.finish()
        self._program.run()
        far = float(np.abs(host(state.now.x)).max(initial=0.0))
        for kind in report.active:
            position, rate = self._certificate.residuals(kind)
            report.position_residual[kind], report.rate_residual[kind] = position, rate
            if position > ALLOWED + ROUND_OFF * far and kind != "slide":
                report.messages.append(f"{kind} constraints are missed by {position:.2e} m")
