"""One step with contact (Contact, section 4). This file names the stages; what they do is elsewhere.

    A, load   = linearised dynamics at the state                       (3.1)
    contacts  = pairs that are near at the start                       (3.2)
    repeat at most `rounds` times:                                     (4)
        v         = solve(A, load, contacts, equality rows)            (3.3, 3.4, 5)
        hits      = continuous collision detection of the way there
        none: commit;  else add their rows
    not clear: two half steps; at the allowed depth: zones of impact move rigidly
"""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from turnbuckle.compute import host
from turnbuckle.constraints.activation import break_rows, update_windows
from turnbuckle.contact.detector import Detector
from turnbuckle.contact.manifold import Refined, no_contacts, refine
from turnbuckle.data.contact import ContactProblem, ContactSolution, Contacts
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport, merge_reports
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import rotate
from turnbuckle.integrators import SCHEMES
from turnbuckle.solvers.contact.newton import NewtonSolver
from turnbuckle.step.contact_dynamics import ContactDynamics, Prescribed
from turnbuckle.step.contact_equality import point_rows, split
from turnbuckle.step.contact_rows import Memory, PointMap, contact_rows, frames
from turnbuckle.step.goals import move_goals
from turnbuckle.step.snapshot import Snapshot

RECOVERED = 0.2  # part of what a contact is too near by that a step gives back
LEAST = 1e-9  # [m/s] the smallest tolerance
TOUCH = 0.01  # of delta a step: what counts as motion where there is no gravity


class Attempt:
    """One attempt at a step of ``h``: its system, and the solve that refinement calls."""

    def __init__(self, stepper: "ContactStepper", h: float) -> None:
        self.stepper, self.h = stepper, h
        model, state, dynamics = stepper.model, stepper.state, stepper.dynamics
        self.x0 = np.array(host(state.now.x))
        self.v0 = dynamics.velocities()
        equal = split(state, h, model.body_of)
        self.prescribed: Prescribed = dynamics.prescribe(h, equal.nails)
        with stepper.timed("forces"):
            self.a, self.load = dynamics.assemble(h)
        self.v0[self.prescribed.fixed] = self.prescribed.velocity[self.prescribed.fixed]
        self.arms = dynamics.arms(self.x0)
        self.e = None
        if equal.rows is not None:
            self.e = point_rows(state, equal.rows, h, self.x0, self.arms, stepper.map)
        self.s0 = stepper.surfaces.positions(self.x0)
        self.v = self.v0.copy()
        self.solution: ContactSolution | None = None
        self.solved = no_contacts()  # the contacts of the last solution
        self.frame = np.zeros((0, 3, 3))
        self.impulse = np.zeros((0, 3))  # world
        self.friction = np.zeros(0)
        gravity = float(np.linalg.norm(state.gravity)) * h
        still = TOUCH * float(stepper.surfaces.delta.min(initial=np.inf)) / h if stepper.surfaces.vertices else 0.0
        self.tolerance = max(model.contact.tolerance * max(gravity, still), LEAST)
        self.iterations: dict[str, int] = {}

    def solve(self, contacts: Contacts) -> np.ndarray | None:
        """Velocities under these contacts; positions of surface vertices at the end of the step."""
        stepper, h = self.stepper, self.h
        with stepper.timed("rows"):
            problem = self._problem(contacts)
            start = np.einsum("mij,mj->mi", self.frame, self.impulse)
        with stepper.timed("contact_solve"):
            found = stepper.solver.solve(problem, start, self.v.ravel(), self.tolerance, stepper.options.max_iterations)
        if not np.isfinite(found.velocity).all():
            return None
        for name, count in found.iterations.items():
            self.iterations[name] = self.iterations.get(name, 0) + count
        self.solution, self.solved, self.problem = found, contacts, problem
        self.v = found.velocity.reshape(-1, 3)
        self.impulse = np.einsum("mij,mi->mj", self.frame, found.impulse)
        self.x1, self.bx1, self.q1 = stepper.dynamics.moved(self.v, h, self.prescribed)
        return stepper.surfaces.positions(self.x1)

    def crossed(self, s1: np.ndarray) -> Contacts:
        """What the way to ``s1`` comes too near to."""
        with self.stepper.timed("ccd"):
            return self.stepper.detector.crossed(self.s0, s1)

    def _problem(self, contacts: Contacts) -> ContactProblem:
        stepper, surfaces, h = self.stepper, self.stepper.surfaces, self.h
        new = contacts.count - len(self.impulse)
        if new:  # those of earlier rounds come first
            fresh = Contacts(*(getattr(contacts, n)[len(self.impulse) :] for n in Contacts.__dataclass_fields__))
            ratio = h / stepper.state.dt if stepper.state.dt > 0.0 else 1.0
            known, slid = stepper.memory.recall(fresh, ratio)
            self.frame = np.concatenate([self.frame, frames(fresh.normal)])
            self.impulse = np.concatenate([self.impulse, known])
            sides = surfaces.shape[fresh.vertices[:, 0]], surfaces.shape[fresh.vertices[:, 3]]
            mu = surfaces.friction[sides[0], sides[1]]
            self.friction = np.concatenate([self.friction, np.where(slid, mu[:, 1], mu[:, 0])])
        gap = np.einsum("mk,mkd,md->m", contacts.coefficients, self.s0[contacts.vertices], contacts.normal)
        delta = stepper.detector.deltas(contacts.kind, contacts.a, contacts.b)
        apart = np.minimum(RECOVERED * np.maximum(delta - contacts.distance, 0.0), stepper.options.recovery * h)
        target = np.where(contacts.distance < delta, contacts.distance + apart, delta)
        floor = (target - gap) / h
        if stepper.options.rows == "velocity":
            floor = np.zeros(contacts.count)
        e, wanted = (None, np.zeros(0)) if self.e is None else (self.e.e, self.e.wanted)
        return ContactProblem(
            a=self.a, free=self.v0.ravel(), j=contact_rows(surfaces, contacts, self.frame, self.arms, stepper.map),
            floor=floor, friction=self.friction, e=e, wanted=wanted, pairs=stepper.dynamics.pairs,
            fixed=self.prescribed.fixed, load=self.load.ravel(),
        )  # fmt: skip


