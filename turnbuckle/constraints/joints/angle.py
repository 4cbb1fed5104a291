"""Angle between a direction of each body (Displacement, 4.2.1): ``lo <= angle(z_a, z_b) <= hi``.

A torque about ``z_b x z_a`` opens it. An angle of 0 or pi has no gradient: it becomes two rows ``z_b x z_a = 0``.
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, perpendicular, torque_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def angle_rows(rows: RowTable, i: int, count: int, sides: Sides, freeze: int):
    """One row, or two where both directions are one line (``count`` is 2)."""
    a = axis(sides.frame_a, 2)
    b = axis(sides.frame_b, 2)
    n = wp.cross(b, a)
    sine = wp.length(n)
    if count == 2:
        sign = real(1.0)
        if wp.dot(a, b) < real(0.0):
            sign = real(-1.0)  # the host turns frames so that pi becomes 0: here both are upside down
        for k in range(2):
            e = axis(sides.frame_b, k)
            rows.s[i + k] = wp.dot(e, n)
            if sign < real(0.0) and sine < real(1e-3):
                rows.s[i + k] = real(1.0)  # the wrong way round, which the sine alone does not see
            if freeze == 1:
                torque_row(rows, i + k, e)
    else:
        rows.s[i] = wp.atan2(sine, wp.dot(a, b))
        if freeze == 1:
            t = perpendicular(b)
            if sine > real(1e-12):
                t = n / sine
            torque_row(rows, i, t)
