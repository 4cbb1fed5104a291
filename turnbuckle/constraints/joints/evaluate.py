"""All kinds of parts: from the poses of two bodies to rows."""

import warp as wp

from turnbuckle.constraints.joints.angle import angle_rows
from turnbuckle.constraints.joints.domain import domain_rows
from turnbuckle.constraints.joints.places import Sides
from turnbuckle.constraints.joints.point import point_rows
from turnbuckle.constraints.joints.ring import ring_rows
from turnbuckle.constraints.joints.rolling import rolling_rows
from turnbuckle.constraints.joints.segment import place_row, segment_rows
from turnbuckle.constraints.joints.sphere import sphere_rows
from turnbuckle.constraints.joints.tie import tie_rows
from turnbuckle.constraints.joints.twist import fixed_rows, twist_row
from turnbuckle.data.articulated import EACH, Bodies, Parts, RowTable, TiedPoints
from turnbuckle.data.rigid import (
    ANGLE,
    FIXED,
    MOTOR_AXIAL,
    MOTOR_TWIST,
    POINT,
    RING,
    ROLLING,
    SEGMENT,
    SPHERE,
    TIE,
    TWIST,
)
from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def sides_of(parts: Parts, p: int, x_a: vec3, q_a: wp.quatd, x_b: vec3, q_b: wp.quatd):
    """Both sides of part ``p`` for given poses of its bodies."""
    s = Sides()
    s.x_a = x_a
    s.x_b = x_b
    s.p = x_a + wp.quat_rotate(q_a, parts.p_a[p])
    s.o = x_b + wp.quat_rotate(q_b, parts.p_b[p])
    s.frame_a = q_a * parts.q_a[p]
    s.frame_b = q_b * parts.q_b[p]
    return s


@wp.func
def evaluate(parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, p: int, ahead: int, freeze: int):
    """Coordinates of the rows of part ``p`` at the start (``ahead`` 0) or the end of the step; ``freeze``: directions too."""
    kind = parts.kind[p]
    i = EACH * p
    count = parts.rows[p]
    if kind == TIE:
        tie_rows(parts, rows, bodies, points, p, ahead, freeze)
        return
    a = parts.a[p]
    b = parts.b[p]
    if kind == POINT:  # the most frequent: it needs no frames
        at = Sides()
        if ahead == 1:
            at.x_a = bodies.x1[a]
            at.x_b = bodies.x1[b]
            at.p = at.x_a + wp.quat_rotate(bodies.q1[a], parts.p_a[p])
            at.o = at.x_b + wp.quat_rotate(bodies.q1[b], parts.p_b[p])
        else:
            at.x_a = bodies.x0[a]
            at.x_b = bodies.x0[b]
            at.p = at.x_a + wp.quat_rotate(bodies.q0[a], parts.p_a[p])
            at.o = at.x_b + wp.quat_rotate(bodies.q0[b], parts.p_b[p])
        point_rows(rows, i, at, freeze)
        return
    now = sides_of(parts, p, bodies.x1[a], bodies.q1[a], bodies.x1[b], bodies.q1[b])
    if ahead == 0 or kind == ROLLING:
        start = sides_of(parts, p, bodies.x0[a], bodies.q0[a], bodies.x0[b], bodies.q0[b])
        if kind == ROLLING:
            turn_a = bodies.q1[a] * wp.quat_inverse(bodies.q0[a])
            turn_b = bodies.q1[b] * wp.quat_inverse(bodies.q0[b])
            if ahead == 0:
                now = start
                turn_a = bodies.q0[a] * wp.quat_inverse(bodies.q0[a])
                turn_b = bodies.q0[b] * wp.quat_inverse(bodies.q0[b])
            rolling_rows(rows, i, parts.hi[p], parts.lo[p], now, start, turn_a, turn_b, freeze)
            return
        now = start
    if kind == SEGMENT:
        segment_rows(rows, i, count, now, freeze)
    elif kind == RING:
        ring_rows(rows, i, count, now, freeze)
    elif kind == SPHERE:
        sphere_rows(rows, i, now, freeze)
    elif kind == ANGLE:
        angle_rows(rows, i, count, now, freeze)
    elif kind == TWIST:
        twist_row(rows, i, now, freeze)
    elif kind == FIXED:
        fixed_rows(rows, i, now, freeze)
    elif kind == MOTOR_AXIAL:
        place_row(rows, i, now, freeze)
    elif kind == MOTOR_TWIST:
        twist_row(rows, i, now, freeze)
    else:
        domain_rows(parts, rows, p, i, now, ahead, freeze)
