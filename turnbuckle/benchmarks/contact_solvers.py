"""The paper's solvers in place of ours inside a step, counted and timed: what Figure 6 and the histograms compare.

Each has the signature that `ContactStepper` calls. Free velocities v* come from our own solver, whichever is measured.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import turnbuckle
from turnbuckle.data.contact import ContactProblem, ContactSolution
from turnbuckle.data.errors import InputError
from turnbuckle.solvers.contact import ica
from turnbuckle.solvers.contact.newton import NewtonSolver

METHODS = ("newton", "ica", "anticipation")
FREE = 1e-6  # of the tolerance: to what free velocities are solved
SAME = 0.05  # change of a residual that counts as none (5.5)


@dataclass
class PaperSolver:
    """`ica` with the paper's stopping rule (5.5), or `anticipation`, the full Schur complement (5.1).

    What does not converge is solved by our own solver instead, and counted.
    """

    method: str
    ours: NewtonSolver
    allowance: float  # [m/s] half the detection tolerance over dt: how fast a gap may close (5.5)
    most: int = 500  # outer iterations, or sweeps
    inner: list[int] = field(default_factory=list)  # sweeps of each inner loop
    outer: list[int] = field(default_factory=list)  # iterations of each solve
    missed: int = 0  # solves that did not converge
    apart: float = 0.0  # [m/s] the largest difference from our velocities, where they are compared
    compare: bool = False
    _asked: tuple[np.ndarray, np.ndarray] = field(
        default_factory=lambda: (np.zeros(0), np.zeros(0))
    )  # what _free is of
    _free: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def solve(
        self,
        problem: ContactProblem,
        start: np.ndarray | None,
        velocity: np.ndarray | None,
        tolerance: float,
        max_iterations: int,
        known: int | None = None,
    ) -> ContactSolution:
        """As `NewtonSolver.solve`."""
        before, load = self._asked  # a later round of the same step asks with the same; v is that of the round before
        again = np.array_equal(problem.free, before) and np.array_equal(problem.load, load)
        if not again:
            self._asked = problem.free.copy(), problem.load.copy()
            self._free = self._unconstrained(problem, tolerance, max_iterations)
        given = replace(problem, free=self._free, load=None)
        if self.method == "anticipation":
            found = full_anticipation(given, start, tolerance, self.most, self.allowance)
        else:
            with counted(self.inner):
                found = ica.solve_ica(
                    given,
                    start,
                    tolerance,
                    self.most,
                    velocity=velocity if again else None,
                    stopping="paper",
                    allowance=self.allowance,
                )
            if problem.count:
                self.outer.append(found.iterations["outer"])
        if not found.converged or not np.isfinite(found.velocity).all():
            self.missed += 1
            return self.ours.solve(problem, start, velocity, tolerance, max_iterations)
        if self.compare:
            judge = self.ours.solve(problem, start, velocity, tolerance, max_iterations)
            self.apart = max(self.apart, float(np.abs(found.velocity - judge.velocity).max()))
        return found

    def _unconstrained(self, problem: ContactProblem, tolerance: float, max_iterations: int) -> np.ndarray:
        n = len(problem.free)
        none = sp.bsr_array((np.zeros((0, 3, 3)), np.zeros(0, np.int32), np.zeros(1, np.int32)), shape=(0, n))
        alone = replace(problem, j=none, floor=np.zeros(0), friction=np.zeros(0), e=None, wanted=np.zeros(0))
        return self.ours.solve(alone, None, None, FREE * tolerance, max_iterations).velocity


def full_anticipation(
    problem: ContactProblem, start: np.ndarray | None, tolerance: float, most: int, allowance: float
) -> ContactSolution:
    """Constraint anticipation as the paper compares it, without friction: B = J A^-1 J^T, dense, projected Gauss-Seidel (5.1).

    It ends by the rule of 5.5 or below ``tolerance`` [m/s], as `ica` does. (`solve_anticipation` has friction and joints, and goes on to round-off.)
    """
    if problem.e is not None or (problem.friction > 0.0).any():
        raise InputError("full anticipation is compared without friction and without joints only; set mu to 0")
    n = len(problem.free)
    moves = np.flatnonzero(np.ones(n, bool) if problem.fixed is None else ~np.repeat(problem.fixed, 3))
    j = sp.csr_array(problem.j)[0::3][:, moves]
    a = sp.csc_array(sp.csr_array(problem.a)[moves][:, moves])
    factor = spla.splu(a, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    x = factor.solve(np.ascontiguousarray(j.T.toarray())) if problem.count else np.zeros((len(moves), 0))
    b = j @ x
    own = np.diag(b)
    r = np.zeros(problem.count) if start is None else np.array(start[:, 0], dtype=float)
    u = b @ r + (problem.j @ problem.free)[0::3] - problem.floor
    before, sweeps, worst = np.nan, 0, 0.0
    while True:
        worst = float(np.abs(np.minimum(u, own * r)).max(initial=0.0))
        same = abs(worst - before) <= SAME * before or worst <= tolerance
        converged = bool(same and (u >= -allowance).all())
        if converged or sweeps >= most:
            break
        for i in range(problem.count):
            change = max(-u[i] / own[i], -r[i])
            if change != 0.0:
                r[i] += change
                u += change * b[i]
        before, sweeps = worst, sweeps + 1
    velocity = problem.free.copy()
    velocity[moves] += x @ r
    impulse = np.stack([r, np.zeros_like(r), np.zeros_like(r)], axis=1)
    return ContactSolution(velocity, impulse, np.zeros(0), {"sweeps": sweeps}, worst, converged)


def plugged(simulation: turnbuckle.Simulation, method: str) -> PaperSolver | NewtonSolver:
    """The solver of that name for this simulation; put it into ``simulation.stepper.solver``."""
    ours = simulation.stepper.solver
    if method == "newton":
        return ours
    delta = float(simulation.model.surfaces.delta.min())
    return PaperSolver(method, NewtonSolver(simulation.model.device), 0.5 * delta / simulation.dt)


@contextmanager
def counted(inner: list[int]) -> Iterator[None]:
    """Write down the sweeps of each inner loop of `solve_ica` that has contacts to sweep over."""
    contacts = ica._Passes.contacts

    def count(passes: ica._Passes, most: int, paper: bool, target: float, allowed: float) -> int:
        sweeps = contacts(passes, most, paper, target, allowed)
        if passes.problem.count:
            inner.append(sweeps)
        return sweeps

    ica._Passes.contacts = count
    try:
        yield
    finally:
        ica._Passes.contacts = contacts
