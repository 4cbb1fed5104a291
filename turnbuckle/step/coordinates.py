"""Coordinates of parts of joints in NumPy: the place along an axis, a distance, an angle, a twist."""

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.rigid import JointParts
from turnbuckle.geometry.quaternions import conjugate, multiply, rotate


def coordinates(parts: JointParts, which: np.ndarray, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The bounded coordinate of the parts ``which`` (k,) [m or rad] for poses ``x`` (n, 3), ``q`` (n, 4); 0 without one."""
    a, b, kind = parts.a[which], parts.b[which], parts.kind[which]
    frame_a, frame_b = multiply(q[a], parts.q_a[which]), multiply(q[b], parts.q_b[which])
    d = x[a] + rotate(q[a], parts.p_a[which]) - x[b] - rotate(q[b], parts.p_b[which])
    up = np.tile([0.0, 0.0, 1.0], (len(which), 1))
    z_a, z_b = rotate(frame_a, up), rotate(frame_b, up)
    along = np.sum(d * z_b, axis=1)
    relative = multiply(conjugate(frame_b), frame_a)
    sign = np.where(relative[:, 3] < 0.0, -1.0, 1.0)
    out = np.zeros(len(which))
    values = {
        rigid.SEGMENT: along,
        rigid.MOTOR_AXIAL: along,
        rigid.RING: np.linalg.norm(d - along[:, None] * z_b, axis=1),
        rigid.SPHERE: np.linalg.norm(d, axis=1),
        rigid.ANGLE: np.arctan2(np.linalg.norm(np.cross(z_a, z_b), axis=1), np.sum(z_a * z_b, axis=1)),
        rigid.TWIST: 2.0 * np.arctan2(sign * relative[:, 2], sign * relative[:, 3]),
    }
    values[rigid.MOTOR_TWIST] = values[rigid.TWIST]
    for k, value in values.items():
        out = np.where(kind == k, value, out)
    return out
