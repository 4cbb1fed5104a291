"""Sliding (Local, 4.4): a mass point held on a line, a triangle or a triangulated surface, without friction, two-way.

The *predicted* point is projected onto the *predicted* domain. The gap to its closest point is then normal to the domain,
so the force of (28) with the weights of that closest point is normal too, and where the closest point lies on an edge or
corner the force lies between the normals that meet there: the point crosses edges and corners smoothly. At the rim of a
surface or the end of a line the closest point stays on the rim: the point is stopped there and leaves only inwards.

The velocity is put on the domain along the held directions alone: the normal of a face, all but the tangent on a line or
a rim, all three at an end or a rim corner. From one face to the next it turns without loss: what is tangent to the face
with normal n1 is mirrored on the plane between both faces, whose normal is ``b ~ n1 + n2``, which makes it tangent to the
other, as long as before. (Projecting it would take half the energy at an edge of 45 degrees.) Ends and rims stop a point
for good. A point of the domain that is nailed does not give way; its nail takes the
force (see `land`). Where the closest place is, `slide_search.py` finds.
"""

import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.attach import weighted_sum
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.constraints.points.slide_search import Surfaces, element_place, held_directions
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Slides
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def slide_inverse_mass(
    c: int,
    count: int,
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    mass: wp.array(dtype=real),
    nailed: wp.array(dtype=wp.int32),
):
    """``sum_k w_k^2 / m_k`` over the points that give way [1/kg]."""
    total = real(0.0)
    for k in range(count):
        i = points[c, k]
        if nailed[i] < 0:
            total += weights[c, k] * weights[c, k] / mass[i]
    return total


@wp.kernel
def land_slides(
    begin: int,
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    directions: wp.array(dtype=wp.mat33d),
    nailed: wp.array(dtype=wp.int32),
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
    closing_out: wp.array(dtype=vec3),
):
    """Put each point onto its place; writes the force on the point [N], and the rate at which a ramp closes [m/s].

    Where the velocity gets no multiplier of its own (the paper's response, or its ramp) it gets ``d_i F`` here, and the
    closing rate is set to NaN.
    """
    c = begin + wp.tid()
    n = phase[c]
    if n < 0:
        return
    k_end = count[c]
    h = params[H]
    memory = params[MEMORY] != real(0.0)
    project = params[PROJECT] != real(0.0)
    flexibility = slide_inverse_mass(c, k_end, points, weights, mass, nailed)
    gap = weighted_sum(c, k_end, points, weights, x)
    wanted = vec3()
    closing = vec3()
    if n > 0:
        paper = ramp_paper[c]
        gap_now = weighted_sum(c, k_end, points, weights, x_now)
        kept = kept_fraction(n, ramp_step[c], paper, ramp_speed[c], wp.length(gap_now), h)
        advance(c, kept, phase, ramp_step)
        if kept > real(0.0):
            if paper != wp.uint8(0):
                wanted = kept * gap
                project = False
            else:
                wanted = directions[c] * (kept * gap_now)
                closing = gap_now * ((kept - real(1.0)) / h)
    push = (wanted - gap) / flexibility
    f = push * params[INVERSE_C]
    if params[ADD] != real(0.0):
        f += force_out[c]
    force_out[c] = f
    for k in range(k_end):
        i = points[c, k]
        if nailed[i] < 0:
            share = weights[c, k] / mass[i]
            x[i] = x[i] + push * share
            if not project:
                v[i] = v[i] + push * (share * params[D_OVER_C])
                if memory:
                    w[i] = w[i] + push * (share / h)
    if not project:
        closing = vec3(wp.nan)
    closing_out[c] = closing


@wp.func
def moved_directions(
    c: int,
    e: int,
    count: int,
    weights: wp.array2d(dtype=real),
    elements: wp.array2d(dtype=wp.int32),
    rim: wp.array(dtype=wp.int32),
    x: wp.array(dtype=vec3),
    before: wp.mat33d,
):
    """Held directions on the domain where it is *now*, since landing has moved it.

    Inside a face, on a line or a rim they are those of the moved element. On an inner edge or corner they stay those of
    the gap that was closed: the point has no gap any more.
    """
    bary = vec3(-weights[c, 1], -weights[c, 2], real(0.0))
    inside = True
    if count == 4:
        bary = vec3(-weights[c, 1], -weights[c, 2], -weights[c, 3])
        inside = bary[0] > real(0.0) and bary[1] > real(0.0) and bary[2] > real(0.0)
    here = element_place(e, bary, elements, x)
    fresh = held_directions(here, e, bary, elements, rim, x)
    if inside or wp.trace(fresh) > real(1.5):  # a face, a line, or really on the rim
        return fresh
    return before


@wp.kernel
def refresh_directions(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    element: wp.array(dtype=wp.int32),
    elements: wp.array2d(dtype=wp.int32),
    rim: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    x: wp.array(dtype=vec3),
    directions: wp.array(dtype=wp.mat33d),
):
    """Take the held directions of all acting rows from positions ``x``."""
    c = begin + wp.tid()
    if phase[c] != -1:
        directions[c] = moved_directions(c, element[c], count[c], weights, elements, rim, x, directions[c])


