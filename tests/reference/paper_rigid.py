"""Displacement (1)-(4) as printed, in the plainest NumPy: first order, R made orthonormal again after every step."""

import numpy as np

from reference.multibody import skew


def nearest_rotation(r: np.ndarray) -> np.ndarray:
    """The rotation next to a matrix in the sense of least squares."""
    u, _, v = np.linalg.svd(r)
    return u @ v


def step(x, r, v, w, force, torque, mass, inertia, dt):
    """One step of a body without constraints; ``inertia`` (3, 3) in body axes, R takes body axes to the world."""
    j = r @ inertia @ r.T
    v = v + force / mass * dt  # (1)
    w = w + np.linalg.solve(j, torque - np.cross(w, j @ w)) * dt  # (2)
    x = x + v * dt  # (3)
    return x, nearest_rotation((np.eye(3) + dt * skew(w)) @ r), v, w  # (4)
