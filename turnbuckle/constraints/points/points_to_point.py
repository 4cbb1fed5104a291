"""Points to point (Local, 4.2): n mass points at one place, which is free.

The forces (22) sum to zero and land all points at their centre of mass (25) (``c_i`` is proportional to ``1/m_i`` in
every explicit scheme), so the total momentum is kept. Offsets are taken from the first point, so that differences are
exact to round-off of the *gap*, not of the coordinates.
"""

import numpy as np
import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, INVERSE_H, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Joins
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def mean_offset(
    lo: int, hi: int, points: wp.array(dtype=wp.int32), mass: wp.array(dtype=real), y: wp.array(dtype=vec3)
):
    """The mass-weighted mean of ``y`` over the points of a row, from the value of its first point."""
    first = y[points[lo]]
    total = real(0.0)
    sum_x = real(0.0)  # numbers, not a vector: the sums stay in registers
    sum_y = real(0.0)
    sum_z = real(0.0)
    for e in range(lo, hi):
        i = known(points[e])
        m = mass[i]
        d = y[i] - first
        total += m
        sum_x += m * d[0]
        sum_y += m * d[1]
        sum_z += m * d[2]
    return vec3(sum_x / total, sum_y / total, sum_z / total)


@wp.kernel
def land_pairs(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    point_force_out: wp.array(dtype=vec3),
):
    """As `land_joins` for rows of two points, without its loops and three times as fast."""
    c = known(begin + wp.tid())
    lo = known(offsets[c])
    if phase[c] == 0 and offsets[c + 1] == lo + 2:
        i = known(points[lo])
        j = known(points[lo + 1])
        mi = mass[i]
        mj = mass[j]
        share = mj / (mi + mj)
        gap = x[j] - x[i]
        step = gap * share
        place = x[i] + step
        f = step * (mi * params[INVERSE_C])
        x[i] = place
        x[j] = place
        if params[PROJECT] != real(0.0):
            drift = v[i] + (v[j] - v[i]) * share
            v[i] = drift
            v[j] = drift
            if params[MEMORY] != real(0.0):
                drift_w = w[i] + (w[j] - w[i]) * share
                w[i] = drift_w
                w[j] = drift_w
        else:
            other = step - gap
            v[i] = v[i] + step * params[D_OVER_C]
            v[j] = v[j] + other * params[D_OVER_C]
            if params[MEMORY] != real(0.0):
                w[i] = w[i] + step * params[INVERSE_H]
                w[j] = w[j] + other * params[INVERSE_H]
        if params[ADD] != real(0.0):
            f += point_force_out[lo]
        force_out[c] = f
        point_force_out[lo] = f
        point_force_out[lo + 1] = -f


@wp.kernel
def land_joins(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    point_force_out: wp.array(dtype=vec3),
):
    """Bring the points of each row to their centre of mass and write the forces that do it [N]; rows fully active."""
    c = known(begin + wp.tid())
    lo = known(offsets[c])
    hi = offsets[c + 1]
    if phase[c] == 0 and hi > lo + 2:
        memory = params[MEMORY] != real(0.0)
        project = params[PROJECT] != real(0.0)
        head = known(points[lo])
        x0 = x[head]
        v0 = v[head]
        w0 = w[head]
        total = real(0.0)
        xx = real(0.0)  # sums of m (x - x0), m (v - v0), m (w - w0); numbers, not vectors, stay in registers
        xy = real(0.0)
        xz = real(0.0)
        vx = real(0.0)
        vy = real(0.0)
        vz = real(0.0)
        wx = real(0.0)
        wy = real(0.0)
        wz = real(0.0)
        for e in range(lo, hi):
            i = known(points[known(e)])
            m = mass[i]
            dx = x[i] - x0
            dv = v[i] - v0
            dw = w[i] - w0
            total += m
            xx += m * dx[0]
            xy += m * dx[1]
            xz += m * dx[2]
            vx += m * dv[0]
            vy += m * dv[1]
            vz += m * dv[2]
            wx += m * dw[0]
            wy += m * dw[1]
            wz += m * dw[2]
        share = real(1.0) / total
        x_mean = vec3(xx, xy, xz) * share
        place = x0 + x_mean
        drift = v0 + vec3(vx, vy, vz) * share
        drift_w = w0 + vec3(wx, wy, wz) * share
        for e in range(lo, hi):
            i = known(points[e])
            step = x_mean - (x[i] - x0)
            f = step * (mass[i] * params[INVERSE_C])
            if params[ADD] != real(0.0):
                f += point_force_out[e]
            point_force_out[e] = f
            x[i] = place
            if project:
                v[i] = drift
                if memory:
                    w[i] = drift_w
            else:
                v[i] = v[i] + step * params[D_OVER_C]
                if memory:
                    w[i] = w[i] + step * params[INVERSE_H]
        force_out[c] = point_force_out[lo]


