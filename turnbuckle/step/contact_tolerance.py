"""What velocities of a step with contact may miss their conditions by [m/s]: a part of what forces do in the step.

Forces in motion are gravity, or a quarter of the distance of contact in a step where that is more. Where everything is slow the tolerance
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
PUSHED = 30.0  # or as many times that as bodies are pushed by more than that, at most so many


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
    """All forces of other bodies on one over its mass, the median of the moving bodies that were touched [m/s^2]."""
    memory, surfaces, dt = stepper.memory, stepper.surfaces, stepper.state.dt
    if not (len(memory.keys) and dt > 0.0):
        return 0.0
    strength = np.linalg.norm(memory.impulse, axis=1)
    kind, a, b = memory.pairs()
    at_vertex, count = kind == VERTEX_FACE, len(stepper.body_masses)
    ends = np.empty((2, len(kind)), dtype=np.int64)  # a vertex of each side
    ends[:, at_vertex] = a[at_vertex], surfaces.faces[b[at_vertex], 0]
    ends[:, ~at_vertex] = surfaces.edges[a[~at_vertex], 0], surfaces.edges[b[~at_vertex], 0]
    one, other = surfaces.shape[ends]
    strength = np.where(one != other, strength, 0.0)  # what a body pushes itself with moves it nowhere
    push = np.bincount(one, weights=strength, minlength=count) + np.bincount(other, weights=strength, minlength=count)
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
