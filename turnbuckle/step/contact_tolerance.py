"""What velocities of a step with contact may miss their conditions by [m/s]: a part of what forces do in the step.

In motion forces are gravity, or, without it, what a contact may be let apart by. Where everything is slow the tolerance
shrinks with the speed, so that piles come to rest; but not below a part of what bodies at rest are pushed by: to resolve
the weight of a body that is pressed with a hundred times its weight costs many times as much, and moves nothing.
"""

from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.data.contact import VERTEX_FACE
from turnbuckle.data.model import Model

if TYPE_CHECKING:
    from turnbuckle.step.contact_step import ContactStepper

LEAST = 1e-9  # [m/s] the smallest tolerance
PART = 0.25  # of delta: a motion in a step that the tolerance is a part of, where gravity does less
FAST = 10.0  # times what gravity does in a step: where all is slower, the tolerance shrinks with the speed,
REST = 1e-2  # to this part of itself,
PUSHED = 30.0  # or as many times that as bodies are pushed stronger than by their weight, at most so many


def solver_tolerance(stepper: "ContactStepper", speed: np.ndarray, h: float) -> float:
    """The tolerance [m/s] of a step of ``h`` [s] that begins with speeds (moving blocks,) [m/s]."""
    state, surfaces = stepper.state, stepper.surfaces
    gravity = float(np.linalg.norm(state.gravity)) * h
    still = PART * float(surfaces.delta.min()) / h if surfaces.vertices else 0.0
    if stepper.dynamics_of.fine and gravity > 0.0:
        still = 0.0
    scale = max(gravity, still)
    if scale == 0.0:
        return LEAST
    rest = REST * min(max(median_push(stepper) * h / scale, 1.0), PUSHED)
    pace = min(max(speed.max(initial=0.0) / (FAST * scale), rest), 1.0)
    return max(stepper.options.tolerance * scale * pace, LEAST)


def median_push(stepper: "ContactStepper") -> float:
    """All contact forces on a body over its mass, the median of the moving bodies that were touched [m/s^2]."""
    memory, surfaces, dt = stepper.memory, stepper.surfaces, stepper.state.dt
    if not (len(memory.keys) and dt > 0.0):
        return 0.0
    strength = np.linalg.norm(memory.impulse, axis=1)
    kind, a, b = memory.pairs()
    count = len(stepper.body_masses)
    push = np.zeros(count)
    for which, first, second in (
        (kind == VERTEX_FACE, np.arange(surfaces.vertices), surfaces.faces[:, 0]),
        (kind != VERTEX_FACE, surfaces.edges[:, 0], surfaces.edges[:, 0]),
    ):
        for place in (first[a[which]], second[b[which]]):
            push += np.bincount(surfaces.shape[place], weights=strength[which], minlength=count)
    touched = (push > 0.0) & (stepper.body_masses > 0.0)
    return float(np.median(push[touched] / stepper.body_masses[touched])) / dt if touched.any() else 0.0


def body_masses(model: Model, dynamic: np.ndarray) -> np.ndarray:
    """Mass of each body (shapes,) [kg], zero where it does not move by forces. ``dynamic``: which rigid bodies do."""
    out = np.zeros(len(model.shapes))
    for k, shape in enumerate(model.shapes):
        body = int(model.body_of[shape.begin]) if shape.end > shape.begin else -1
        if body < 0:
            out[k] = np.maximum(model.mass[shape.begin : shape.end], 0.0).sum()
        elif dynamic[body]:
            out[k] = model.rigid.mass[body]
    return out
