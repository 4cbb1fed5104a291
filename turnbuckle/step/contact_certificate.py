"""How well the committed step meets the conditions of contact (Contact, (6), (7)), in m/s. Shares nothing with solvers.

    gap              floor - J_n v                    where two bodies come nearer than was asked
    complementarity  min(J_n v - floor, w r_n)        what pushes is near, what is apart does not push
    cone             w (|r_t| - mu r_n)               friction beyond Coulomb's bound
    sticking         w r_t - P(w r_t - J_t v)         where friction is not at its bound, nothing slides; else it opposes

w is the mean of the diagonal of ``J D_A^-1 J^T``, the local inverse mass of the contact.
"""

import numpy as np

from turnbuckle.data.contact import ContactProblem
from turnbuckle.linalg.block_matrix import diagonal_blocks


def contact_conditions(problem: ContactProblem, velocity: np.ndarray, impulse: np.ndarray) -> dict[str, float]:
    """The largest violation of each condition by velocities (3 n,) and impulses (m, 3) in the frames of the rows [m/s]."""
    if problem.count == 0:
        return {}
    u = (problem.j @ velocity).reshape(-1, 3)
    w = inverse_masses(problem)
    above = u[:, 0] - problem.floor
    push = w * impulse[:, 0]
    tangential = w[:, None] * impulse[:, 1:]
    bound = problem.friction * np.maximum(push, 0.0)
    wanted = tangential - u[:, 1:]
    size = np.linalg.norm(wanted, axis=1)
    inside = np.where(size > bound, bound / np.where(size > 0.0, size, 1.0), 1.0)
    return {
        "gap": float(np.maximum(-above, 0.0).max()),
        "complementarity": float(np.abs(np.minimum(above, push)).max()),
        "cone": float(np.maximum(np.linalg.norm(tangential, axis=1) - bound, 0.0).max()),
        "sticking": float(np.linalg.norm(tangential - inside[:, None] * wanted, axis=1).max()),
    }


def inverse_masses(problem: ContactProblem) -> np.ndarray:
    """w of each contact (m,) [1/kg]."""
    a, j = problem.a, problem.j
    local = _inverses(diagonal_blocks(a.data, a.indptr, a.indices))
    if problem.fixed is not None:
        local[problem.fixed] = 0.0
    here = j.data
    spread = np.einsum("eij,ejk,eik->e", here, local[j.indices], here, optimize=True)
    starts = j.indptr[:-1]
    out = np.zeros(problem.count)
    full = np.diff(j.indptr) > 0
    out[full] = np.add.reduceat(spread, starts[full]) if full.any() else 0.0
    return out / 3.0


def _inverses(a: np.ndarray) -> np.ndarray:
    """Of matrices (n, 3, 3), by cofactors."""
    adjugate = np.stack([np.cross(a[:, 1], a[:, 2]), np.cross(a[:, 2], a[:, 0]), np.cross(a[:, 0], a[:, 1])], axis=2)
    return adjugate / np.einsum("ni,ni->n", a[:, 0], adjugate[:, :, 0])[:, None, None]
