"""Rotations of many bodies at once: quaternions xyzw of unit length, shape (n, 4), as plain NumPy arrays."""

import numpy as np

SMALL = 1e-6  # [rad], below, series take the place of sin(a) / a


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows (n, 3); several times faster than `numpy.cross` on short arrays."""
    out = np.empty(a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape))
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    out[..., 0] = a1 * b2 - a2 * b1
    out[..., 1] = a2 * b0 - a0 * b2
    out[..., 2] = a0 * b1 - a1 * b0
    return out


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products of rows."""
    return (a * b).sum(axis=-1)


def norm(a: np.ndarray) -> np.ndarray:
    """Lengths of rows."""
    return np.sqrt((a * a).sum(axis=-1))


def exponential(r: np.ndarray) -> np.ndarray:
    """Rotations about the vectors ``r`` (n, 3) by their length [rad]."""
    angle = norm(r)
    small = angle < SMALL
    safe = np.where(small, 1.0, angle)
    factor = np.where(small, 0.5 - angle * angle / 48.0, np.sin(0.5 * angle) / safe)
    q = np.concatenate([r * factor[:, None], np.cos(0.5 * angle)[:, None]], axis=1)
    return q / norm(q)[:, None]


def logarithm(q: np.ndarray) -> np.ndarray:
    """Rotation vectors (n, 3) [rad], of a length of at most pi."""
    q = np.where(q[:, 3:] < 0.0, -q, q)
    sine = norm(q[:, :3])
    small = sine < SMALL
    safe = np.where(small, 1.0, sine)
    factor = np.where(small, 2.0 / q[:, 3].clip(0.5), 2.0 * np.arctan2(sine, q[:, 3]) / safe)
    return q[:, :3] * factor[:, None]


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rotations ``q`` first, then ``p``."""
    out = np.empty(p.shape if p.shape == q.shape else np.broadcast_shapes(p.shape, q.shape))
    out[:, :3] = p[:, 3:] * q[:, :3] + q[:, 3:] * p[:, :3] + cross(p[:, :3], q[:, :3])
    out[:, 3] = p[:, 3] * q[:, 3] - dot(p[:, :3], q[:, :3])
    return out


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse rotations."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors ``v`` (n, 3), turned."""
    t = 2.0 * cross(q[:, :3], v)
    return v + q[:, 3:] * t + cross(q[:, :3], t)


def matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3)."""
    x, y, z, w = q.T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def twists(q: np.ndarray) -> np.ndarray:
    """Of ``q = swing twist``, the angles of the twists about z (n,), in (-pi, pi] [rad]."""
    sign = np.where(q[:, 3] < 0.0, -1.0, 1.0)
    return 2.0 * np.arctan2(sign * q[:, 2], sign * q[:, 3])
