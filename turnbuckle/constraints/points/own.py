"""What a constraint of one's own has to be: one file of yours, which `Stepper.add` lets act beside the library's kinds.

`examples/add_a_constraint.py` is such a file. It acts in scenes without contact, on mass points that no other constraint holds,
under explicit schemes but explicit Euler. Nonlinear constraints keep the order of schemes of one stage; under `midpoint`, `rk2`
and `rk4` they are of order 1, since stages know positions of the start of the step only.
"""

from typing import Protocol

import numpy as np
import warp as wp

from turnbuckle.compute import Program
from turnbuckle.data.errors import ConflictError, InputError
from turnbuckle.data.model import Model
from turnbuckle.data.state import Kinematics, State

REFUSED = ("implicit_euler", "newmark", "explicit_euler")  # solved through a matrix; lands one step later


class OwnConstraint(Protocol):
    """Rows of one kind. Kernels are recorded on ``program`` once, and replayed in every step."""

    name: str  # under which its residuals stand in the report
    points: np.ndarray  # (n,) the points of the state that it holds, each once

    def land(self, program: Program, mass: wp.array, params: wp.array, now: Kinematics, on: Kinematics) -> None:
        """Record how predicted positions ``on.x`` [m] land on the constraint, and velocities ``on.v`` [m/s] with them.

        A force that moves point i by ``s / m_i`` is ``s params[INVERSE_C]``, and changes its velocity by
        ``s params[D_OVER_C] / m_i``; where ``params[MEMORY]`` is 1, also ``on.memory`` (Verlet's velocity) by
        ``s params[INVERSE_H] / m_i``. Directions that turn are best taken at ``now``, the start of the step.
        """

    def project(self, program: Program, mass: wp.array, at: Kinematics, y: wp.array, what: str) -> None:
        """Record how ``y`` (points,) vec3d becomes a rate that keeps the constraint, at the positions ``at.x``.

        ``what``: "velocity", or "acceleration" at the velocities ``at.v`` (in stages of schemes that have some; nearly right
        is good enough there, since positions land after it).
        """

    def residual(self, x: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Worst miss of positions [m] and of rates [m/s] at ``x``, ``v`` (points, 3), by other code than that above."""


def check_own(constraint: OwnConstraint, others: list[OwnConstraint], model: Model, state: State) -> None:
    """Raise `InputError`, or `ConflictError` that names both, where it cannot act in this model."""
    name, points = constraint.name, np.asarray(constraint.points)
    where = f"constraint '{name}'"
    if model.integrator in REFUSED:
        raise InputError(
            f"{where}: constraints of one's own do not act under {model.integrator}; take velocity_verlet or another explicit scheme"
        )
    if points.ndim != 1 or len(np.unique(points)) < len(points):
        raise InputError(f"{where}: points must be a list in which each point stands once")
    if len(points) and not 0 <= points.min() <= points.max() < model.points:
        raise InputError(f"{where}: points must be from 0 to {model.points - 1}")
    if (model.body_of[points] >= 0).any() or not (model.mass[points] > 0.0).all():
        raise InputError(f"{where}: takes points of a rigid body or obstacle; take mass points")
    held = [(g.name, g.points) for g in state.groups.values()] + [(c.name, c.points) for c in others]
    for other, theirs in held:
        if name == other:
            raise InputError(f"there is a constraint '{name}' already; take another name")
        shared = np.intersect1d(points, theirs)
        if len(shared):
            raise ConflictError(
                f"constraints '{name}' and '{other}' both hold point {shared[0]} of the state; give one of them other points"
            )