@wp.func
def single_normal(directions: wp.mat33d):
    """n where the held directions are n n^T, else 0."""
    n = vec3()
    if wp.trace(directions) < real(1.5):
        column = vec3(directions[0, 0], directions[1, 0], directions[2, 0])
        for k in range(1, 3):
            other = vec3(directions[0, k], directions[1, k], directions[2, k])
            if wp.length_sq(other) > wp.length_sq(column):
                column = other
        n = wp.normalize(column)
    return n


@wp.kernel
def guide_slides(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    directions: wp.array(dtype=wp.mat33d),
    normal: wp.array(dtype=vec3),
    nailed: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    closing: wp.array(dtype=vec3),
    y: wp.array(dtype=vec3),
):
    """Put the velocities ``y`` (v, or Verlet's w) along the domain, or at the rate at which a ramp closes."""
    c = begin + wp.tid()
    if phase[c] < 0 or wp.isnan(closing[c][0]):
        return
    k_end = count[c]
    flexibility = slide_inverse_mass(c, k_end, points, weights, mass, nailed)
    u = weighted_sum(c, k_end, points, weights, y)
    change = directions[c] * (closing[c] - u)
    n1 = normal[c]
    n2 = single_normal(directions[c])
    if wp.dot(n1, n2) < real(0.0):
        n2 = -n2
    if wp.length_sq(closing[c]) == real(0.0) and wp.dot(n1, n2) > real(0.0):
        along = u - n1 * wp.dot(n1, u)
        b = wp.normalize(n1 + n2)
        along = along - b * (real(2.0) * wp.dot(b, along))
        along = along - n2 * wp.dot(n2, along)  # round-off
        change = along - u
    push = change / flexibility
    for k in range(k_end):
        i = points[c, k]
        if nailed[i] < 0:
            y[i] = y[i] + push * (weights[c, k] / mass[i])


@wp.kernel
def remember_normals(
    begin: int, phase: wp.array(dtype=wp.int32), directions: wp.array(dtype=wp.mat33d), normal_out: wp.array(dtype=vec3)
):
    """Keep the normals for the next step."""
    c = begin + wp.tid()
    n = vec3()
    if phase[c] == 0:
        n = single_normal(directions[c])
    normal_out[c] = n


@wp.kernel
def project_slides(
    begin: int,
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    directions: wp.array(dtype=wp.mat33d),
    nailed: wp.array(dtype=wp.int32),
    phase: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    y: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
):
    """Remove a rate ``y`` relative to the domain along the held directions; writes the force that does it."""
    c = begin + wp.tid()
    push = vec3()
    if phase[c] == 0:
        k_end = count[c]
        flexibility = slide_inverse_mass(c, k_end, points, weights, mass, nailed)
        push = directions[c] * (-weighted_sum(c, k_end, points, weights, y) / flexibility)
        for k in range(k_end):
            i = points[c, k]
            if nailed[i] < 0:
                y[i] = y[i] + push * (weights[c, k] / mass[i])
    force_out[c] = push


@wp.kernel
def pass_to_nails(
    begin: int,
    rows: int,
    phase: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    nailed: wp.array(dtype=wp.int32),
    force: wp.array(dtype=vec3),
    nail_force_out: wp.array(dtype=vec3),
):
    """What a slide pushes onto a nailed point, the nail takes. One thread: several slides may push one nail."""
    for c in range(rows):
        if phase[c] >= 0:
            for k in range(count[c]):
                nail = nailed[points[c, k]]
                if nail >= 0:
                    nail_force_out[nail] = nail_force_out[nail] - force[c] * weights[c, k]


def moved_domain(table: Slides, surfaces: Surfaces, x: wp.array) -> list:
    """The inputs of `refresh_directions`."""
    domain = [table.element, surfaces.elements, surfaces.rim]
    return [table.phase, *domain, table.count, table.weights, x, table.directions]


def land(
    program: Program,
    table: Slides,
    surfaces: Surfaces,
    nailed: wp.array,
    nail_force: wp.array,
    closing: wp.array,
    mass: wp.array,
    params: wp.array,
    now: Kinematics,
    ahead: Kinematics,
    memory: bool,
) -> None:
    """Record the passes over all rows. ``nailed[i]`` is the nail that holds point i, -1 without; ``closing`` is scratch."""
    n, ramp = len(table.phase), table.ramp
    places = [table.count, table.points, table.weights]
    given = [*places, table.directions, nailed, ramp.paper, ramp.speed, mass, params, now.x]
    moved = [ahead.x, ahead.v, ahead.memory, table.force, closing]
    program.launch(land_slides, n, [*given, table.phase, ramp.step, *moved])
    program.barrier()
    program.launch(refresh_directions, n, moved_domain(table, surfaces, ahead.x))
    program.barrier()
    for velocity in (ahead.v, ahead.memory) if memory else (ahead.v,):
        given = [table.phase, *places, table.directions, table.normal, nailed, mass, closing]
        program.launch(guide_slides, n, [*given, velocity])
        program.barrier()
    program.launch(remember_normals, n, [table.phase, table.directions, table.normal])
    program.launch(pass_to_nails, 1, [n, table.phase, *places, nailed, table.force, nail_force])


def project(
    program: Program, table: Slides, nailed: wp.array, mass: wp.array, y: wp.array, force_out: wp.array
) -> None:
    """Record the projection of a rate ``y``."""
    given = [table.count, table.points, table.weights, table.directions, nailed, table.phase, mass, y]
    program.launch(project_slides, len(table.phase), [*given, force_out])
