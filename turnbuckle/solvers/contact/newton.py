"""The default solver: an augmented Lagrangian, semi-smooth Newton steps and preconditioned conjugate gradients.

With u = J v, De Saxce's shift ``mu |u_t|`` makes Coulomb's law a projection on the cone K = {|r_t| <= mu r_n}:

    r = P_K(l - rho (u - floor + shift)),        l = r.

For given multipliers l and shifts, v minimises the convex function

    (v - v*) . A (v - v*) / 2 - v . load  +  sum |r(v)|^2 / (2 rho),    g = A (v - v*) - load - J^T r,

by Newton's method with the matrix ``A + J^T D J``, D = rho dP_K/ds (symmetric, semi-definite), to a part of what the
multipliers still miss; then l <- r(v), shift <- mu |u_t|, until nothing moves any more: then (6), (7) hold. rho is a
small multiple of the contact's own stiffness: that keeps the matrix nearly as well conditioned as A, and multipliers
settle by about 1 / (1 + rho w) a round, w the compliance of the contact in its bodies. Warm starts make the rest.

Equality rows are kept exactly in every iterate: conjugate gradients run in their null space (`newton_equality`).
"""

import numpy as np
import scipy.sparse as sp
import warp as wp

from turnbuckle.compute import host
from turnbuckle.data.contact import ContactProblem, ContactSolution
from turnbuckle.linalg.skyline import SkylineFactors, find_parts
from turnbuckle.solvers.contact import newton_kernels as kernels
from turnbuckle.solvers.contact.newton_buffers import Buffers
from turnbuckle.solvers.contact.newton_drift import Drift
from turnbuckle.solvers.contact.newton_equality import EqualityRows
from turnbuckle.solvers.contact.newton_errors import LOST, Errors
from turnbuckle.solvers.contact.newton_programs import Programs
from turnbuckle.solvers.contact.newton_region import MOST, NOTABLE, SETTLED, SLIGHT
from turnbuckle.solvers.contact.newton_search import best_length
from turnbuckle.solvers.contact.splitting import Splitting

SCALE = 2.0, 0.3  # rho times the compliance of a contact by itself; where small bodies are factored
FORCING = 0.2, 0.02  # part of the gradient that conjugate gradients may leave: at first,
STUBBORN = 40  # and after so many steps
GATE = 1.5  # multipliers are updated once the gradient is below this times what they miss by
TILES = 64
SMALL = 500  # blocks and contacts below which one thread does all
PARALLEL = 8_000  # blocks and contacts below which threads lose more at their meetings than they save
FEW = 3_000  # blocks around a region below which that is so for it
AGAIN = 3  # Newton steps between two factorisations of small bodies, which hold what their contacts add to the diagonal
TURNS = 20  # updates in which shifts that swing are not held, then as many in which they are: what goes round in one ends in the other
SHORTEST = 0.25  # steps of such shifts, times the usual at least
KNOWN = 2  # patterns of A that are kept
EXACT = 1e-3  # of the tolerance: a start that misses by less needs no step; others get one, so that rest becomes exact


class Bodies:
    """What one pattern of A gives, and the programs for it."""

    def __init__(self, a: sp.bsr_array, held: np.ndarray, device: str) -> None:
        """``held`` (n,) bool: blocks that equality rows act on. Small bodies without them are factored."""
        parts = find_parts(a.indptr, a.indices, held)
        self.factors = SkylineFactors(parts, device) if parts.count else None
        self.part = parts.part
        self.apart = (parts.local >= 0).astype(np.uint8)
        self.drift = Drift(a.indptr, a.indices, held)
        self.single = np.diff(a.indptr) == 1
        self.key: tuple = ()  # of the programs: what they were recorded for
        self.programs: Programs


