"""Constraint anticipation (Contact, 5.1): the full Schur complement, projected Gauss-Seidel, and a Newton finish.

Equality rows are eliminated with A: with the matrix ``K = [A E^T; E 0]`` of the blocks that move, ``X = K^-1 [J^T; 0]`` is
what unit impulses do while all joints hold, and ``B = J X`` is dense. Cost grows with n m and m^2: a reference and a judge
of the other solvers, and fast for a few hundred contacts.

Piles whose impulses are not unique (B is singular) make Gauss-Seidel crawl. Then each round solves a problem that is tied
to the impulses it starts from, ``B + tie D`` in place of B, well enough posed for Newton's method; ties loosen from round
to round, and vanish from the answer because it no longer moves.
"""

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import warp as wp

from turnbuckle.compute.start import start_warp
from turnbuckle.data.contact import ContactProblem, ContactSolution
from turnbuckle.linalg.factor import Factor
from turnbuckle.solvers.contact import friction_shapes
from turnbuckle.solvers.contact.anticipation_newton import finish
from turnbuckle.solvers.contact.one_contact import SOLVE_ONE_CONTACT
from turnbuckle.solvers.contact.residuals import contact_residuals

start_warp()
wp.set_module_options({"enable_backward": False})

SWEEPS = 50  # of Gauss-Seidel a round
# A tie to the impulses before, in parts of B's diagonal: of each round but the first (proximal points).
TIES = tuple(10.0 ** np.arange(-1.0, -11.5, -0.5))
REPEATED = 1e-10  # of the largest: a row of E whose part that is its own is smaller repeats others

I32 = wp.array(dtype=wp.int32)
F64 = wp.array(dtype=wp.float64)


def solve_anticipation(
    problem: ContactProblem,
    start: np.ndarray | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 10_000,
    friction_shape: str = "cone",
    axes: np.ndarray | None = None,
) -> ContactSolution:
    """Solve a contact problem by its dense Schur complement (Contact, (8)).

    ``start`` (m, 3) impulses in the frames of the rows; ``tolerance`` [m/s] of every residual; ``max_iterations`` sweeps of
    Gauss-Seidel; ``axes`` (m, 2) of pyramids, by default along the free tangential velocities. Raises
    `numpy.linalg.LinAlgError` when the dynamics are singular.
    """
    count = friction_shapes.sides(friction_shape)
    axes = friction_shapes.aligned_axes(problem) if axes is None else np.asarray(axes, dtype=float)
    reduced = Anticipated(problem)
    m = problem.count
    still = reduced.still.copy()
    still[:, 0] -= problem.floor
    own = np.repeat(np.diag(reduced.b).reshape(m, 3).mean(axis=1), 3)
    r = np.zeros((m, 3)) if start is None else np.array(start, dtype=float)
    best, best_r = np.inf, r
    sweeps = newton = rounds = 0

    def judge(r: np.ndarray) -> None:
        nonlocal best, best_r
        velocity, equality = reduced.answer(r)
        residual = contact_residuals(problem, velocity, r, equality, friction_shape, axes).worst
        if residual < best:
            best, best_r = residual, r.copy()

    judge(r)
    while best > tolerance and sweeps < max_iterations:
        tie = 0.0 if rounds == 0 or rounds > len(TIES) else TIES[rounds - 1]
        b = reduced.b + np.diag(tie * own)
        held = still - (tie * own * r.ravel()).reshape(m, 3)
        todo = min(SWEEPS if rounds <= len(TIES) else sweeps, max_iterations - sweeps)
        _sweep(b, held, problem.friction, count, axes, r, todo)
        judge(r)
        sweeps += todo
        rounds += 1
        if best > tolerance:
            finished, steps = finish(b, held, problem.friction, count, axes, r)
            newton += steps
            judge(finished)
            r = finished if tie > 0.0 else r
    velocity, equality = reduced.answer(best_r)
    converged = bool(best <= tolerance)
    return ContactSolution(
        velocity=velocity,
        impulse=best_r,
        equality=equality,
        iterations={"sweeps": sweeps, "newton": newton},
        residual=float(best),
        converged=converged,
        message="" if converged else f"residual {best:.1e} m/s after {sweeps} sweeps; allow more iterations",
    )


