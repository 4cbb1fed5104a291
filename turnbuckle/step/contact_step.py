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
from turnbuckle.contact.detector import PARALLEL, Detector
from turnbuckle.contact.intersections import Intersections
from turnbuckle.contact.manifold import Refined, first_met, joined, no_contacts, refine
from turnbuckle.data.contact import Contacts
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport, merge_reports
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import rotate
from turnbuckle.integrators import SCHEMES
from turnbuckle.solvers.contact.newton import NewtonSolver
from turnbuckle.step.contact_attempt import Attempt
from turnbuckle.step.contact_dynamics import ContactDynamics
from turnbuckle.step.contact_explicit import Explicit, ExplicitJointReports
from turnbuckle.step.contact_gains import Balance, balance, gained, gains
from turnbuckle.step.contact_joint_report import JointReports
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.contact_limits import ALLOWED
from turnbuckle.step.contact_opening import PATIENCE, Opening
from turnbuckle.step.contact_pressed import pressed_contacts
from turnbuckle.step.contact_pushable import Pushable
from turnbuckle.step.contact_report import ContactReports
from turnbuckle.step.contact_rows import Memory, PointMap
from turnbuckle.step.contact_schemes import BackwardEuler, ContactScheme, Newmark
from turnbuckle.step.contact_tolerance import body_masses
from turnbuckle.step.contact_velocities import end_velocities, without_recovery
from turnbuckle.step.contact_zones import Zones, clear_with_zones
from turnbuckle.step.goals import move_goals
from turnbuckle.step.snapshot import Snapshot

