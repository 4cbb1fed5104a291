"""Velocity goal (Local, section 4): a mass point with a wanted velocity.

Default: the point moves with the mean of the goal's velocity over the step (with that at its end in schemes whose
velocity is ``(x+ - x) / h``), and has the goal's velocity at its end; the force is the one of that displacement, as for a
nail. With ``response="paper"`` the force is ``(goal - v*) / d_i``.
Under Verlet this imposes ``(x+ - x) / h``: the central difference (2) would decouple odd and even steps.
"""

import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance
from turnbuckle.data.state import ADD, BACKWARD, D_OVER_C, INVERSE_C, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Velocities
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def land_velocities(
    begin: int,
    point: wp.array(dtype=wp.int32),
    goal: wp.array(dtype=vec3),
    goal_now: wp.array(dtype=vec3),
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x_now: wp.array(dtype=vec3),
    v_now: wp.array(dtype=vec3),
    phase: wp.array(dtype=wp.int32),
    ramp_step: wp.array(dtype=wp.int32),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Give points their wanted velocities and write the forces that do it [N]. A ramp blends from the velocity now."""
    c = begin + wp.tid()
    n = phase[c]
    if n >= 0:
        i = point[c]
        h = params[H]
        final = goal[c]
        average = final
        if params[BACKWARD] == real(0.0):
            average = real(0.5) * (final + goal_now[c])
        if n > 0:
            kept = real(1.0) - real(1.0) / real(wp.max(n - ramp_step[c] + 1, 1))
            final = final + kept * (v_now[i] - final)
            average = final
            advance(c, kept, phase, ramp_step)
        step = vec3()
        if params[PROJECT] != real(0.0):
            target = x_now[i] + average * h
            step = target - x[i]
            x[i] = target
            if params[MEMORY] != real(0.0):
                w[i] = average
        else:
            step = (final - v[i]) / params[D_OVER_C]
            x[i] = x[i] + step
            if params[MEMORY] != real(0.0):
                w[i] = w[i] + step / h
        v[i] = final
        f = step * (mass[i] * params[INVERSE_C])
        if params[ADD] != real(0.0):
            f += force_out[c]
        force_out[c] = f


@wp.kernel
def project_velocities(
    begin: int,
    point: wp.array(dtype=wp.int32),
    phase: wp.array(dtype=wp.int32),
    wanted: wp.array(dtype=vec3),
    less: wp.array(dtype=vec3),
    divisor: wp.array(dtype=real),
    mass: wp.array(dtype=real),
    y: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Give a rate ``y`` the value ``(wanted - less) / divisor[0]``; writes ``m dy``."""
    c = begin + wp.tid()
    f = vec3()
    if phase[c] == 0:
        i = point[c]
        target = (wanted[c] - less[c]) / divisor[0]
        f = (target - y[i]) * mass[i]
        y[i] = target
    force_out[c] = f


def land(
    program: Program, table: Velocities, mass: wp.array, params: wp.array, now: Kinematics, ahead: Kinematics
) -> None:
    """Record the one exact pass over all velocity goals."""
    given = [table.point, table.goal, table.goal_now, mass, params, now.x, now.v, table.phase, table.ramp.step]
    program.launch(land_velocities, len(table.phase), [*given, ahead.x, ahead.v, ahead.memory, table.force])


def project(
    program: Program, table: Velocities, params: wp.array, mass: wp.array, y: wp.array, force_out: wp.array
) -> None:
    """Record the projection of accelerations ``y`` onto the rate of the goals (`params[0]` is the step)."""
    given = [table.point, table.phase, table.goal, table.goal_now, params, mass, y]
    program.launch(project_velocities, len(table.phase), [*given, force_out])


def project_onto_goal(
    program: Program, table: Velocities, zero: wp.array, one: wp.array, mass: wp.array, v: wp.array, force_out: wp.array
) -> None:
    """Record the projection of velocities onto the goals themselves."""
    given = [table.point, table.phase, table.goal, zero, one, mass, v]
    program.launch(project_velocities, len(table.phase), [*given, force_out])