class Anticipated:
    """Velocities as an affine function of contact impulses, joints included."""

    def __init__(self, problem: ContactProblem) -> None:
        n = len(problem.free)
        moves = np.ones(n, bool) if problem.fixed is None else ~np.repeat(problem.fixed, 3)
        self._moves = np.flatnonzero(moves)
        self._free = problem.free
        j = sp.csr_array(problem.j)[:, self._moves]
        matrix = sp.csr_array(problem.a)[self._moves][:, self._moves]
        wanted = np.zeros(0)
        self._rows, self._k = np.zeros(0, int), 0
        if problem.e is not None:
            self._k = problem.e.shape[0]
            e = sp.csr_array(problem.e)[:, self._moves]
            self._rows = independent_rows(e)
            e = e[self._rows]
            wanted = (problem.wanted - problem.e @ problem.free)[self._rows]
            matrix = sp.block_array([[matrix, e.T], [e, None]], format="csr")
        size = len(self._moves)
        right = np.zeros((size + len(self._rows), 3 * problem.count + 1))
        right[:size, 1:] = j.toarray().T
        right[size:, 0] = wanted
        solved = Factor(matrix).solve(right)
        self._still, self._answer = solved[:, 0], solved[:, 1:]
        b = j @ self._answer[:size]
        self.b = np.ascontiguousarray(0.5 * (b + b.T))  # (3 m, 3 m) [1/kg]
        self.still = (problem.j @ problem.free + j @ self._still[:size]).reshape(-1, 3)  # (m, 3) J v without contacts

    def answer(self, impulse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities (3 n,) and impulses of equality rows (k,)."""
        z = self._still + self._answer @ impulse.ravel()
        size = len(self._moves)
        velocity = self._free.copy()
        velocity[self._moves] += z[:size]
        equality = np.zeros(self._k)
        equality[self._rows] = -z[size:]
        return velocity, equality


def independent_rows(e: sp.csr_array) -> np.ndarray:
    """A largest set of rows that do not repeat each other, sorted."""
    if not e.shape[0]:
        return np.zeros(0, int)
    _, r, order = la.qr(e.toarray().T, mode="economic", pivoting=True)
    size = np.abs(np.diag(r))
    return np.sort(order[: np.count_nonzero(size > REPEATED * size.max(initial=0.0))])


@wp.func_native(
    SOLVE_ONE_CONTACT
    + """
    const int size = 3 * m;
    for (int sweep = 0; sweep < sweeps; ++sweep)
        for (int i = 0; i < m; ++i) {
            double *own = r.data + 3 * i, *v = u.data + 3 * i;
            double w[9], rest[3], next[3] = {own[0], own[1], own[2]};
            for (int a = 0; a < 3; ++a) {
                const double *row = b.data + (long long)(3 * i + a) * size + 3 * i;
                rest[a] = v[a];
                for (int c = 0; c < 3; ++c) { w[3 * a + c] = row[c]; rest[a] -= row[c] * own[c]; }
            }
            one_contact(w, rest, friction.data[i], sides, axes.data[2 * i], axes.data[2 * i + 1], next);
            for (int a = 0; a < 3; ++a) {
                const double change = next[a] - own[a];
                if (change == 0.0) continue;
                own[a] = next[a];
                const double *row = b.data + (long long)(3 * i + a) * size;  // B is symmetric
                for (int c = 0; c < size; ++c) u.data[c] += change * row[c];
            }
        }
    """
)
def _gauss_seidel(
    b: F64, u: F64, friction: F64, axes: F64, m: int, sides: int, sweeps: int, r: F64
): ...  # fmt: skip


@wp.kernel
def _sweep_kernel(
    begin: int, b: F64, u: F64, friction: F64, axes: F64, m: int, sides: int, sweeps: int, r: F64
):  # fmt: skip
    """Projected Gauss-Seidel over all contacts, in order (one item)."""
    _gauss_seidel(b, u, friction, axes, m, sides, sweeps, r)


def _sweep(b, still, friction, count, axes, r, sweeps):
    """Sweeps on the impulses r (m, 3), in place."""
    if not len(r):
        return
    u = (b @ r.ravel()) + still.ravel()
    arrays = [wp.array(np.ascontiguousarray(x).ravel(), dtype=wp.float64, device="cpu") for x in (b, u, friction, axes)]
    impulse = wp.array(r.ravel(), dtype=wp.float64, device="cpu")
    wp.launch(_sweep_kernel, 1, inputs=[0, *arrays, len(r), count, sweeps, impulse], device="cpu")
    r[:] = impulse.numpy().reshape(-1, 3)
