"""Frictionless contact as the quadratic program it is (Contact, 3.3): least distance in the metric of A, by NNLS.

    min 1/2 dv^T A dv   where   E dv = g,  J_n dv >= c

With ``A = L L^T``, ``y = L^T dv`` and a basis N of the null space of ``E L^-T``, ``y = y0 + N z`` it is the least |z| with
``G z >= d``, and that (Lawson and Hanson 1974, ch. 23) is one problem of nonnegative least squares:
min |[G^T; d^T] u - [0; 1]|, u >= 0, then z = -r[:-1] / r[-1] with the residual r. Redundant rows do no harm.
"""

import numpy as np
import scipy.linalg as la
from scipy.optimize import nnls

from turnbuckle.data.contact import ContactProblem


def solve_frictionless(problem: ContactProblem) -> np.ndarray:
    """Velocities (3 n,). Raises `ValueError` where no velocity fulfils all rows."""
    n = len(problem.free)
    moves = np.ones(n, bool) if problem.fixed is None else ~np.repeat(problem.fixed, 3)
    low = la.cholesky(problem.a.toarray()[np.ix_(moves, moves)], lower=True)
    rows = problem.j.toarray()[::3]
    c = problem.floor - rows @ problem.free
    g = la.solve_triangular(low, rows[:, moves].T, lower=True).T
    y0, null = np.zeros(moves.sum()), np.eye(moves.sum())
    if problem.e is not None:
        e = la.solve_triangular(low, problem.e.toarray()[:, moves].T, lower=True).T
        y0 = np.linalg.lstsq(e, problem.wanted - problem.e @ problem.free, rcond=1e-11)[0]
        null = la.null_space(e, rcond=1e-11)
    matrix, d = g @ null, c - g @ y0
    size = np.abs(d).max(initial=0.0) or 1.0  # the last row of NNLS is then of the size of the others
    stacked = np.vstack([matrix.T, d[None] / size])
    norm = np.linalg.norm(stacked, axis=0)
    norm[norm == 0.0] = 1.0
    last = np.zeros(len(stacked))
    last[-1] = 1.0
    u, left = nnls(stacked / norm, last, maxiter=100 * len(d) + 100)
    if left < 1e-9:
        raise ValueError("no velocity fulfils all rows")
    r = stacked / norm @ u - last
    y = y0 + null @ (-size * r[:-1] / r[-1])
    v = problem.free.copy()
    v[moves] += la.solve_triangular(low.T, y, lower=False)
    return v
