"""Attachment (Local, 4.3): a mass point at fixed weights of the points of a line, triangle or tetrahedron, two-way.

With ``w = (1, -alpha_1, -alpha_2, ...)`` the constraint is ``sum_k w_k x_k = 0`` (26). A force ``w_k F`` on each of the
points closes the gap ``g = sum_k w_k x*_k`` when ``F = -g / sum_k c_k w_k^2``: this is (28), with ``F_0`` in (27) where
the paper prints ``F_i``. The forces sum to zero because the alphas sum to one.
"""

from functools import cache

import numpy as np
import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, INVERSE_H, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Attachments
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def weighted_sum(
    c: int,
    count: int,
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    y: wp.array(dtype=vec3),
):
    """``sum_k w_k y_k``, taken as ``sum_k w_k (y_k - y_0)``, the same since the weights sum to zero."""
    first = y[points[c, 0]]
    total = vec3()
    for k in range(1, count):
        total += weights[c, k] * (y[points[c, k]] - first)
    return total


@wp.func
def inverse_mass(
    c: int,
    count: int,
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    mass: wp.array(dtype=real),
):
    """``sum_k w_k^2 / m_k`` [1/kg]."""
    total = real(0.0)
    for k in range(count):
        total += weights[c, k] * weights[c, k] / mass[points[c, k]]
    return total


@cache
def land_attachments(size: int) -> wp.Kernel:
    """The kernel for rows of ``size`` points (3: line, 4: triangle, 5: tetrahedron), its sums written out."""

    @wp.kernel(module="unique", module_options={"enable_backward": False})
    def land_rows(
        begin: int,
        phase: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        points: wp.array2d(dtype=wp.int32),
        weights: wp.array2d(dtype=real),
        inverse_mass: wp.array(dtype=real),
        params: wp.array(dtype=real),
        x: wp.array(dtype=vec3),
        v: wp.array(dtype=vec3),
        w: wp.array(dtype=vec3),
        force_out: wp.array(dtype=vec3),
    ):
        """Close the gap of each attachment and write the force on its first point [N]; rows that are fully active."""
        c = known(begin + wp.tid())
        if phase[c] == 0 and count[c] == size:
            memory = params[MEMORY] != real(0.0)
            head = known(points[c, 0])
            x0 = x[head]
            v0 = v[head]
            w0 = w[head]
            flexibility = inverse_mass[head]
            gap = vec3()
            gap_v = vec3()
            gap_w = vec3()
            for k in range(1, size):
                i = known(points[c, k])
                a = weights[c, k]
                flexibility += a * a * inverse_mass[i]
                gap += a * (x[i] - x0)
                gap_v += a * (v[i] - v0)
                gap_w += a * (w[i] - w0)
            stiffness = real(1.0) / flexibility
            push = gap * (-stiffness)  # m_k dx_k = w_k push
            v_push = push * params[D_OVER_C]
            w_push = push * params[INVERSE_H]
            if params[PROJECT] != real(0.0):
                v_push = gap_v * (-stiffness)
                w_push = gap_w * (-stiffness)
            for k in range(size):
                i = known(points[c, k])
                share = weights[c, k] * inverse_mass[i]
                x[i] = x[i] + push * share
                v[i] = v[i] + v_push * share
                if memory:
                    w[i] = w[i] + w_push * share
            f = push * params[INVERSE_C]
            if params[ADD] != real(0.0):
                f += force_out[c]
            force_out[c] = f

    return land_rows


@wp.kernel
def close_attachments(
    begin: int,
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
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
    """As `land_attachments`, for rows in gradual activation and any number of points."""
    c = known(begin + wp.tid())
    n = phase[c]
    if n <= 0:
        return
    k_end = count[c]
    h = params[H]
    memory = params[MEMORY] != real(0.0)
    project = params[PROJECT] != real(0.0)
    flexibility = inverse_mass(c, k_end, points, weights, mass)
    gap = weighted_sum(c, k_end, points, weights, x)
    paper = ramp_paper[c]
    gap_now = weighted_sum(c, k_end, points, weights, x_now)
    kept = kept_fraction(n, ramp_step[c], paper, ramp_speed[c], wp.length(gap_now), h)
    advance(c, kept, phase, ramp_step)
    wanted = kept * gap_now
    closing = gap_now * wp.where(kept > real(0.0), (kept - real(1.0)) / h, real(0.0))
    if paper != wp.uint8(0):
        wanted = kept * gap
        project = project and kept == real(0.0)
    push = (wanted - gap) / flexibility  # m_k dx_k = w_k push
    f = push * params[INVERSE_C]
    if params[ADD] != real(0.0):
        f += force_out[c]
    force_out[c] = f
    v_push = push * params[D_OVER_C]
    w_push = push / h
    if project:
        v_push = (closing - weighted_sum(c, k_end, points, weights, v)) / flexibility
        if memory:
            w_push = (closing - weighted_sum(c, k_end, points, weights, w)) / flexibility
    for k in range(k_end):
        i = known(points[c, k])
        share = weights[c, k] / mass[i]
        x[i] = x[i] + push * share
        v[i] = v[i] + v_push * share
        if memory:
            w[i] = w[i] + w_push * share


@wp.kernel
def project_attachments(
    begin: int,
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    phase: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    y: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Make ``sum_k w_k y_k = 0`` for a rate ``y`` (an acceleration, say); writes the force that does it."""
    c = known(begin + wp.tid())
    push = vec3()
    if phase[c] == 0:
        k_end = count[c]
        push = -weighted_sum(c, k_end, points, weights, y) / inverse_mass(c, k_end, points, weights, mass)
        for k in range(k_end):
            i = known(points[c, k])
            y[i] = y[i] + push * (weights[c, k] / mass[i])
    force_out[c] = push


def land(
    program: Program,
    table: Attachments,
    mass: wp.array,
    inverse_mass: wp.array,
    params: wp.array,
    now: Kinematics,
    ahead: Kinematics,
    ramps: bool,
) -> None:
    """Record the one exact pass over all attachments; ``ramps``: some may be in gradual activation."""
    n, ramp = len(table.phase), table.ramp
    places = [table.count, table.points, table.weights]
    moved = [ahead.x, ahead.v, ahead.memory, table.force]
    for size in np.unique(table.count.numpy()[: table.rows]):
        program.launch(land_attachments(int(size)), n, [table.phase, *places, inverse_mass, params, *moved])
    if ramps:
        program.barrier()
        given = [*places, ramp.paper, ramp.speed, mass, params, now.x]
        program.launch(close_attachments, n, [*given, table.phase, ramp.step, *moved])


def project(program: Program, table: Attachments, mass: wp.array, y: wp.array, force_out: wp.array) -> None:
    """Record the projection of a rate ``y``."""
    given = [table.count, table.points, table.weights, table.phase, mass, y]
    program.launch(project_attachments, len(table.phase), [*given, force_out])
