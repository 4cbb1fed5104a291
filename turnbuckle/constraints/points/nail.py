"""Point to nail (Local, 4.1): a mass point at a goal that is fixed or moves on a script.

With the response ``x = x* + c_i F`` of the scheme, (14) gives the force ``F = (goal - x*) / c_i``, and the point is at
``goal`` exactly. The velocity then gets the rate of the goal by a multiplier of its own; with ``response="paper"`` it
gets ``d_i F`` instead, as in (11).
"""

import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Nails
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def land_nails(
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
    """Move predicted points onto their goals and write the forces that do it [N]."""
    c = begin + wp.tid()
    n = phase[c]
    if n >= 0:
        i = point[c]
        h = params[H]
        free = x[i]
        target = goal[c]
        average = (target - goal_now[c]) / h
        final = rate[c]
        project = params[PROJECT] != real(0.0)
        if n > 0:
            gap = x_now[i] - goal_now[c]
            paper = ramp_paper[c]
            kept = kept_fraction(n, ramp_step[c], paper, ramp_speed[c], wp.length(gap), h)
            if paper != wp.uint8(0):
                target += kept * (free - target)
                project = project and kept == real(0.0)
            else:
                target += kept * gap
                closing = gap * ((kept - real(1.0)) / h)
                average += closing
                if kept > real(0.0):
                    final += closing
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
                w[i] = average
                if n > 0:
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
    c = begin + wp.tid()
    f = vec3()
    if phase[c] == 0:
        i = point[c]
        f = (wanted[c] - y[i]) * mass[i]
        y[i] = wanted[c]
    force_out[c] = f


def land(program: Program, table: Nails, mass: wp.array, params: wp.array, now: Kinematics, ahead: Kinematics) -> None:
    """Record the one exact pass over all nails."""
    ramp = table.ramp
    given = [table.point, table.goal, table.goal_now, table.rate, ramp.paper, ramp.speed, mass, params, now.x]
    program.launch(
        land_nails, len(table.phase), [*given, table.phase, ramp.step, ahead.x, ahead.v, ahead.memory, table.force]
    )


def project(program: Program, table: Nails, mass: wp.array, y: wp.array, wanted: wp.array, force_out: wp.array) -> None:
    """Record the projection of a rate ``y`` onto its ``wanted`` values."""
    program.launch(project_nails, len(table.phase), [table.point, table.phase, wanted, mass, y, force_out])
