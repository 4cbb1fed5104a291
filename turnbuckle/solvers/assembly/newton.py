"""Closing all joints at once: Levenberg-Marquardt steps, the shortest in mass, whatever the rank.

A step solves ``(J J^T + lambda) y = -s`` and moves by ``J^T y``. With lambda in proportion to ``|s|`` it converges
quadratically to a set of solutions that need not be regular (Fan and Yuan, 2005): redundant joints, and loops that
move though a count of rows forbids it, need no test of rank. Contradictory rows end in the least sum of squares.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from turnbuckle.geometry.quaternions import exponential, multiply, norm
from turnbuckle.solvers.assembly.rows import Linearised, RowSet
from turnbuckle.solvers.displacement.conditions import Poses

DENSE = 100  # rows up to which the matrix is factored dense
LEAST_DAMPING = 1e-14
MOST_DAMPING = 1e8
LIMIT_ROUNDS = 4  # how often rows that a step would break are added to it
DONE = 1e-15  # a step of less, of the size of the bodies, moves nothing
FLAT = 1e-3  # part of the residual that a step must take away now and then
PATIENCE = 8  # steps that may take away less


@dataclass
class Closed:
    """Where `close` ended."""

    poses: Poses
    steps: int
    residual: float  # largest broken row [m, or rad times the radius of gyration]


def solver_of(matrix: sparse.csr_array, damping: float) -> Callable[[np.ndarray], np.ndarray]:
    """Solves with ``J J^T + lambda`` for one or several right sides; lambda is ``damping`` times the mean diagonal."""
    count = matrix.shape[0]
    damping = damping * float(matrix.multiply(matrix).sum()) / max(count, 1)
    if count <= DENSE:
        dense = matrix.toarray()
        square = dense @ dense.T + damping * np.eye(count)
        return lambda right: np.linalg.solve(square, right)
    square = (matrix @ matrix.T + damping * sparse.eye_array(count)).tocsc()
    return splu(square, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0).solve


def shortest_step(rows: RowSet, damping: float) -> np.ndarray:
    """The damped step; one-sided rows act where they are broken, or would be by the step."""
    active = ~rows.sided | (rows.s < 0.0)
    for _ in range(LIMIT_ROUNDS):
        chosen = rows.jacobian[active]
        step = chosen.T @ solver_of(chosen, damping)(-rows.s[active])
        after = rows.s + rows.jacobian @ step
        more = rows.sided & ~active & (after < 0.0)
        if not more.any():
            break
        active |= more
    return step


def advance(system: Linearised, poses: Poses, step: np.ndarray, most: float) -> Poses:
    """Poses after a step, shortened as a whole where it turns a body by more than ``most`` [rad]."""
    shift, turn = system.moved(poses, step)
    scale = min(1.0, most / max(float(norm(turn).max(initial=0.0)), 1e-300))
    return Poses(poses.x + scale * shift, multiply(exponential(scale * turn), poses.q))


def close(
    system: Linearised,
    poses: Poses,
    *,
    tolerance: float,
    max_steps: int,
    max_rotation: float,
    watch: Callable[[Poses, float], None] | None = None,
) -> Closed:
    """Newton steps from ``poses`` until all rows are within ``tolerance``, or nothing gets better."""
    rows = system.rows(poses)
    broken = rows.broken
    factor, slow, steps = 1.0, 0, 0
    while steps < max_steps:
        value = float(np.abs(broken).max(initial=0.0))
        if value <= tolerance or not np.isfinite(value):
            break
        merit = float(broken @ broken)
        damping = np.clip(factor * value / system.size, LEAST_DAMPING, MOST_DAMPING)
        step = shortest_step(rows, damping)
        tried = advance(system, poses, step, max_rotation)
        new_rows = system.rows(tried)
        new_broken = new_rows.broken
        new_merit = float(new_broken @ new_broken)
        steps += 1
        if np.isfinite(new_merit) and new_merit < merit:
            poses, rows, broken = tried, new_rows, new_broken
            factor = max(0.2 * factor, 1e-6)
            slow = slow + 1 if new_merit > (1.0 - FLAT) * merit else 0
            if watch is not None:
                watch(poses, value)
        else:
            factor *= 8.0
            slow += 1
        if slow >= PATIENCE or factor > MOST_DAMPING or np.abs(step).max(initial=0.0) < DONE * system.size:
            break
    return Closed(poses, steps, float(np.abs(broken).max(initial=0.0)))
