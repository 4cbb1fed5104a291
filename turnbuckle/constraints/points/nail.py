"""Point to nail (Local, 4.1): a mass point at a goal that is fixed or moves on a script.

With the response ``x = x* + c_i F`` of the scheme, (14) gives the force ``F = (goal - x*) / c_i``, and the point is at
``goal`` exactly. The velocity then gets the rate of the goal by a multiplier of its own; with ``response="paper"`` it
gets ``d_i F`` instead, as in (11).
"""

import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, INVERSE_H, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Nails
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def land_nails(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    goal: wp.array(dtype=vec3),
    goal_now: wp.array(dtype=vec3),
    rate: wp.array(dtype=vec3),
    moving: int,
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Move predicted points onto their goals and write the forces that do it [N]; rows that are fully active."""
    c = known(begin + wp.tid())
    if phase[c] == 0:
        i = known(point[c])
        target = goal[c]
        step = target - x[i]
        f = step * (mass[i] * params[INVERSE_C])
        x[i] = target
        if params[PROJECT] != real(0.0):
            if moving != 0:
                v[i] = rate[c]
                if params[MEMORY] != real(0.0):
                    w[i] = (target - goal_now[c]) * params[INVERSE_H]
            else:  # at rest, and two arrays less to read
                v[i] = vec3()
                if params[MEMORY] != real(0.0):
                    w[i] = vec3()
        else:
            v[i] = v[i] + step * params[D_OVER_C]
            if params[MEMORY] != real(0.0):
                w[i] = w[i] + step * params[INVERSE_H]
        if params[ADD] != real(0.0):
            force_out[c] = force_out[c] + f
        else:
            force_out[c] = f


@wp.kernel
def close_nails(
    begin: int,
    point: wp.array(dtype=wp.int32),
    goal: wp.array(dtype=vec3),
    goal_now: wp.array(dtype=vec3),
    rate: wp.array(dtype=vec3),
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
):
    """As `land_nails`, for rows in gradual activation."""
    c = known(begin + wp.tid())
    n = phase[c]
    if n > 0:
        i = known(point[c])
        h = params[H]
        free = x[i]
        paper = ramp_paper[c]
        gap = x_now[i] - goal_now[c]
        kept = kept_fraction(n, ramp_step[c], paper, ramp_speed[c], wp.length(gap), h)
        target = goal[c] + kept * gap
        final = rate[c] + gap * wp.where(kept > real(0.0), (kept - real(1.0)) / h, real(0.0))
        project = params[PROJECT] != real(0.0)
        if paper != wp.uint8(0):
            target = goal[c] + kept * (free - goal[c])
            project = project and kept == real(0.0)
        advance(c, kept, phase, ramp_step)
        step = target - free
        f = step * (mass[i] * params[INVERSE_C])
        if params[ADD] != real(0.0):
            f += force_out[c]
        force_out[c] = f
        x[i] = target
        if project:
            v[i] = final
            if params[MEMORY] != real(0.0):
                w[i] = final
        else:
            v[i] = v[i] + step * params[D_OVER_C]
            if params[MEMORY] != real(0.0):
                w[i] = w[i] + step / h


@wp.kernel
def project_nails(
    begin: int,
    point: wp.array(dtype=wp.int32),
    phase: wp.array(dtype=wp.int32),
    wanted: wp.array(dtype=vec3),
    mass: wp.array(dtype=real),
    y: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Give a rate ``y`` (an acceleration, say) of each nailed point its wanted value; writes ``m dy``."""
    c = known(begin + wp.tid())
    f = vec3()
    if phase[c] == 0:
        i = known(point[c])
        f = (wanted[c] - y[i]) * mass[i]
        y[i] = wanted[c]
    force_out[c] = f


def land(
    program: Program,
    table: Nails,
    mass: wp.array,
    params: wp.array,
    now: Kinematics,
    ahead: Kinematics,
    ramps: bool,
    moving: bool,
) -> None:
    """Record the one exact pass over all nails; ``ramps``: some may be in gradual activation; ``moving``: have moving goals."""
    n, ramp = len(table.phase), table.ramp
    goals = [table.point, table.goal, table.goal_now, table.rate]
    moved = [ahead.x, ahead.v, ahead.memory, table.force]
    program.launch(land_nails, n, [table.phase, *goals, int(moving), mass, params, *moved])
    if ramps:
        program.barrier()
        given = [*goals, ramp.paper, ramp.speed, mass, params, now.x]
        program.launch(close_nails, n, [*given, table.phase, ramp.step, *moved])


def project(program: Program, table: Nails, mass: wp.array, y: wp.array, wanted: wp.array, force_out: wp.array) -> None:
    """Record the projection of a rate ``y`` onto its ``wanted`` values."""
    program.launch(project_nails, len(table.phase), [table.point, table.phase, wanted, mass, y, force_out])
