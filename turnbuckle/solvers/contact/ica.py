"""Iterative constraint anticipation (Contact, 5.2 to 5.5): nested relaxation of velocities and of contact impulses.

With ``A = D - L - U``, D block-diagonal, an outer iteration does

    base      v* + D^-1 (L + U) dv                          what the blocks around do to each block        (9)
    impulses  contact on ``base + D^-1 (J^T r + E^T l)``    projected Gauss-Seidel on J D^-1 J^T           (10), (13), (14)
    dv        (D - L) dv' = U dv + J^T r + E^T l            one block Gauss-Seidel iteration               (12)

**Equality rows** ask ``E dv = g``, ``g = wanted - E v*``, of every iterate. In the metric of D the nearest velocities that
do so minimise ``(d - d') D (d - d') / 2``: ``D (d - d') = E^T s`` with ``S s = g - E d'``, ``S = E D^-1 E^T``, factored once.
This projection follows each sweep over the contacts (all equality rows are one exact block of its Gauss-Seidel iteration)
and the refinement; the sum of all s is l. Where nothing changes any more, s = 0 and
``D dv = (L + U) dv + J^T r + E^T l`` is the first equation of the problem.
"""

import numpy as np
import scipy.sparse as sp
import warp as wp

from turnbuckle.data.contact import ContactProblem, ContactSolution
from turnbuckle.data.errors import InputError
from turnbuckle.linalg.factor import Factor
from turnbuckle.solvers.contact import friction_shapes, ica_kernels
from turnbuckle.solvers.contact.block_jacobi import block_rows, contact_blocks, inverse_diagonal, on_pattern, partners
from turnbuckle.solvers.contact.residuals import contact_residuals

DIVERGED = 1e3  # times the least residual so far
INNER = 0.5  # of the outer residual: what the inner loop may leave over
REPEATED = 1e-11  # of its diagonal: what keeps S regular where rows repeat each other
SAME = 0.05  # change of a residual that counts as none (Contact, 5.5)


def solve_ica(
    problem: ContactProblem,
    start: np.ndarray | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 2000,
    friction_shape: str = "cone",
    *,
    velocity: np.ndarray | None = None,
    refinement: str = "gauss_seidel",
    stopping: str = "strict",
    allowance: float | None = None,
    max_inner: int = 20,
    axes: np.ndarray | None = None,
) -> ContactSolution:
    """Solve a contact problem by iterative constraint anticipation.

    ``start`` (m, 3): impulses in the frames of the rows, ``velocity`` (3 n,): both from the last solve, where there was one.
    ``stopping="strict"`` ends with every residual below ``tolerance`` [m/s]; ``"paper"`` with all residuals changing by less
    than 5 % and no gap closing faster than ``allowance`` [m/s] (half the detection tolerance over dt; default: the
    tolerance). ``refinement="jacobi"`` is (9) in place of (12). ``max_inner`` sweeps an outer iteration. Diverges where block
    relaxation of A does (`converged` False, with a message): halve the step then.
    """
    if refinement not in ("gauss_seidel", "jacobi"):
        raise InputError(f"refinement is '{refinement}'; use gauss_seidel or jacobi")
    if stopping not in ("strict", "paper"):
        raise InputError(f"stopping is '{stopping}'; use strict or paper")
    count = friction_shapes.sides(friction_shape)
    axes = friction_shapes.aligned_axes(problem) if axes is None else np.asarray(axes, dtype=float)
    passes = _Passes(problem, count, axes, start, velocity)
    paper = stopping == "paper"
    allowed = tolerance if allowance is None else allowance
    target, least, before, message = 0.5 * tolerance, np.inf, None, ""
    inner, converged, outer, judged = 0, False, 0, None
    while True:
        passes.anticipate()
        passes.look()
        dynamics, contact = passes.dynamics[1], passes.contact[ica_kernels.WORST]
        worst = max(dynamics, contact)
        least = min(least, worst)
        if not np.isfinite(worst) or worst > DIVERGED * max(least, tolerance):
            message = f"relaxation diverged after {outer} iterations; halve the step or use another solver"
            break
        if paper:
            now = np.array([passes.dynamics[0], *passes.contact[ica_kernels.NORMAL : ica_kernels.WORST]])
            if before is not None and (np.abs(now - before) <= SAME * before).all():
                converged = bool(passes.contact[ica_kernels.GAP] <= allowed)
            before = now
            if converged:
                break
        if worst <= target:
            judged = passes.judge(friction_shape, axes)
            if judged <= tolerance:
                converged = True
                break
            target *= 0.3
        if outer >= max_iterations:
            message = f"residual {worst:.1e} m/s after {outer} iterations; allow more, or use another solver"
            break
        inner += passes.contacts(max_inner, paper, max(INNER * worst, 0.1 * target), allowed)
        passes.refine(refinement)
        outer += 1
    return ContactSolution(
        velocity=problem.free + passes.change_host,
        impulse=passes.impulse_host.reshape(-1, 3).copy(),
        equality=passes.equality,
        iterations={"outer": outer, "inner": inner},
        residual=passes.judge(friction_shape, axes) if judged is None or not converged else judged,
        converged=converged,
        message=message,
    )