MORE = 4  # Newton iterations more where a step is made again
TOLD = 3  # pairs of bodies that a message names


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
        self.memory = Memory(self.surfaces, state)
        self.body_masses = body_masses(model, self.dynamics.dynamic)
        self.joints = ContactJoints(model, state)
        self.reports = ContactReports(model, state)
        self.scheme = SCHEMES[model.integrator]()
        self.dynamics_of = self._dynamics()
        if isinstance(self.dynamics_of, Explicit):
            self.joint_reports: JointReports = ExplicitJointReports(model, state, self.joints, self.dynamics_of.free)
        else:
            self.joint_reports = JointReports(model, state, self.joints)
        self.articulated = self.joint_reports.articulated
        self._use(self.dynamics_of)
        threads = 1 if self.surfaces.vertices < PARALLEL else None
        self._intersections = Intersections(self.surfaces, model.device, moves, threads)
        self._seconds: dict[str, float] = {}
        self.opening: Opening | None = None  # crossings of the start that are let apart
        self.more = 0  # Newton iterations beyond those of the options
        self.hopeless = False  # whether the dense solver has failed in this step, too
        self._scripts = bool(model.rigid.trajectories) or any(s.moves for s in model.scripted)
        self._known: np.ndarray | None = None  # positions of points that were found free of intersections

    def _use(self, scheme: ContactScheme) -> None:
        """Make steps by ``scheme``."""
        self.dynamics_of = scheme
        self.dynamics.alpha, self.dynamics.beta = scheme.alpha, scheme.beta

    def _dynamics(self) -> ContactScheme:
        if self.model.integrator == "newmark":
            return Newmark(self)
        return BackwardEuler(self) if self.scheme.implicit else Explicit(self)

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
        self._seconds, self.hopeless = {}, False
        start = Snapshot(self.state)
        steps = self.state.steps
        try:
            grows = (
                self.options.on_intersection == "grow" and self._known is None
            )  # a run may be resumed while it opens
            if (self.state.stale or grows) and not self._is_known():
                self.check_start()
            before = balance(self)
            report = self._advance(dt, self.options.halvings)
            if self.opening is None and gains(self, report, before):
                report = self._again(dt, start, report, before)
            if self.opening is not None and report.status != "failed":
                self._tell_crossings(report)
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
        self.joint_reports.follow(h)
        move_goals(self.state, self.scheme, h)
        attempt = Attempt(self, h)
        if not attempt.began:
            return self._halved(attempt, h, depth)
        pushable = Pushable(attempt)
        with self.timed("detection"):
            contacts = pushable.of(attempt.near()) if self.options.proximity else no_contacts()
        contacts = joined(contacts, pushable.of(attempt.expected(contacts)))
        refined = self._refined(contacts, attempt, pushable)
        for _ in range(self.dynamics_of.iterations - 1):
            if not refined.clear or not attempt.again():
                break
            refined = self._refined(refined.contacts, attempt, pushable)
        if self._may_wait() and refined.solved:
            pressed = pressed_contacts(attempt)
            if pressed.count:
                return self._wait(attempt, pressed)
        if refined.clear and (attempt.closing.good or depth == 0):
            return self._commit(attempt, refined)
        if depth == 0:
            return self._last_resort(attempt, refined, pushable)
        return self._halved(attempt, h, depth)

    def _again(self, dt: float, start: Snapshot, report: StepReport, before: Balance) -> StepReport:
        """The step once more by backward Euler, linearised about where it ends, which is what one linearisation from
        afar lacks. (Newmark neither makes nor loses energy where forces are linear; stiff cloth that is struck is not.)

        Where that fails, or makes more energy still, the step stays as it was.
        """
        first, end, usual = gained(self, report, before), Snapshot(self.state), self.dynamics_of
        start.restore(self.state)
        self.more, other = MORE, None
        try:
            if not isinstance(usual, BackwardEuler):
                self._use(BackwardEuler(self))
            other = self._advance(dt, self.options.halvings)
        except (FloatingPointError, np.linalg.LinAlgError, StepError):
            pass
        finally:
            self.more = 0
            self._use(usual)
        if other is None or other.status == "failed" or gained(self, other, before) > first:
            end.restore(self.state)
            return report
        return other

    def _refined(self, contacts: Contacts, attempt: Attempt, pushable: Pushable) -> Refined:
        """Refinement of an attempt; the first rows for crossings are those that say most."""
        looks = iter((lambda found: self.detector.chosen(found, attempt.s0),))

        def choose(found: Contacts) -> Contacts:
            return pushable.of(next(looks, first_met)(found))

        return refine(contacts, attempt.solve, pushable.crossed, self.options.rounds, choose)

    def _halved(self, attempt: Attempt, h: float, depth: int) -> StepReport:
        """Two halves instead of an attempt."""
        self.dynamics_of.take_back(attempt)
        if depth == 0:
            return self._failed(h, "velocities are no longer finite numbers")
        first = self._advance(0.5 * h, depth - 1)
        if first.status == "failed":
            return first
        second = self._advance(0.5 * h, depth - 1)
        return second if second.status == "failed" else merge_reports(first, second)

    def _last_resort(self, attempt: Attempt, refined: Refined, pushable: Pushable) -> StepReport:
        """Move whatever still crosses rigidly."""
        dynamics = self.dynamics
        attempt.rough = False  # zones take the motion as it is: nothing is solved again
        v, crossed, why = None, attempt.lost, "contact forces have no solution"
        if attempt.solution is not None:  # else there is no motion to begin with
            why = "prescribed motions press them together"
            with self.timed("zones"):
                zones = Zones(dynamics.nodes(attempt.a, attempt.prescribed), attempt.closing.e)
                v, crossed = clear_with_zones(
                    zones, refined.crossed, attempt.v, attempt.moved, pushable.crossed, self.surfaces, dynamics.block_of
                )
        if v is None and self._may_wait():
            return self._wait(attempt, crossed)
        if v is None:
            self.dynamics_of.take_back(attempt)
            return self._failed(attempt.h, f"no motion keeps apart {self._named(crossed) or 'bodies'}: {why}")
        report = self._commit(attempt, refined)
        report.last_resorts = 1
        return report

    def _may_wait(self) -> bool:
        """Whether scripts move that may wait where they make a step impossible."""
        return self.options.on_impossible == "stall" and not self.dynamics.waiting and self._scripts

    def _wait(self, attempt: Attempt, pressed: Contacts) -> StepReport:
        """The step of an attempt once more, with all scripts at rest."""
        self.dynamics_of.take_back(attempt)
        self.dynamics.waiting = True
        try:
            report = self._advance(attempt.h, self.options.halvings)
        finally:
            self.dynamics.waiting = False
        if report.status != "failed":
            late = self.state.script_delay
            report.messages.append(f"scripts wait, {late:.3g} s late: they press together {self._named(pressed)}")
            report.status = "degraded"
        return report

    def _named(self, contacts: Contacts) -> str:
        """The bodies of contacts, by name."""
        shape = self.surfaces.shape[contacts.vertices]
        pairs = np.unique(np.sort(shape[:, [0, 3]], axis=1), axis=0)
        names = [s.name for s in self.model.shapes]
        told = [f"'{names[a]}' and '{names[b]}'" if a != b else f"'{names[a]}' and itself" for a, b in pairs[:TOLD]]
        return ", ".join(told) + (" and others" if len(pairs) > TOLD else "")

    def check_start(self) -> None:
        """Refuse a state that intersects, with the pairs in a StepError, or begin to let it apart."""
        self.opening = None
        found = self._crossings(touching=True)
        if len(found) == 0:
            return
        if self.options.on_intersection == "grow":
            self.opening = Opening(self.surfaces, self._intersections)
            return
        names = [s.name for s in self.model.shapes]
        of_edge, of_face = (
            self.surfaces.shape[self.surfaces.edges[:, 0]],
            self.surfaces.shape[self.surfaces.faces[:, 0]],
        )
        pairs, counts = np.unique(
            np.sort(np.stack([of_edge[found[:, 0]], of_face[found[:, 1]]], axis=1), axis=1), axis=0, return_counts=True
        )
        told = [
            f"'{names[a]}' and {'itself' if a == b else repr(names[b])} ({n} edges through faces)"
            for (a, b), n in zip(pairs[:10], counts[:10], strict=True)
        ]
        raise StepError(
            f"bodies intersect: {', '.join(told)}; move them apart, leave the pair out with contact.ignore, or let them apart with contact.on_intersection: grow"
        )

    def _crossings(self, touching: bool) -> np.ndarray:
        """Edges and faces that meet at the state, (k, 2); measured on positions alone."""
        return self._intersections.find(self.surfaces.positions(self.state.positions()), touching)

    def _tell_crossings(self, report: StepReport) -> None:
        """Edges that still cross faces after a step; without any, contact is on for everything."""
        assert self.opening is not None
        left = self.opening.look(self.surfaces.positions(self.state.positions()))
        if left == 0:
            self.opening = None
            return
        if self.opening.stuck:
            raise StepError(
                f"{left} crossings of the start have not become fewer for {PATIENCE} steps; move the bodies apart"
            )
        report.messages.append(f"bodies that intersected are let apart: {left} edges through faces are left")
        report.status = "degraded"

    def _commit(self, attempt: Attempt, refined: Refined) -> StepReport:
        state, dynamics, h = self.state, self.dynamics, attempt.h
        assert attempt.solution is not None
        scheme = self.dynamics_of
        if self.dynamics.waiting:
            state.script_delay += h
        if isinstance(scheme, Explicit) and scheme.stays(attempt):
            self._remember(attempt, attempt.solution.impulse)
            report = scheme.leave(attempt)
            self._count(report, attempt, refined)
            return report
        q = attempt.q1
        u, attempt.kept_impulse = without_recovery(attempt)
        v = end_velocities(attempt, u)
        self._remember(attempt, attempt.kept_impulse)
        body = self.model.body_of[dynamics.slaves]
        speeds = v[: self.model.points].copy()
        arm = rotate(q[body], self.model.rigid.local[dynamics.slaves])
        centre = self.model.points + 2 * body
        speeds[dynamics.slaves] = v[centre] + np.cross(v[centre + 1], arm)
        state.now.x.assign(np.ascontiguousarray(attempt.x1))
        state.now.v.assign(np.ascontiguousarray(speeds))
        for name, values in (
            ("x", attempt.bx1),
            ("q", q),
            ("v", v[self.model.points :: 2]),
            ("w", v[self.model.points + 1 :: 2]),
        ):
            getattr(state.rigid, name).assign(np.ascontiguousarray(values))
        state.time = attempt.time0 + h
        state.dt = h
        state.stale = isinstance(scheme, Explicit)  # what it remembers is made anew
        state.activated = False
        self._known = np.array(attempt.x1)
        report = StepReport(time=state.time, dt=h)
        self._count(report, attempt, refined)
        with self.timed("report"):
            if isinstance(scheme, Explicit):
                forces = scheme.set_aside()
                self.reports.measure(attempt, v, report)
                scheme.add_to(report, forces)
            else:
                self.reports.measure(attempt, v, report)
        if not attempt.solution.converged:
            report.messages.append(f"contact forces missed their conditions by {attempt.solution.residual:.1e} m/s")
        if attempt.limits.over > ALLOWED:
            report.messages.append(f"strain limits are passed by {attempt.limits.over:.1e} of the length")
        self.joint_reports.report(report, self.model.size)
        report.broken += break_rows(self.model, state) + self.joint_reports.break_joints()
        report.status = "degraded" if report.messages else "ok"
        return report

    def _count(self, report: StepReport, attempt: Attempt, refined: Refined) -> None:
        """Rounds, contacts and gaps of the last solve."""
        assert attempt.solution is not None
        report.rounds, report.contacts = refined.rounds, attempt.solved.count
        report.iterations.update(attempt.iterations)
        report.touching = int((attempt.solution.impulse[: report.contacts, 0] > 0.0).sum())
        gap = self.detector.smallest_gap
        report.smallest_gap = gap if np.isfinite(gap) else None
        with self.timed("report"):
            report.intersections = len(self._crossings(touching=False))
        if report.intersections and self.opening is None:
            report.messages.append(f"{report.intersections} edges go through faces")
            report.status = "degraded"

    def _is_known(self) -> bool:
        """Whether points are where the last step has put them, whatever else was changed."""
        return self._known is not None and np.array_equal(self._known, host(self.state.now.x))

    def _remember(self, attempt: Attempt, impulse: np.ndarray) -> None:
        """What contacts pushed with in the step, in their frames (m, 3), less what only let bodies apart."""
        r = impulse[: attempt.solved.count]
        tangential = np.linalg.norm(r[:, 1:], axis=1)
        sliding = (r[:, 0] > 0.0) & (tangential >= attempt.friction[: len(r)] * r[:, 0] * (1.0 - 1e-6))
        end = attempt.gap[: len(r)] + attempt.h * (attempt.rows @ attempt.v.ravel())[: 3 * len(r) : 3]
        yielding = attempt.yields[: len(r)] & (r[:, 0] > 0.0) & (end < attempt.asked[: len(r)])
        self.memory.keep(attempt.solved, np.einsum("mij,mi->mj", attempt.frame[: len(r)], r), sliding, yielding)

    def _failed(self, h: float, what: str) -> StepReport:
        advice = "take a smaller dt, or see what presses the bodies together"
        return StepReport(
            status="failed", messages=[f"{what}; the last good state stands: {advice}"], time=self.state.time, dt=h,
            energies=dict(self.state.energies),
        )  # fmt: skip
