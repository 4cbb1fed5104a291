"""Points to point (Local, 4.2): n mass points at one place, which is free.

The forces (22) sum to zero and land all points at their centre of mass (25) (``c_i`` is proportional to ``1/m_i`` in
every explicit scheme), so the total momentum is kept. Offsets are taken from the first point, so that differences are
exact to round-off of the *gap*, not of the coordinates.
"""

import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Joins
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def mean_offset(
    lo: int, hi: int, points: wp.array(dtype=wp.int32), mass: wp.array(dtype=real), y: wp.array(dtype=vec3)
):
    """The mass-weighted mean of ``y`` over the points of a row, from the value of its first point."""
    first = y[points[lo]]
    total = real(0.0)
    moment = vec3()
    for e in range(lo, hi):
        i = points[e]
        m = mass[i]
        total += m
        moment += m * (y[i] - first)
    return moment / total


@wp.kernel
def land_joins(
    begin: int,
    offsets: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.int32),
    ramp_paper: wp.array(dtype=wp.uint8),
    ramp_speed: wp.array(dtype=real),
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x_now: wp.array(dtype=vec3),
    phase: wp.array(dtype=wp.int32),
    ramp_step: wp.array(dtype=wp.int32),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    point_force_out: wp.array(dtype=vec3),
):
    """Bring the points of each row to their centre of mass and write the forces that do it [N]."""
    c = begin + wp.tid()
    n = phase[c]
    if n < 0:
        return
    lo = offsets[c]
    hi = offsets[c + 1]
    h = params[H]
    per_force = params[INVERSE_C]
    memory = params[MEMORY] != real(0.0)
    project = params[PROJECT] != real(0.0)
    head = points[lo]
    x0 = x[head]
    v0 = v[head]
    w0 = w[head]
    if n == 0 and hi == lo + 2 and project:  # the common case without its loops, three times as fast
        i = points[lo + 1]
        m0 = mass[head]
        share = mass[i] / (m0 + mass[i])
        step0 = (x[i] - x0) * share
        f = step0 * (m0 * per_force)
        if params[ADD] != real(0.0):
            f += point_force_out[lo]
        place = x0 + step0
        drift = v0 + (v[i] - v0) * share
        x[head] = place
        x[i] = place
        v[head] = drift
        v[i] = drift
        if memory:
            drift_w = w0 + (w[i] - w0) * share
            w[head] = drift_w
            w[i] = drift_w
        force_out[c] = f
        point_force_out[lo] = f
        point_force_out[lo + 1] = -f
        return
    total = real(0.0)
    x_mean = vec3()
    v_mean = vec3()
    w_mean = vec3()
    for e in range(lo, hi):
        i = points[e]
        m = mass[i]
        total += m
        x_mean += m * (x[i] - x0)
        v_mean += m * (v[i] - v0)
        if memory:
            w_mean += m * (w[i] - w0)
    x_mean = x_mean / total
    v_mean = v0 + v_mean / total
    w_mean = w0 + w_mean / total
    place = x0 + x_mean
    kept = real(0.0)
    ramped = real(0.0)  # 1: the row keeps a part of each point's offset, and closes with a velocity
    paper = False
    now0 = vec3()
    now_mean = vec3()
    if n > 0:
        paper = ramp_paper[c] != wp.uint8(0)
        now0 = x_now[head]
        now_mean = mean_offset(lo, hi, points, mass, x_now)
        gap = real(0.0)
        for e in range(lo, hi):
            gap = wp.max(gap, wp.length(x_now[points[e]] - now0 - now_mean))
        kept = kept_fraction(n, ramp_step[c], ramp_paper[c], ramp_speed[c], gap, h)
        advance(c, kept, phase, ramp_step)
        if kept > real(0.0):
            ramped = real(1.0)
            if paper:
                project = False
    for e in range(lo, hi):
        i = points[e]
        xi = x[i]
        offset = vec3()
        closing = vec3()
        if ramped != real(0.0):
            if paper:
                offset = kept * ((xi - x0) - x_mean)
            else:
                gap_i = (x_now[i] - now0) - now_mean
                offset = kept * gap_i
                closing = gap_i * ((kept - real(1.0)) / h)
        step = x_mean - (xi - x0) + offset
        f = step * (mass[i] * per_force)
        if params[ADD] != real(0.0):
            f += point_force_out[e]
        point_force_out[e] = f
        if e == lo:
            force_out[c] = f
        x[i] = place + offset
        if project:
            v[i] = v_mean + closing
            if memory:
                w[i] = w_mean + closing
        else:
            v[i] = v[i] + step * params[D_OVER_C]
            if memory:
                w[i] = w[i] + step / h


@wp.kernel
def project_joins(
    begin: int,
    offsets: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.int32),
    phase: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    y: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    point_force_out: wp.array(dtype=vec3),
):
    """Give a rate ``y`` (an acceleration, say) of all points of a row its mass-weighted mean; writes ``m dy``."""
    c = begin + wp.tid()
    lo = offsets[c]
    hi = offsets[c + 1]
    if phase[c] != 0:
        force_out[c] = vec3()
        for e in range(lo, hi):
            point_force_out[e] = vec3()
    else:
        y0 = y[points[lo]]
        mean = mean_offset(lo, hi, points, mass, y)
        for e in range(lo, hi):
            i = points[e]
            f = (mean - (y[i] - y0)) * mass[i]
            point_force_out[e] = f
            if e == lo:
                force_out[c] = f
            y[i] = y0 + mean


def land(program: Program, table: Joins, mass: wp.array, params: wp.array, now: Kinematics, ahead: Kinematics) -> None:
    """Record the one exact pass over all rows."""
    ramp = table.ramp
    given = [table.offsets, table.points, ramp.paper, ramp.speed, mass, params, now.x]
    out = [ahead.x, ahead.v, ahead.memory, table.force, table.point_force]
    program.launch(land_joins, len(table.phase), [*given, table.phase, ramp.step, *out])


def project(
    program: Program, table: Joins, mass: wp.array, y: wp.array, force_out: wp.array, point_force_out: wp.array
) -> None:
    """Record the projection of a rate ``y``."""
    given = [table.offsets, table.points, table.phase, mass, y]
    program.launch(project_joins, len(table.phase), [*given, force_out, point_force_out])
