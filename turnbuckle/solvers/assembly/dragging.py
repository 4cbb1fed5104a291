"""Pulling points to targets while joints stay closed: Gauss-Newton steps within what the joints leave free.

With J the rows of the joints and D those of the dragged points, a step is ``d = d_c + N y``: d_c closes the joints, N
projects on motions that leave them closed, and y is the damped least-squares step of ``|r + D d|``.
"""

from collections.abc import Callable

import numpy as np

from turnbuckle.solvers.assembly.newton import LIMIT_ROUNDS, advance, close, solver_of
from turnbuckle.solvers.assembly.rows import Linearised, RowSet
from turnbuckle.solvers.displacement.conditions import Poses

STEPS = 150
ROUND_OFF = 1e-13  # regularises redundant joints
SETTLED = 1e-9  # of the pull: what is not to be gained any more
PATIENCE = 6


def drag(
    joints: Linearised,
    drags: Linearised,
    poses: Poses,
    *,
    tolerance: float,
    max_rotation: float,
    watch: Callable[[Poses, float], None] | None = None,
) -> tuple[Poses, float]:
    """Poses with the points of ``drags`` at their targets, or as near as joints let them come; what is missing [m].

    ``joints`` are closed to ``tolerance`` [m and rad] after each step, and at ``poses`` already.
    """
    pull = drags.every_row(poses)
    size = float(np.linalg.norm(pull.s))
    factor, idle = 1e-3, 0
    for _ in range(STEPS):
        if size <= tolerance or idle >= PATIENCE or factor > 1e12:
            break
        step = _step(joints.rows(poses), pull, factor)
        hoped = size**2 - float(np.square(pull.s + pull.jacobian @ step).sum())
        tried = advance(joints, poses, step, max_rotation)
        closed = close(joints, tried, tolerance=tolerance, max_steps=40, max_rotation=max_rotation)
        new = drags.every_row(closed.poses)
        new_size = float(np.linalg.norm(new.s))
        if closed.residual <= tolerance and new_size < size:
            idle = idle + 1 if new_size > (1.0 - SETTLED) * size else 0
            kept = (size**2 - new_size**2) / max(hoped, 1e-300)  # of what the step promised
            factor = max(0.3 * factor, 1e-12) if kept > 0.75 else 3.0 * factor if kept < 0.3 else factor
            poses, pull, size = closed.poses, new, new_size
            if watch is not None:
                watch(poses, size)
        else:
            factor *= 6.0
    return poses, size


def _step(rows: RowSet, pull: RowSet, factor: float) -> np.ndarray:
    """One step; one-sided rows of the joints act where they are broken, or would be."""
    ahead = pull.jacobian.toarray()
    active = ~rows.sided | (rows.s < 0.0)
    for _ in range(LIMIT_ROUNDS):
        j = rows.jacobian[active]
        if j.shape[0]:
            solve = solver_of(j, ROUND_OFF)
            closing = -(j.T @ solve(rows.s[active]))
            free = ahead - (j.T @ solve(j @ ahead.T)).T
        else:
            closing, free = np.zeros(ahead.shape[1]), ahead
        square = free @ free.T
        damping = factor * max(float(np.trace(square)), 1e-300)
        step = closing - free.T @ np.linalg.solve(square + damping * np.eye(len(square)), pull.s + ahead @ closing)
        more = rows.sided & ~active & (rows.s + rows.jacobian @ step < 0.0)
        if not more.any():
            break
        active |= more
    return step
