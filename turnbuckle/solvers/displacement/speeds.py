"""Speeds from the displacements that were reached (Displacement, 2.2, step 3)."""

from typing import Literal

import numpy as np

from turnbuckle.geometry.quaternions import conjugate, logarithm, matrices, multiply


def reached_speeds(
    x0: np.ndarray,
    q0: np.ndarray,
    x1: np.ndarray,
    q1: np.ndarray,
    dt: float,
    how: Literal["logarithm", "paper"] = "logarithm",
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities of centres of mass (n, 3) [m/s] and angular velocities (n, 3) [rad/s] in world axes.

    "logarithm" is exact for constant angular velocity. "paper" is ``(R1 R0^-1 - I) / dt`` as printed, read as the dual
    of its skew part; it loses speed, for ``sin(a) < a``.
    """
    turn = multiply(q1, conjugate(q0))
    if how == "paper":
        r = matrices(turn)
        w = 0.5 * np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1)
    else:
        w = logarithm(turn)
    return (x1 - x0) / dt, w / dt
