"""The turn of free bodies in an implicit step: angular momentum is kept over the very turn that its velocity leads.

In the frame of a body at the start, with I its principal moments and R(t) = exp(t x): the turn t = h w_free fulfils

    R(t) I t = h L,    L = I w,

since R(t)^T t = t. Newton's method, ``(R I - [R I t]x J(t)) dt = h L - R I t``, J the left Jacobian of the exponential;
turns come in pieces that are small enough for it. Bodies that turn by more than `MOST` in a step keep their velocity:
such a step says nothing of how they tumble, and so their energy stays within that of their largest and smallest moments.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.bodies.stiffness import skew

ITERATIONS = 30
ROUND_OFF = 1e-14
MOST = 3.0  # [rad]
PIECE = 0.5  # [rad] of a turn at the old velocity that is solved for at once


def implicit_turn(inertia: np.ndarray, w: np.ndarray, h: float) -> np.ndarray:
    """Angular velocities (b, 3) that end a free step of ``h``, in the frame at its start; ``inertia`` (b, 3), ``w`` (b, 3)."""
    out = w.copy()
    some = h * np.linalg.norm(w, axis=1) <= MOST
    if some.any():
        out[some] = _turns(inertia[some], w[some], h) / h
    return out


def _turns(inertia: np.ndarray, w: np.ndarray, h: float) -> np.ndarray:
    momentum = inertia * w
    size = np.linalg.norm(momentum, axis=1)
    pieces = max(1, int(np.ceil(h * np.linalg.norm(w, axis=1).max(initial=0.0) / PIECE)))
    turn = np.zeros_like(w)
    for k in range(1, pieces + 1):  # the solution for a part of the step is the start for a larger one
        part = h * k / pieces
        turn = turn * k / max(k - 1, 1) if k > 1 else part * w
        for _ in range(ITERATIONS):
            r = Rotation.from_rotvec(turn).as_matrix()
            here = np.einsum("bij,bj->bi", r, inertia * turn)
            miss = part * momentum - here
            if (np.linalg.norm(miss, axis=1) <= ROUND_OFF * part * size).all():
                break
            slope = r * inertia[:, None, :] - skew(here) @ _left_jacobian(turn)
            turn = turn + np.linalg.solve(slope, miss[:, :, None])[:, :, 0]
    lost = np.linalg.norm(turn, axis=1) > 2.0 * MOST  # does not happen, but a step must not end by it
    return np.where(lost[:, None], h * w, turn)


def _left_jacobian(turn: np.ndarray) -> np.ndarray:
    """J with ``exp(t + dt) = exp(J dt) exp(t)``, to first order."""
    angle = np.linalg.norm(turn, axis=1)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    b = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    x = skew(turn)
    return np.eye(3) + a[:, None, None] * x + b[:, None, None] * (x @ x)
