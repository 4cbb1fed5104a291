"""One attempt at a step with contact: its system, and the solve that refinement asks for (Contact, 3 and 4)."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from turnbuckle.contact.manifold import no_contacts
from turnbuckle.contact.ways import KEPT
from turnbuckle.data.contact import ContactProblem, Contacts, ContactSolution
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.ica import solve_ica
from turnbuckle.step.contact_closing import Closing, Motion
from turnbuckle.step.contact_dynamics import Prescribed
from turnbuckle.step.contact_equality import split
from turnbuckle.step.contact_limits import Limits, stacked
from turnbuckle.step.contact_rows import contact_rows, frames
from turnbuckle.step.contact_tolerance import solver_tolerance

if TYPE_CHECKING:
    from turnbuckle.step.contact_step import ContactStepper

NEAR = 0.6  # of delta: contacts nearer than this are let apart; between, they stay, since parting costs energy
HELD = 0.45  # of delta: what rows on the way ask of what was near at the start
RECOVERED = 0.2  # part of what a contact is too near by that a step gives back
SLIDING = 10.0  # of the tolerance: tangential speeds at the start beyond which a contact slides
MISSED = 2.0  # of the tolerance: rows that an unconverged solution misses by more
YIELD = 0.7  # ask for this part of what they did,
YIELDS = 3  # so many times an attempt,
RETRIED = 50  # and go on so as long as they push; in one of so many steps it is tried without
FAR = 1e3  # times the size of the scene: motion in a step that is none
ROUGH = 5.0  # times the tolerance, while contacts are still being found
FEW = 60  # contacts that are solved anew by the dense solver where the default one does not converge
SWEEPS = 500  # of it: what is pressed together beyond hope must not take minutes
FREE = 1e-6  # of the tolerance: to what free velocities are solved where a solver asks for them


class Attempt:
    """One attempt at a step of ``h``: its system, and the solve that refinement calls."""

    def __init__(self, stepper: "ContactStepper", h: float) -> None:
        self.stepper, self.h = stepper, h
        model, state, dynamics = stepper.model, stepper.state, stepper.dynamics
        self.time0, self.dt0 = state.time, state.dt
        dynamics.begin()
        self.x0 = dynamics.x0
        self.v0 = dynamics.velocities()
        equal = split(state, h, model.body_of)
        self.prescribed: Prescribed = dynamics.prescribe(h, equal.nails)
        self.nails = equal.nails
        self.v0[self.prescribed.fixed] = self.prescribed.velocity[self.prescribed.fixed]
        self.arms = dynamics.arms(self.x0)
        self.closing = Closing(h, equal.rows, stepper.map, stepper.joints, self.arms, self.v0)
        self.s0 = stepper.surfaces.positions(self.x0)
        stepper.detector.forget()
        self.v = self.v0.copy()
        self.solution: ContactSolution | None = None
        self.solved = no_contacts()  # the contacts of the last solution
        self.frame = np.zeros((0, 3, 3))
        self.impulse = np.zeros((0, 3))  # world
        self.friction = np.zeros(0)
        self.yields = np.zeros(0, dtype=bool)  # what is squeezed, and comes nearer than at the start
        self.asked = np.zeros(0)  # [m] what rows would ask for if nothing yielded
        self.gap, self.target = np.zeros(0), np.zeros(0)  # [m] of rows at the start, and what they ask for at the end
        self.rows = _no_rows(3 * dynamics.n)
        self.tolerance = solver_tolerance(stepper, np.linalg.norm(self.v0[~self.prescribed.fixed], axis=1), h)
        self.iterations: dict[str, int] = {}
        self.solved_rows: int | None = None  # of the last solve, where A and loads are the same still
        self.free: np.ndarray | None = None
        self.limits = Limits(self)
        self.parting = np.zeros(0)  # [m/s] at which crossings part
        if stepper.opening is not None:
            stepper.opening.look(self.s0)
            self.parting = np.full(stepper.opening.count, stepper.options.recovery)
        self.started = False
        self.tries = YIELDS
        self.lost = no_contacts()  # what a solution that is none misses
        # Where the last step found contacts on its way, the first ones are not the last: no need for all digits.
        self.rough = state.contact_found and not self.closing.exists
        state.contact_found = False
        self.a: sp.bsr_array
        self.base: np.ndarray  # (n, 3) of `ContactProblem.free`
        self.load: np.ndarray | None  # (n, 3)
        self.given: np.ndarray  # (n, 3) [N s] what the user pushes with
        with stepper.timed("forces"):
            self.began = stepper.dynamics_of.begin(self)
        self.closing.v0 = self.base

    def again(self) -> bool:
        """Linearise about the motion as it is; False where the scheme has nothing to gain from that."""
        with self.stepper.timed("forces"):
            if not self.stepper.dynamics_of.again(self):
                return False
        self.renewed()
        return True

    def renewed(self) -> None:
        """A, base and loads are others than before: nothing that was made of them holds."""
        self.free, self.closing.v0, self.solved_rows = None, self.base, None

    def solve(self, contacts: Contacts) -> np.ndarray | None:
        """Velocities under these contacts; positions of surface vertices at the end of the step."""
        stepper = self.stepper
        with stepper.timed("rows"):
            base = self._problem(contacts)
        self.closing.start()
        self.limits.start()
        s1 = self.moved(self.v)
        while True:  # once, where no row turns with the motion
            with stepper.timed("rows"):
                limited = self._limited(base)
                problem = self.closing.put(limited, self._motion()) if self.closing.exists else limited
                start = np.einsum("mij,mj->mi", self.frame, self.impulse)
                start = np.concatenate([start, self.limits.impulse, np.zeros((len(self.parting), 3))])
            with stepper.timed("contact_solve"):
                found = self._solved(problem, start)
            for name, count in found.iterations.items():
                self.iterations[name] = self.iterations.get(name, 0) + count
            if "diverged" in found.message or not self._sound(found):  # halve the step (Contact, 5.6)
                self.lost = contacts.part(self._missed(problem, found.velocity, contacts))
                return None
            if not found.converged and self._give_way(problem, found.velocity, contacts):
                base = self._problem(contacts)
                continue
            self.solution, self.solved, self.problem = found, contacts, problem
            m = contacts.count
            self.impulse = np.einsum("mij,mi->mj", self.frame, found.impulse[:m])
            s1 = self.moved(found.velocity.reshape(-1, 3))
            if self.limits.exists and not self.limits.kept(found.impulse[m : m + self.limits.count], self.x1):
                continue
            if not self.closing.exists or self.closing.closed(found.equality, self._motion()):
                return s1
            if self.closing.polish(limited, self._motion(), self.tolerance, self._move):
                return stepper.surfaces.positions(self.x1)

    def _sound(self, found: ContactSolution) -> bool:
        """Whether velocities are finite numbers, and, where they are no solution, not beyond all measure."""
        fastest = float(np.abs(found.velocity).max(initial=0.0))
        if not fastest < np.inf:
            return False
        near = found.converged or fastest * self.h < FAR * self.stepper.model.size
        return near or self.stepper.dynamics.waiting  # for scripts that wait zones of impact make a motion of anything

    def _give_way(self, problem: ContactProblem, velocity: np.ndarray, contacts: Contacts) -> bool:
        """Let contacts that a solution misses come nearer, where they may; False where there are none, or it was tried.

        Rows ask for the distance at the start, though less is certified: between two scripts that close there is no
        motion that keeps both distances, while there is room for what lies between them.
        """
        if self.stepper.options.on_impossible == "stall":  # scripts wait instead
            return False
        missed = self._missed(problem, velocity, contacts)
        if (
            self.tries == 0
            or self.stepper.options.rows == "velocity"
            or not self._scripted(contacts.part(missed)).any()
        ):
            return False
        delta = self.stepper.detector.deltas(contacts.kind, contacts.a, contacts.b)
        least = np.minimum(contacts.distance, KEPT * delta)  # what was nearer still need not be let apart
        some = missed[self.target[missed] > least[missed]]
        self.tries -= len(some) > 0
        self.target[some] = np.maximum(YIELD * self.target[some], least[some])
        self.yields[some] = True
        self.solved_rows = None  # the solver knows what they asked for
        return len(some) > 0

    def _missed(self, problem: ContactProblem, velocity: np.ndarray, contacts: Contacts) -> np.ndarray:
        """Rows of contacts that velocities miss by more than solvers leave."""
        short = (problem.floor - (problem.j @ velocity)[::3])[: contacts.count]
        return np.flatnonzero(short > MISSED * self.tolerance * (ROUGH if self.rough else 1.0))

    def _scripted(self, contacts: Contacts) -> np.ndarray:
        """Which contacts (m,) have a side whose motion is prescribed."""
        surfaces = self.stepper.surfaces
        ends = surfaces.support[contacts.vertices[:, [0, 3]]]
        free = ~self.prescribed.fixed[self.stepper.dynamics.block_of(ends)] & (
            surfaces.weights[contacts.vertices[:, [0, 3]]] != 0.0
        )
        return ~free.any(axis=2).all(axis=1)

    def _limited(self, problem: ContactProblem) -> ContactProblem:
        """The problem with rows of strain limits after those of contacts, and those of crossings that are to part."""
        others, floors = self.other_rows(self.arms)
        if len(floors) == 0:
            return problem
        j = stacked([problem.j, *others])
        friction = np.concatenate([problem.friction, np.zeros(len(floors))])
        return replace(problem, j=j, floor=np.concatenate([problem.floor, floors]), friction=friction)

    def other_rows(self, arms: np.ndarray) -> tuple[list[sp.bsr_array], np.ndarray]:
        """J of strain limits and of crossings, and what they ask for."""
        limits, opening = self.limits, self.stepper.opening
        j, floors = [], [np.zeros(0)]
        if limits.count:
            j.append(limits.rows())
            floors.append(limits.floor())
        if len(self.parting):
            assert opening is not None
            j.append(opening.rows(arms, self.stepper.map))
            floors.append(self.parting)
        return j, np.concatenate(floors)

    def _move(self, v: np.ndarray) -> Motion:
        self.moved(v)
        return self._motion()

    def _motion(self) -> Motion:
        return Motion(self.v, self.x1, self.bx1, self.q1)

    def crossed(self, s1: np.ndarray, held: np.ndarray | None = None) -> Contacts | None:
        """What the way to ``s1`` comes too near to; a way that is clear by a rough solution is solved in full first.

        None where that solve finds nothing. ``held`` as in `Detector.crossed`.
        """
        with self.stepper.timed("ccd"):
            found = self.stepper.detector.crossed(self.s0, s1, held=held)
        if self.stepper.opening is not None:
            found = self.stepper.opening.without(found)
        self.stepper.state.contact_found |= found.count > 0
        if found.count or not self.rough:
            return found
        self.rough = False
        full = self.solve(self.solved)
        return None if full is None else self.crossed(full, held)

    def touching(self) -> np.ndarray:
        """Which rows of the last solution push, or are at what they ask for (m,) bool."""
        assert self.solution is not None
        above = (self.problem.j @ self.v.ravel())[::3] - self.problem.floor
        return (self.solution.impulse[:, 0] > 0.0) | (above <= self.tolerance)

    def near(self) -> Contacts:
        """What is near at the start."""
        found = self.stepper.detector.near(self.s0, self.moved(self.v0.copy()))
        opening = self.stepper.opening
        return found if opening is None else opening.without(found)

    def expected(self, near: Contacts) -> Contacts:
        """What motion at the velocities of the start would cross, beside what is near: asked in fast motion.

        The first solve then knows most of what it will meet.
        """
        if not self.rough:
            return no_contacts()
        stepper = self.stepper
        with stepper.timed("ccd"):
            crossed = stepper.detector.crossed(self.s0, self.moved(self.v0.copy()), clear=KEPT)
            if stepper.opening is not None:
                crossed = stepper.opening.without(crossed)
            stepper.state.contact_found |= crossed.count > 0
            chosen = stepper.detector.chosen(crossed, self.s0)
        return chosen.part(~stepper.memory.same(chosen, near))

    @staticmethod
    def _alone(problem: ContactProblem) -> ContactProblem:
        """The problem without contacts and equality rows."""
        return replace(
            problem, j=_no_rows(len(problem.free)), floor=np.zeros(0), friction=np.zeros(0), e=None, wanted=np.zeros(0)
        )

    def moved(self, v: np.ndarray) -> np.ndarray:
        """Surface vertices at the end of the step with block velocities v (n, 3), which become those of the attempt."""
        self.v = v
        self.x1, self.bx1, self.q1 = self.stepper.dynamics.moved(v, self.h, self.prescribed)
        return self.stepper.surfaces.positions(self.x1)

    def _problem(self, contacts: Contacts) -> ContactProblem:
        """The problem with these contacts; those of earlier rounds come first, and their rows are kept."""
        stepper, h = self.stepper, self.h
        if contacts.count > len(self.impulse):
            self._add(contacts.part(np.arange(len(self.impulse), contacts.count)))
        floor = (self.target - self.gap) / h
        if stepper.options.rows == "velocity":
            floor = np.zeros(contacts.count)
        return ContactProblem(
            a=self.a, free=self.base.ravel(), j=self.rows, floor=floor, friction=self.friction,
            pairs=stepper.dynamics.pairs, fixed=self.prescribed.fixed, load=None if self.load is None else self.load.ravel(),
        )  # fmt: skip

    def _add(self, fresh: Contacts) -> None:
        """Rows of contacts that are new in this attempt."""
        stepper, surfaces, h = self.stepper, self.stepper.surfaces, self.h
        frame = frames(fresh.normal)
        ratio = h / self.dt0 * stepper.dynamics_of.share if self.dt0 > 0.0 else 1.0
        known, slid, yields = stepper.memory.recall(fresh, ratio)
        mu = surfaces.friction[surfaces.shape[fresh.vertices[:, 0]], surfaces.shape[fresh.vertices[:, 3]]]
        gap = np.einsum("mk,mkd,md->m", fresh.coefficients, self.s0[fresh.vertices], fresh.normal)
        delta = stepper.detector.deltas(fresh.kind, fresh.a, fresh.b)
        apart = np.minimum(
            RECOVERED * np.maximum(self._rest(fresh, delta) - fresh.distance, 0.0), stepper.options.recovery * h
        )
        target = np.where(fresh.distance < delta, fresh.distance + apart, delta)
        turned = (fresh.time > 0.0) & (
            fresh.distance < delta
        )  # the normal is that at the impact: seen along it both are
        target[turned] = np.minimum(target, np.maximum(gap, HELD * delta))[turned]  # nearer, and need not be parted
        self.asked = np.concatenate([self.asked, target])
        if stepper.state.steps % RETRIED:
            target[yields] = np.maximum(YIELD * target, np.minimum(target, KEPT * delta))[yields]  # squeezed still
        rows = contact_rows(surfaces, fresh, frame, self.arms, stepper.map)
        passing = (rows @ self.v0.ravel()).reshape(-1, 3)[:, 1:]  # [m/s] a pair that is new may be of bodies that slid
        slid |= np.linalg.norm(passing, axis=1) > SLIDING * self.tolerance
        self.rows = stacked([self.rows, rows])
        self.frame = np.concatenate([self.frame, frame])
        self.impulse = np.concatenate([self.impulse, known])
        self.friction = np.concatenate([self.friction, np.where(slid, mu[:, 1], mu[:, 0])])
        self.yields = np.concatenate([self.yields, yields])
        self.gap, self.target = np.concatenate([self.gap, gap]), np.concatenate([self.target, target])

    def _rest(self, contacts: Contacts, delta: np.ndarray) -> np.ndarray:
        """What contacts that are nearer are let apart to (m,) [m]; less in folds, which bending opens, and closes."""
        rest = NEAR * delta
        few = np.flatnonzero(contacts.distance < rest)
        folded = few[self.stepper.detector.ghosts.in_folds(contacts.part(few))]
        rest[folded] = KEPT * delta[folded]
        return rest

    def _solved(self, problem: ContactProblem, start: np.ndarray) -> ContactSolution:
        """By the solver that the scene names."""
        stepper, options = self.stepper, self.stepper.options
        if problem.load is None and problem.count == 0 and self.closing.looks == 0:  # free motion, rows and all
            rows = 0 if problem.e is None else problem.e.shape[0]
            return ContactSolution(self.base.ravel(), np.zeros((0, 3)), np.zeros(rows), {}, 0.0, True)
        if problem.load is None and not self.started:  # A is diagonal: what the impulses of the last step make of u*
            self.started = True
            pushed = np.linalg.solve(problem.a.data, (problem.j.T @ start.ravel()).reshape(-1, 3, 1))[:, :, 0]
            self.v = np.where(self.prescribed.fixed[:, None], self.base, self.base + pushed)
        if options.solver == "newton" and options.friction_shape == "cone":
            tolerance = self.tolerance * (ROUGH if self.rough else 1.0)
            plain = problem.j is self.rows and problem.e is None  # contacts alone, those of earlier rounds first
            known, self.solved_rows = self.solved_rows if plain else None, problem.count if plain else None
            found = stepper.solver.solve(problem, start, self.v.ravel(), tolerance, options.max_iterations, known)
            if found.converged or problem.count > FEW or len(problem.free) > 30 * FEW or stepper.hopeless:
                return found
            given = self._with_free(problem)
            other = solve_anticipation(given, found.impulse, self.tolerance, SWEEPS, options.friction_shape)
            stepper.hopeless = not other.converged
            return other if other.converged else found
        given = self._with_free(problem)
        if options.solver == "anticipation":
            return solve_anticipation(given, start, self.tolerance, options.max_iterations, options.friction_shape)
        velocity = None if self.solution is None else self.v.ravel()  # v* first: D_A^-1 hides how stiff bodies fall
        return solve_ica(
            given, start, self.tolerance, options.max_iterations, options.friction_shape, velocity=velocity
        )

    def _with_free(self, problem: ContactProblem) -> ContactProblem:
        """The problem with v* solved for, in place of a load."""
        stepper, options = self.stepper, self.stepper.options
        if self.free is None:
            alone = self._alone(problem)
            self.free = stepper.solver.solve(alone, None, None, FREE * self.tolerance, options.max_iterations).velocity
        return replace(problem, free=self.free, load=None)


def _no_rows(columns: int) -> sp.bsr_array:
    none = (np.zeros((0, 3, 3)), np.zeros(0, np.int32), np.zeros(1, np.int32))
    return sp.bsr_array(none, shape=(0, columns))
