"""How well a velocity and its impulses solve a contact problem, in m/s (Contact, (6), (7)). Shares nothing with solvers.

Impulses are turned into velocities by the local effective mass, the diagonal of ``J D_A^-1 J^T`` (n: normal, t: mean of
both tangents). At a solution every natural map is zero, and nowhere else:

    normal      min(J_n v - floor, w_n r_n)                              0 <= r_n  complementary to  J_n v >= floor
    tangential  w_t r_t - P(w_t r_t - J_t v), P onto the section         r_t in it, and r_t . u least in it:
                                                                         at rest inside, opposed to motion at the rim
"""

from dataclasses import dataclass, fields

import numpy as np

from turnbuckle.data.contact import ContactProblem
from turnbuckle.solvers.contact import friction_shapes
from turnbuckle.solvers.contact.block_jacobi import contact_blocks, inverse_diagonal


@dataclass(frozen=True)
class ContactResiduals:
    """Largest violation of each condition [m/s]; rows of angles [rad/s]."""

    dynamics: float  # of D_A^-1 (A (v - v*) - J^T r - E^T l); fixed blocks: of v - v*
    equality: float  # of E v - wanted
    gap: float  # of floor - J_n v where that is positive
    complementarity: float  # of the natural map of the normal part
    cone: float  # how far tangential impulses are outside of their section, times the local inverse mass
    direction: float  # of the natural map of the tangential part

    @property
    def worst(self) -> float:
        """The largest of all; infinite where something is not a number."""
        values = [getattr(self, f.name) for f in fields(self)]
        return max(values) if np.isfinite(values).all() else np.inf


def contact_residuals(
    problem: ContactProblem,
    velocity: np.ndarray,
    impulse: np.ndarray,
    equality: np.ndarray | None = None,
    friction_shape: str = "cone",
    axes: np.ndarray | None = None,
) -> ContactResiduals:
    """Residuals of velocities (3 n,) [m/s], impulses (m, 3) in the frames of the rows and (k,) of equality rows [N s].

    ``axes`` (m, 2) are those of pyramids, by default `friction_shapes.aligned_axes`.
    """
    inverse = inverse_diagonal(problem)
    change = velocity - problem.free
    left = problem.a @ change - problem.j.T @ impulse.ravel()
    if problem.load is not None:
        left = left - problem.load
    rate = 0.0
    if problem.e is not None:
        left = left - problem.e.T @ equality
        rate = _largest(problem.e @ velocity - problem.wanted)
    left = inverse @ left
    if problem.fixed is not None:
        left = np.where(np.repeat(problem.fixed, 3), change, left)
    u = (problem.j @ velocity).reshape(-1, 3)
    own = contact_blocks(problem.j, problem.j @ inverse)
    normal_mass, tangent_mass = own[:, 0, 0], 0.5 * (own[:, 1, 1] + own[:, 2, 2])
    above = u[:, 0] - problem.floor
    count = friction_shapes.sides(friction_shape)
    if axes is None:
        axes = friction_shapes.aligned_axes(problem) if count else np.zeros((problem.count, 2))
    radius = tangent_mass * problem.friction * np.maximum(impulse[:, 0], 0.0)
    push = tangent_mass[:, None] * impulse[:, 1:]
    outside = push - friction_shapes.project(push, radius, count, axes)
    opposed = push - friction_shapes.project(push - u[:, 1:], radius, count, axes)
    return ContactResiduals(
        dynamics=_largest(left),
        equality=rate,
        gap=_largest(np.minimum(above, 0.0)),
        complementarity=_largest(np.minimum(above, normal_mass * impulse[:, 0])),
        cone=_largest(np.hypot(outside[:, 0], outside[:, 1])),
        direction=_largest(np.hypot(opposed[:, 0], opposed[:, 1])),
    )


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max(initial=0.0))
