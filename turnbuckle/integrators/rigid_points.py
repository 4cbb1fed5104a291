"""Points of rigid bodies, mass points tied to them, and directions of rows outside of a step."""

import warp as wp

from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import Bodies, Parts, RowTable, TiedPoints
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def place_points(
    begin: int,
    body: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    local: wp.array(dtype=vec3),
    bodies: Bodies,
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
):
    """Points of rigid bodies, where their bodies are at the end of the step."""
    i = known(begin + wp.tid())
    b = known(body[i])
    arm = wp.quat_rotate(bodies.q1[b], local[i])
    x_out[point[i]] = bodies.x1[b] + arm
    v_out[point[i]] = bodies.v1[b] + wp.cross(bodies.w1[b], arm)


@wp.kernel
def remember_points(begin: int, points: TiedPoints):
    """``x_free`` of the tied mass points: where the scheme has put them."""
    i = known(begin + wp.tid())
    points.x_free[i] = points.x[points.point[i]]


@wp.kernel
def push_points(begin: int, points: TiedPoints, halves: real):
    """Give the tied mass points the impulses that closed the flight, those of both ``halves`` (1 or 2) of the step.

    Their velocities are those of the end of the step, by the forces of its start: where the scheme's v lags by a step (Verlet:
    v* = w + h/2 a, w* = w + h a), w* + h/2 a = 2 w* - v*. Rigid bodies, which they move with, do not lag. (All other points keep
    the scheme's v: explicit damping is most stable with it.)
    """
    k = known(begin + wp.tid())
    j = points.point[k]
    dv = (points.push[k] * halves + points.blow[k]) / points.mass[k]
    v = points.v[j]
    if points.lags == 1:
        v = points.memory[j] * real(2.0) - v
    points.v[j] = v + dv
    points.memory[j] = points.memory[j] + dv


@wp.kernel
def row_directions(begin: int, bodies: Bodies, points: TiedPoints, parts: Parts, rows: RowTable):
    """Coordinates and directions of the rows of each part, for the poses at the end of the step."""
    evaluate(parts, rows, bodies, points, begin + wp.tid(), 1, 1)