class NewtonSolver:
    """Keeps its arrays and recorded launches between calls."""

    def __init__(self, device: str = "cpu", threads: int | None = None) -> None:
        self.device, self.threads = device, threads
        self._on_gpu = wp.get_device(device).is_cuda
        self.buffers = Buffers(device)
        self.rows: EqualityRows | None = None
        self.bodies: Bodies
        self._known: dict[tuple, Bodies] = {}
        self._count = -1  # contacts of the last problem
        self.splitting = Splitting(self.buffers, self._run, self._evaluate)

    def solve(
        self,
        problem: ContactProblem,
        start: np.ndarray | None = None,
        velocity: np.ndarray | None = None,
        tolerance: float = 1e-8,
        max_iterations: int = 200,
        known: int | None = None,
    ) -> ContactSolution:
        """Velocities and impulses; ``start`` (m, 3) and ``velocity`` (3 n,) are guesses. Tolerance in m/s.

        A guess within the tolerance is improved once all the same: what rests comes to rest over the steps.
        ``known``: the matrix, loads and the first so many contacts are those of the last call, which were all of it, and
        what was made for them is kept. Not for problems with equality rows.
        Velocities that are no numbers end it with a message.
        """
        n, m = len(problem.free) // 3, problem.count
        b = self.buffers
        if known is None or known != self._count:
            known = None
            self._take(problem)
        elif known < m:
            b.take_rows(problem, self._tiles(n, m))
            self._record(self._tiles(n, m), self._threads(n, m))
        self._count = m
        b.write("kept", np.array([known or 0], dtype=np.int32))
        guess = np.array(problem.free if velocity is None else velocity, dtype=float).reshape(-1, 3)
        if problem.fixed is not None:
            guess[problem.fixed] = problem.free.reshape(-1, 3)[problem.fixed]
        b.write("v", guess)
        b.write("multiplier", np.zeros((m, 3)) if start is None else start)
        b.write("scale", np.array([SCALE[self.bodies.factors is not None]]))
        b.write("goal", np.array([tolerance]))
        b.write("forcing", np.array([FORCING[0]]))
        b.write("missed", np.full(m, np.inf))
        b.write("stride", np.zeros(m))
        self._run("begin")  # penalties of a last call may have grown
        if self.rows is not None:
            self.rows.meet()
        split = self.splitting.start(n, m, tolerance, known == m) if m and self.rows is None and self._small else 0
        self._run("first_shift")
        newton = updates = cg = full = 0
        converged, message = False, ""
        errors = self._evaluate()
        exact, again = EXACT * tolerance, 1 if self.bodies.factors is None else AGAIN
        for _ in range(max_iterations):
            if not errors.worst < LOST:
                message = "velocities are no longer finite numbers"
                break
            if errors.worst <= tolerance and (newton > 0 or split > 0 or errors.worst <= exact):
                converged = True
                break
            if errors.gradient <= max(GATE * errors.multipliers, exact):
                b.write("shortest", np.array([SHORTEST if (updates // TURNS) % 2 else 1.0]))
                errors = self._update(SLIGHT * tolerance if updates else 0.0)
                updates += 1
            if errors.gradient <= (SETTLED * tolerance if newton else exact):
                continue
            part = "some " if newton + split and self._region(errors.gradient, tolerance) else ""
            if part or full % again == 0:
                self._run(part + "blocks")
            if self.bodies.factors is not None and (part or full % again == 0):
                self._run(part + "factor")
                self.splitting.lost(host(b.some_parts)[: host(b.sizes)[kernels.PARTS]] if part else slice(None))
            full += not part
            tries, errors = self._newton_step(part)
            cg += tries
            newton += 1
            if newton == STUBBORN:
                b.write("forcing", np.array([FORCING[1]]))
        converged |= not message and errors.worst <= tolerance
        equality = np.zeros(0) if self.rows is None else self.rows.impulse
        return ContactSolution(
            velocity=b.read("v", n).ravel(), impulse=b.read("r", m), equality=equality,
            iterations={"splitting": split, "newton": newton, "multipliers": updates, "cg": cg}, residual=errors.worst,
            converged=converged, message=message,
        )  # fmt: skip

    # ------------------------------------------------------------------------------------------------------------------

    def _take(self, problem: ContactProblem) -> None:
        """Make all that a problem needs but guesses."""
        n, m, b = len(problem.free) // 3, problem.count, self.buffers
        self.rows = None
        b.take(problem, self._tiles(n, m))
        if problem.e is not None and problem.e.shape[0]:
            self.rows = EqualityRows(problem, b)
        self._find_bodies(problem)
        bodies = self.bodies
        self.splitting.take(bodies.part, 0 if bodies.factors is None else bodies.factors.parts.count)
        b.put("apart", bodies.apart, wp.uint8)
        b.put("mass", bodies.drift.masses, wp.float64)
        moving = np.ones(n, dtype=bool) if problem.fixed is None else ~problem.fixed
        self._small = bool((bodies.apart.astype(bool) | bodies.single | ~moving).all())
        self._record(self._tiles(n, m), self._threads(n, m))

    @property
    def _local(self) -> bool:
        """Whether steps may be of a region: one processor finds it, and equality rows reach anywhere."""
        return self.rows is None and not self._on_gpu

    @staticmethod
    def _tiles(n: int, m: int) -> int:
        return TILES if max(n, m) > SMALL else 1

    def _threads(self, n: int, m: int) -> int | None:
        return 1 if self.threads is None and max(n, m) < PARALLEL else self.threads

    def _region(self, gradient: float, tolerance: float) -> bool:
        """Find the blocks that the next step is to move; False where that are all."""
        if not self._local:
            return False
        least = max(NOTABLE * gradient, SETTLED * tolerance)
        if (self._speeds > least).any():  # bodies are to move as a whole
            blocks, speeds = self.bodies.drift.blocks(self._speeds, least)
            miss = self.buffers.read("miss", self._blocks)
            miss[blocks] = np.maximum(miss[blocks], speeds)
            self.buffers.write("miss", miss)
        self.buffers.write("least", np.array([least]))
        self._run("region")
        return bool(host(self.buffers.sizes)[kernels.SOME] <= MOST * self._blocks)

    def _update(self, least: float) -> Errors:
        """Update the multipliers and shifts that miss by more than ``least`` [m/s]."""
        part = "some " if self._local else ""
        if part:
            self.buffers.write("least", np.array([least]))
            self._run("unsettled")
        self._run(part + "update")
        return self._evaluate(part)

    def _evaluate(self, part: str = "") -> Errors:
        self._run(part + "evaluate")
        values = host(self.buffers.scalars)
        gradient = float(values[kernels.GRADIENT])
        if self.rows is not None:
            gradient = self.rows.remove()
        self._speeds = self.bodies.drift.speeds(host(self.buffers.g)[: self._blocks])
        gradient = max(gradient, float(self._speeds.max(initial=0.0)))
        return Errors(gradient, float(values[kernels.PRIMAL]), float(values[kernels.SHIFT]))

    def _newton_step(self, part: str) -> tuple[int, Errors]:
        """One step, as long as is best; iterations of conjugate gradients, and the errors after it.

        ``part``: "" for a step of all blocks, "some " for those of the region.
        """
        self._run(part + "newton")
        scalars = host(self.buffers.scalars)
        while scalars[kernels.DONE] == 0.0:
            self._run(part + "iterate")
            scalars = host(self.buffers.scalars)
        tries = int(scalars[kernels.TRIES])
        self._run(part + "slopes")

        def look(length: float) -> np.ndarray:
            self.buffers.write("length", np.array([length]))
            self._run(part + "along")
            return host(self.buffers.slopes)

        length = best_length(host(self.buffers.slopes), look)
        self.buffers.write("length", np.array([length]))
        self._run(part + "move")
        return tries, self._evaluate(part)

    def _run(self, name: str) -> None:
        few = name.startswith("some ") and host(self.buffers.sizes)[kernels.AROUND] < FEW
        self._programs.run(name, 1 if few else None)

    def _find_bodies(self, problem: ContactProblem) -> None:
        """What is kept for the pattern of A: the two that took turns last, since joints come and go within a step."""
        a = problem.a
        held = np.zeros(len(problem.free) // 3, dtype=bool)
        if self.rows is not None:
            held[self.rows.full.indices // 3] = True
        key = (a.indptr.tobytes(), a.indices.tobytes(), held.tobytes(), self.rows is None)
        found = self._known.pop(key, None)
        self._known[key] = self.bodies = found or Bodies(a, held, self.device)
        if len(self._known) > KNOWN:
            del self._known[next(iter(self._known))]
        self._blocks = len(held)
        self.bodies.drift.take(a, problem.fixed)

    def _record(self, tiles: int, threads: int | None) -> None:
        key = (self.buffers.grown, tiles, threads)
        if key != self.bodies.key:
            calls = (None, None)
            if self.rows is not None:
                calls = (lambda: self.rows.take_out(), lambda: self.rows.project())  # of the rows of now
            self.bodies.key = key
            self.bodies.programs = Programs(self.buffers, self.device, tiles, threads, self.bodies.factors, *calls)
        self._programs = self.bodies.programs


def solve_newton(
    problem: ContactProblem,
    start: np.ndarray | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    device: str = "cpu",
) -> ContactSolution:
    """One solve (see the module). Use `NewtonSolver` where many problems follow each other."""
    return NewtonSolver(device).solve(problem, start, None, tolerance, max_iterations)