@wp.kernel
def close_joins(
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
    """As `land_joins`, for rows in gradual activation: each point keeps a part of its offset from the centre of mass."""
    c = known(begin + wp.tid())
    n = phase[c]
    if n > 0:
        lo = known(offsets[c])
        hi = offsets[c + 1]
        h = params[H]
        memory = params[MEMORY] != real(0.0)
        paper = ramp_paper[c] != wp.uint8(0)
        x0 = x[points[lo]]
        now0 = x_now[points[lo]]
        x_mean = mean_offset(lo, hi, points, mass, x)
        now_mean = mean_offset(lo, hi, points, mass, x_now)
        drift = v[points[lo]] + mean_offset(lo, hi, points, mass, v)
        drift_w = w[points[lo]] + mean_offset(lo, hi, points, mass, w)
        gap = real(0.0)
        for e in range(lo, hi):
            gap = wp.max(gap, wp.length(x_now[points[e]] - now0 - now_mean))
        kept = kept_fraction(n, ramp_step[c], ramp_paper[c], ramp_speed[c], gap, h)
        advance(c, kept, phase, ramp_step)
        project = params[PROJECT] != real(0.0) and not (paper and kept > real(0.0))
        closing_rate = wp.where(kept > real(0.0), (kept - real(1.0)) / h, real(0.0))
        for e in range(lo, hi):
            i = known(points[e])
            free = (x[i] - x0) - x_mean
            now = (x_now[i] - now0) - now_mean
            offset = now * kept
            if paper:
                offset = free * kept
            step = offset - free
            f = step * (mass[i] * params[INVERSE_C])
            if params[ADD] != real(0.0):
                f += point_force_out[e]
            point_force_out[e] = f
            x[i] = x0 + x_mean + offset
            if project:
                v[i] = drift + now * closing_rate
                if memory:
                    w[i] = drift_w + now * closing_rate
            else:
                v[i] = v[i] + step * params[D_OVER_C]
                if memory:
                    w[i] = w[i] + step / h
        force_out[c] = point_force_out[lo]


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
    c = known(begin + wp.tid())
    lo = known(offsets[c])
    hi = offsets[c + 1]
    if phase[c] != 0:
        force_out[c] = vec3()
        for e in range(lo, hi):
            point_force_out[e] = vec3()
    else:
        y0 = y[points[lo]]
        mean = mean_offset(lo, hi, points, mass, y)
        for e in range(lo, hi):
            i = known(points[e])
            f = (mean - (y[i] - y0)) * mass[i]
            point_force_out[e] = f
            if e == lo:
                force_out[c] = f
            y[i] = y0 + mean


def land(
    program: Program, table: Joins, mass: wp.array, params: wp.array, now: Kinematics, ahead: Kinematics, ramps: bool
) -> None:
    """Record the one exact pass over all rows; ``ramps``: some may be in gradual activation."""
    n, ramp = len(table.phase), table.ramp
    moved = [ahead.x, ahead.v, ahead.memory, table.force, table.point_force]
    sizes = np.diff(table.offsets.numpy()[: table.rows + 1])
    if (sizes == 2).any():
        program.launch(land_pairs, n, [table.phase, table.offsets, table.points, mass, params, *moved])
    if (sizes > 2).any():
        given = [table.phase, table.offsets, table.points, mass, params]
        program.launch(land_joins, n, [*given, *moved], int(sizes.mean()))
    if ramps:
        program.barrier()
        given = [table.offsets, table.points, ramp.paper, ramp.speed, mass, params, now.x]
        program.launch(close_joins, n, [*given, table.phase, ramp.step, *moved])


def project(
    program: Program, table: Joins, mass: wp.array, y: wp.array, force_out: wp.array, point_force_out: wp.array
) -> None:
    """Record the projection of a rate ``y``."""
    given = [table.offsets, table.points, table.phase, mass, y]
    program.launch(project_joins, len(table.phase), [*given, force_out, point_force_out])
