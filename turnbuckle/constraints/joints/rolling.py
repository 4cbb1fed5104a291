"""A wheel or ball that rolls on a plane without slip.

The plane goes through P_b with normal n = z_b, the wheel has its centre at P_a, axle u = z_a and radius R = hi (a ball has
no axle: lo = 1). It touches at ``K = P_a + c``, ``c = -R (n - u (u.n)) / |...|``. One row holds K on the plane,
``n.(K - P_b) = 0``; two forbid slip: the material points of both bodies at K move alike across n. Over a step, that is the
way ``s = e.(move of a at K - move of b at K) = 0`` with c in the middle of the step.
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, force_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.rotation import rotation_log
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def contact_arm(sides: Sides, radius: real, ball: real):
    """From the centre of the wheel to where it touches, c."""
    n = axis(sides.frame_b, 2)
    down = n
    if ball < real(0.5):
        u = axis(sides.frame_a, 2)
        down = wp.normalize(n - u * wp.dot(u, n))
    return down * (-radius)


@wp.func
def rolling_rows(
    rows: RowTable, i: int, radius: real, ball: real, now: Sides, start: Sides, turn_a: wp.quatd, turn_b: wp.quatd,
    freeze: int,
):  # fmt: skip
    """Height, and the way slipped since ``start``; ``turn_a``, ``turn_b``: rotations of both bodies since then."""
    arm = contact_arm(now, radius, ball)
    k = now.p + arm
    n = axis(now.frame_b, 2)
    rows.s[i] = wp.dot(n, k - now.o)
    if freeze == 1:
        force_row(rows, i, now, k, n)
    arm0 = contact_arm(start, radius, ball)
    c = (arm + arm0) * real(0.5)
    middle = (now.p + start.p) * real(0.5) + c
    way = now.p - start.p + wp.cross(rotation_log(turn_a), c)
    way -= now.x_b - start.x_b + wp.cross(rotation_log(turn_b), middle - (now.x_b + start.x_b) * real(0.5))
    for d in range(2):
        e = axis(now.frame_b, d)
        rows.s[i + 1 + d] = wp.dot(e, way)
        if freeze == 1:
            force_row(rows, i + 1 + d, now, k, e)