class ContactStepper:
    """Advances one state of one model with contact."""

    def __init__(self, model: Model, state: State) -> None:
        assert model.surfaces is not None
        self.model, self.state = model, state
        self.surfaces, self.options = model.surfaces, model.contact
        self.dynamics = ContactDynamics(model, state)
        self.map = PointMap(model.points, model.body_of, self.dynamics.n)
        still = self.dynamics.never[: model.points].copy()
        still[self.dynamics.slaves] = ~self.dynamics.dynamic[model.body_of[self.dynamics.slaves]]
        for script in model.scripted:
            still[script.begin : script.end] = not script.moves
        for b in model.rigid.trajectories:
            still[model.body_of == b] = False
        moves = ~still[self.surfaces.support].all(axis=1)
        self.detector = Detector(self.surfaces, moves, model.device, self.options.broad_phase)
        self.solver = NewtonSolver(model.device)
        self.memory = Memory(self.surfaces)
        self.scheme = SCHEMES[model.integrator]()
        self._seconds: dict[str, float] = {}

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Count the time of what follows under a stage."""
        began = time.perf_counter()
        yield
        self._seconds[stage] = self._seconds.get(stage, 0.0) + time.perf_counter() - began

    def step(self, dt: float) -> StepReport:
        """Advance the state by ``dt`` [s]. When the report says "failed", the state is the last good one."""
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt must be a positive number of seconds, got {dt}")
        began = time.perf_counter()
        self._seconds = {}
        start = Snapshot(self.state)
        steps = self.state.steps
        try:
            report = self._advance(dt, self.options.halvings)
        except (FloatingPointError, np.linalg.LinAlgError, StepError) as error:
            report = self._failed(dt, str(error))
        if report.status == "failed":
            start.restore(self.state)
            report.time, report.energies = self.state.time, dict(self.state.energies)
        else:
            self.state.steps = steps + 1
        report.seconds = {**self._seconds, "total": time.perf_counter() - began}
        return report

    def _advance(self, h: float, depth: int) -> StepReport:
        """A step of ``h``, or two halves of it, and so on to ``depth``."""
        update_windows(self.model, self.state, h)
        move_goals(self.state, self.scheme, h)
        attempt = Attempt(self, h)
        with self.timed("detection"):
            contacts = self.detector.near(attempt.s0) if self.options.proximity else no_contacts()
        refined = refine(contacts, attempt.solve, attempt.crossed, self.options.rounds)
        if refined.clear:
            return self._commit(attempt, refined)
        if depth == 0:
            return self._failed(h, f"{refined.crossed.count} pairs still cross after {refined.rounds} rounds")
        first = self._advance(0.5 * h, depth - 1)
        if first.status == "failed":
            return first
        second = self._advance(0.5 * h, depth - 1)
        return second if second.status == "failed" else merge_reports(first, second)

    def _commit(self, attempt: Attempt, refined: Refined) -> StepReport:
        state, dynamics, h = self.state, self.dynamics, attempt.h
        assert attempt.solution is not None
        v, q = attempt.v, attempt.q1
        self._remember(attempt)
        body = self.model.body_of[dynamics.slaves]
        speeds = v[: self.model.points].copy()
        arm = rotate(q[body], self.model.rigid.local[dynamics.slaves])
        centre = self.model.points + 2 * body
        speeds[dynamics.slaves] = v[centre] + np.cross(v[centre + 1], arm)
        state.now.x.assign(np.ascontiguousarray(attempt.x1))
        state.now.v.assign(np.ascontiguousarray(speeds))
        for name, values in (("x", attempt.bx1), ("q", q), ("v", v[self.model.points :: 2]), ("w", v[self.model.points + 1 :: 2])):
            getattr(state.rigid, name).assign(np.ascontiguousarray(values))
        state.time += h
        state.dt = h
        state.stale = False
        state.activated = False
        report = StepReport(time=state.time, dt=h, rounds=refined.rounds, iterations=dict(attempt.iterations))
        report.contacts = attempt.solved.count
        report.touching = int((attempt.solution.impulse[:, 0] > 0.0).sum())
        gap = self.detector.smallest_gap
        report.smallest_gap = gap if np.isfinite(gap) else None
        report.contact_residual = {"solver": attempt.solution.residual}
        report.energies = {
            "kinetic": dynamics.kinetic(v, q), "elastic": dynamics.system.elastic_energy(),
            "gravity": dynamics.gravity_energy(attempt.x1, attempt.bx1),
        }  # fmt: skip
        state.energies = report.energies
        if not attempt.solution.converged:
            report.messages.append(f"contact forces missed their conditions by {attempt.solution.residual:.1e} m/s")
        report.broken = break_rows(self.model, state)
        report.status = "degraded" if report.messages else "ok"
        return report

    def _remember(self, attempt: Attempt) -> None:
        assert attempt.solution is not None
        r = attempt.solution.impulse
        tangential = np.linalg.norm(r[:, 1:], axis=1)
        sliding = (r[:, 0] > 0.0) & (tangential >= attempt.friction * r[:, 0] * (1.0 - 1e-6))
        self.memory.keep(attempt.solved, attempt.impulse, sliding)

    def _failed(self, h: float, what: str) -> StepReport:
        advice = "take a smaller dt, or see what presses the bodies together"
        return StepReport(
            status="failed", messages=[f"{what}; the last good state stands: {advice}"], time=self.state.time, dt=h,
            energies=dict(self.state.energies),
        )  # fmt: skip
