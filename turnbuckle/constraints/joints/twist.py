"""Twist about the axes z of both sides (Displacement, 4.2.2), and the suppression of all rotation.

With the relative rotation ``Q = F_b^-1 F_a = swing twist``, the twist is ``psi = 2 atan2(Q_z, Q_w)``, and

    dpsi/dt = (z_a + z_b) . (w_a - w_b) / (1 + z_a . z_b):

the torque is about the common axis z_a + z_b. (The median plane of the paper, normal to ``a1 - a2``, does not exist where
both axes agree.)
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, torque_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.rotation import rotation_log, twist_angle
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def twist_row(rows: RowTable, i: int, sides: Sides, freeze: int):
    """The twist [rad]."""
    rows.s[i] = twist_angle(wp.quat_inverse(sides.frame_b) * sides.frame_a)
    if freeze == 1:
        a = axis(sides.frame_a, 2)
        b = axis(sides.frame_b, 2)
        torque_row(rows, i, (a + b) / wp.max(real(1.0) + wp.dot(a, b), real(1e-9)))


@wp.func
def fixed_rows(rows: RowTable, i: int, sides: Sides, freeze: int):
    """The relative rotation vector, in b's axes [rad]: all rotation suppressed (4.2.3, note)."""
    r = rotation_log(wp.quat_inverse(sides.frame_b) * sides.frame_a)
    for k in range(3):
        rows.s[i + k] = r[k]
        if freeze == 1:
            torque_row(rows, i + k, axis(sides.frame_b, k))
