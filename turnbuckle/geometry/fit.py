"""The rigid motion that carries one set of points onto another."""

import numpy as np
from scipy.spatial.transform import Rotation


def fit_pose(local: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) [m] and quaternion xyzw (4,) with ``x = origin + R local`` in the least squares sense.

    ``local`` and ``x`` (n, 3) [m]; exact, to rounding, where they are moved rigidly and do not lie on one line. With
    C = sum x local^T (about the means) = U S V^T it is R = U diag(1, 1, det(U V^T)) V^T (Kabsch 1976).
    """
    here, there = local.mean(axis=0), x.mean(axis=0)
    u, _, vt = np.linalg.svd((x - there).T @ (local - here))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return there - turn @ here, Rotation.from_matrix(turn).as_quat()