class _Passes:
    """Arrays of one solve, and the passes over them."""

    def __init__(self, problem, count, axes, start, velocity) -> None:
        self.problem, self._sides = problem, count
        self._n, self._m = len(problem.free) // 3, problem.count
        inverse = inverse_diagonal(problem)
        response = problem.j @ inverse
        response.sort_indices()
        jacobian = _covering(problem.j, response)
        response = on_pattern(response, jacobian)
        coupling = inverse @ _off_diagonal(problem)
        self._a = [_ints(coupling.indptr), _ints(coupling.indices), _floats(coupling.data)]
        self._rows = [_ints(jacobian.indptr), _ints(jacobian.indices)]
        self._jacobian, self._response = _floats(jacobian.data), _floats(response.data)
        self._own = _floats(contact_blocks(jacobian, response))
        self._given = [_floats(problem.floor), _floats(problem.friction), _floats(axes)]
        self.impulse_host = np.zeros(3 * self._m) if start is None else np.array(start, dtype=float).ravel()
        self.change_host = np.zeros(3 * self._n) if velocity is None else velocity - problem.free
        if problem.fixed is not None:
            self.change_host[np.repeat(problem.fixed, 3)] = 0.0
        self.base_host, self.velocity_host = np.zeros(3 * self._n), np.zeros(3 * self._n)
        self.pulled_host = np.zeros(3 * self._n)  # D^-1 E^T l
        self._impulse, self._change = _floats(self.impulse_host), _floats(self.change_host)
        self._base, self._velocity = _floats(self.base_host), _floats(self.velocity_host)
        self._pulled, self._free = _floats(self.pulled_host), _floats(problem.free)
        self._reached_host, self._control_host = np.zeros(3 * self._n), np.zeros(5)
        self._reached, self._control = _floats(self._reached_host), _floats(self._control_host)
        self.dynamics, self.contact = np.zeros(2), np.zeros(5)
        self._info = [_floats(self.dynamics), _floats(self.contact)]
        self.equality = np.zeros(0 if problem.e is None else problem.e.shape[0])
        self._e = problem.e if len(self.equality) else None
        if self._e is not None:
            self._pull = sp.csr_array(inverse @ self._e.T)
            s = sp.csr_array(self._e @ self._pull)
            diagonal = s.diagonal()
            s = s + sp.diags_array(REPEATED * np.where(diagonal > 0.0, diagonal, 1.0))
            self._s, self._wanted = Factor(sp.csr_array(s)), problem.wanted - self._e @ problem.free
            self.pulled_host += self._meet(self.change_host, self._wanted)
        self._record()

    def _record(self) -> None:
        """The launches, packed once: their numbers live in arrays, and packing takes longer than a small pass."""

        def launch(kernel: wp.Kernel, inputs: list) -> wp.Launch:
            return wp.launch(kernel, 1, inputs=[0, *inputs], device="cpu", record_cmd=True)

        self._anticipate = launch(ica_kernels.anticipate, [
            self._n, *self._a, self._m, *self._rows, self._response, self._impulse, self._free, self._change,
            self._pulled, self._base, self._velocity, self._info[0],
        ])  # fmt: skip
        self._look, self._sweep = (
            launch(
                ica_kernels.sweep,
                [
                    self._m,
                    *self._rows,
                    self._jacobian,
                    self._response,
                    self._own,
                    *self._given,
                    self._sides,
                    self._impulse,
                    velocity,
                    self._control,
                    self._info[1],
                ],
            )  # fmt: skip
            for velocity in (self._reached, self._velocity)
        )
        self._refine = launch(ica_kernels.refine, [self._n, *self._a, self._base, self._velocity, self._change])

    def anticipate(self) -> None:
        """Velocities that D anticipates, and by how much they miss the equation of motion at dv."""
        self._anticipate.launch()

    def look(self) -> None:
        """Residuals of contact at dv."""
        np.add(self.problem.free, self.change_host, out=self._reached_host)
        self._control_host[:] = 1.0, True, False, 0.0, 0.0
        self._look.launch()

    def contacts(self, most: int, paper: bool, target: float, allowed: float) -> int:
        """The inner loop. Returns its sweeps."""
        self._control_host[:] = most if self._e is None else 1, False, paper and self._e is None, target, allowed
        if self._e is None:
            self._sweep.launch()
            return int(self.contact[ica_kernels.SWEEPS])
        before, done = np.full(2, -1.0), 0
        while done < most:
            self._sweep.launch()
            step = self._meet(self.velocity_host, self.problem.wanted)
            self.pulled_host += step
            done += 1
            now = self.contact[ica_kernels.NORMAL : ica_kernels.WORST].copy()
            if max(self.contact[ica_kernels.WORST], np.abs(step).max()) <= target:
                break
            if paper and self.contact[ica_kernels.GAP] <= allowed and (np.abs(now - before) <= SAME * before).all():
                break
            before = now
        return done

    def refine(self, how: str) -> None:
        """One iteration on dv, equality rows held."""
        if how == "jacobi":
            self.change_host[:] = self.velocity_host - self.problem.free
        else:
            self._refine.launch()
        if self._e is not None:
            self.pulled_host += self._meet(self.change_host, self._wanted)

    def _meet(self, velocity: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Project velocities in place; returns what was added to them."""
        s = self._s.solve(wanted - self._e @ velocity)
        step = self._pull @ s
        velocity += step
        self.equality += s
        return step

    def judge(self, shape: str, axes: np.ndarray) -> float:
        """The largest residual of all, measured by `residuals`."""
        v, r = self.problem.free + self.change_host, self.impulse_host.reshape(-1, 3)
        return contact_residuals(self.problem, v, r, self.equality, shape, axes).worst


def _off_diagonal(problem: ContactProblem) -> sp.bsr_array:
    """``L + U = D - A``."""
    a, other = problem.a, partners(problem)
    row = block_rows(a)
    keep = (a.indices != row) & (a.indices != other[row])
    start = np.concatenate([[0], np.cumsum(np.bincount(row[keep], minlength=len(other)))])
    return sp.bsr_array((-a.data[keep], a.indices[keep], start), shape=a.shape)


def _covering(j: sp.bsr_array, response: sp.bsr_array) -> sp.bsr_array:
    """J on the pattern of both: ``J D^-1`` reaches the other half of a rigid body and leaves fixed blocks out."""
    both = [sp.bsr_array((np.ones_like(x.data), x.indices, x.indptr), shape=x.shape) for x in (j, response)]
    pattern = sp.bsr_array(both[0] + both[1])
    pattern.sort_indices()
    return on_pattern(j, pattern)


def _ints(values: np.ndarray) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.int32, device="cpu", copy=False)


def _floats(values: np.ndarray) -> wp.array:
    """A device array on the same memory where the values are contiguous."""
    return wp.array(np.ascontiguousarray(values, dtype=float).reshape(-1), dtype=wp.float64, device="cpu", copy=False)
