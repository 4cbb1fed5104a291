"""Explicit schemes beside contact: their own step first, then what contact changes of it (Contact, 3.1: A is diagonal).

`Stepper` makes the step as if nothing touched, with forces at every stage of the scheme and all constraints met. That is
u*, v*; the contact problem has ``A = M``. A step in which nothing pushes stays what the scheme made of it, bit by bit, so
its order is kept away from contact. Otherwise positions and velocities are written, and what the scheme remembers of
earlier steps is made anew from them.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.compute import host
from turnbuckle.data.errors import StepError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.state import State
from turnbuckle.step.contact_joint_report import JointReports
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.contact_schemes import ContactScheme
from turnbuckle.step.snapshot import Snapshot
from turnbuckle.step.step import Stepper

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt
    from turnbuckle.step.contact_step import ContactStepper


class ExplicitJointReports(JointReports):
    """Reactions are those of the free step and those to contact together."""

    def __init__(self, model: Model, state: State, joints: ContactJoints, free: Stepper) -> None:
        super().__init__(model, state, joints)
        self.articulated = free.articulated

    def mean_reactions(self) -> tuple[np.ndarray, np.ndarray]:
        force, torque = super().mean_reactions()
        if self.state.dt > 0.0 and self.articulated.exists:
            own = self.articulated.mean_reactions(self.state.dt)
            force, torque = force + own[0], torque + own[1]
        return force, torque


class Explicit(ContactScheme):
    """Any scheme of `turnbuckle.integrators` that is not implicit."""

    def __init__(self, stepper: "ContactStepper") -> None:
        super().__init__(stepper)
        self.free = Stepper(stepper.model, stepper.state)
        self.report = StepReport()

    def begin(self, attempt: "Attempt") -> bool:
        stepper, h = self.stepper, attempt.h
        state, dynamics = stepper.state, stepper.dynamics
        self._start, self.dissipation = Snapshot(state), state.dissipation
        attempt.energy0 = None
        self._lead_scripts(attempt)
        self.report = self.free.step(h)
        if self.report.status == "failed":
            raise StepError(self.report.messages[0].partition("; the last good state")[0])
        p, rigid = dynamics.points, state.rigid
        u = np.empty((dynamics.n, 3))
        u[:p] = (host(state.now.x) - attempt.x0) / h
        u[p::2] = (host(rigid.x) - dynamics.bx0) / h
        turn = Rotation.from_quat(host(rigid.q)) * Rotation.from_quat(dynamics.q0).inv()
        u[p + 1 :: 2] = turn.as_rotvec() / h
        self.star = dynamics.velocities()
        prescribed = attempt.prescribed
        if attempt.nails is not None:
            nailed = attempt.nails.weights.indices
            prescribed.velocity[nailed] = u[nailed]
        u[prescribed.fixed] = prescribed.velocity[prescribed.fixed]
        attempt.a, attempt.base, attempt.load = dynamics.masses(), u, None
        attempt.given = np.zeros_like(u)
        attempt.v, attempt.free = u.copy(), u.ravel()
        return True

    def _lead_scripts(self, attempt: "Attempt") -> None:
        """Scripted points fly straight to where their script has them, for elements and constraints that take them."""
        state = self.stepper.state
        there = np.flatnonzero(~np.isnan(attempt.prescribed.scripted[:, 0]))
        if not len(there):
            return
        for array in (state.now.v, state.now.memory) if self.free.scheme.velocity_memory else (state.now.v,):
            values = array.numpy()
            values[there] = attempt.prescribed.velocity[there]
            array.assign(values)

    def take_back(self, attempt: "Attempt") -> None:
        self._start.restore(self.stepper.state)

    def end(self, attempt: "Attempt", u: np.ndarray) -> np.ndarray:
        v = self.star + u - attempt.base
        scripted = np.flatnonzero(~np.isnan(attempt.prescribed.scripted[:, 0]))
        v[scripted] = attempt.prescribed.velocity[scripted]
        return v

    def stays(self, attempt: "Attempt") -> bool:
        """Whether the step is that of the scheme alone: nothing pushed, no script waits."""
        solution = attempt.solution
        assert solution is not None
        late = self.stepper.state.script_delay > 0.0 or self.stepper.dynamics.waiting
        waits = late and bool(self.stepper.model.rigid.trajectories)
        if solution.impulse.any() or solution.equality.any() or waits:
            return False
        touching = attempt.touching()
        ahead = attempt.problem.j @ self.end(attempt, attempt.v).ravel()
        return not (ahead[::3][touching] < -attempt.tolerance).any()

    def leave(self, attempt: "Attempt") -> StepReport:
        """Commit the step of the scheme; scripted points go exactly where their script has them."""
        state = self.stepper.state
        there = np.flatnonzero(~np.isnan(attempt.prescribed.scripted[:, 0]))
        if len(there):
            for array, given in (
                (state.now.x, attempt.prescribed.scripted),
                (state.now.v, attempt.prescribed.velocity),
            ):
                values = array.numpy()
                values[there] = given[there]
                array.assign(values)
        return self.report

    def add_to(self, report: StepReport, forces: dict[str, np.ndarray]) -> None:
        """What the free step says, into the report of a step that contact has changed; ``forces`` of `set_aside`."""
        free, tables = self.report, self.stepper.state.tables
        report.ramping, report.settling = free.ramping, free.settling
        report.broken += [name for name in free.broken if name not in report.broken]
        report.momentum_error = (
            max(report.momentum_error[0], free.momentum_error[0]),
            max(report.momentum_error[1], free.momentum_error[1]),
        )
        for name, values in forces.items():
            kind, column = name.split()
            array = getattr(getattr(tables, kind), column)
            array.assign(array.numpy() + values)

    def set_aside(self) -> dict[str, np.ndarray]:
        """Constraint forces of the free step; those of contact are to be written in their place, and added by `add_to`."""
        out = {}
        for kind, table in self.stepper.state.tables.by_kind().items():
            for column in ("force", "point_force"):
                array = getattr(table, column, None)
                if array is not None and array.shape[0]:
                    out[f"{kind} {column}"] = array.numpy().copy()
                    array.zero_()
        self.stepper.state.dissipation = self.dissipation
        return out
