"""Where the two sides of a joint are, and how a row is written down.

A row has a coordinate s (the equation of each joint is ``s = 0``, ``s = lo`` or ``lo <= s <= hi``), and says how a unit of
its force acts: ``l`` on body a and ``-l`` on body b *at one common point* p, which keeps both momenta, or a torque t on a
and -t on b. Its rate is ``ds/dt = l.(v_a - v_b) + t_a.w_a - t_b.w_b`` with ``t_a = (p - x_a) x l``.
"""

import warp as wp

from turnbuckle.data.articulated import RowTable
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.struct
class Sides:
    """Both sides of a part, in world coordinates."""

    x_a: wp.vec3d  # centres of mass
    x_b: wp.vec3d
    p: wp.vec3d  # P_a
    o: wp.vec3d  # P_b
    frame_a: wp.quatd
    frame_b: wp.quatd


@wp.func
def axis(frame: wp.quatd, k: int):
    """Axis ``k`` of a frame."""
    e = vec3(real(0.0), real(0.0), real(1.0))
    if k == 0:
        e = vec3(real(1.0), real(0.0), real(0.0))
    if k == 1:
        e = vec3(real(0.0), real(1.0), real(0.0))
    return wp.quat_rotate(frame, e)


@wp.func
def force_row(rows: RowTable, i: int, sides: Sides, at: vec3, direction: vec3):
    """Row ``i`` is a force along ``direction`` at the point ``at``."""
    rows.line[i] = direction
    rows.at[i] = at
    rows.t_a[i] = wp.cross(at - sides.x_a, direction)
    rows.t_b[i] = wp.cross(at - sides.x_b, direction)


@wp.func
def torque_row(rows: RowTable, i: int, direction: vec3):
    """Row ``i`` is a torque about ``direction``."""
    rows.line[i] = vec3()
    rows.t_a[i] = direction
    rows.t_b[i] = direction


@wp.func
def perpendicular(a: vec3):
    """A unit vector perpendicular to the unit vector ``a``."""
    e = vec3(real(1.0), real(0.0), real(0.0))
    if wp.abs(a[0]) > real(0.6):
        e = vec3(real(0.0), real(1.0), real(0.0))
    return wp.normalize(e - a * wp.dot(a, e))
