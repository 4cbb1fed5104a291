"""Sliding (Local, 4.4): a mass point held on a line, a triangle or a triangulated surface, without friction, two-way.

The *predicted* point is projected onto the *predicted* domain. The gap to its closest point is then normal to the domain,
so the force of (28) with the weights of that closest point is normal too, and where the closest point lies on an edge or
corner the force lies between the normals that meet there: the point crosses edges and corners smoothly. At the rim of a
surface or the end of a line the closest point stays on the rim: the point is stopped there and leaves only inwards.

The velocity is put on the domain along the held directions alone: the normal of a face, all but the tangent on a line or
a rim, all three at an end or a rim corner. A point of the domain that is nailed does not give way; its nail takes the
force (see `land`). The closest element is found with a bounding-volume hierarchy over boxes rounded outwards to float32;
distances are float64, and of equal ones the first element is taken.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.compute import Program
from turnbuckle.constraints.points.ramp import advance, kept_fraction
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, MEMORY, PROJECT, H, Kinematics
from turnbuckle.data.tables import Domain, Slides
from turnbuckle.math.closest import closest_on_segment, closest_on_triangle
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

HIERARCHY_FROM = 64  # elements; fewer are searched one by one


@dataclass
class Surfaces:
    """All domains of a scene on the device, and the hierarchy over their elements."""

    domains: int  # how many
    elements: wp.array  # (n, 3) int32, third corner -1 for segments
    rim: wp.array  # (n,) int32
    first: wp.array  # (domains + 1,) int32, the elements of each domain
    lower: wp.array  # (n,) vec3 float32
    upper: wp.array
    tree: wp.Bvh | None


def upload(domains: list[Domain], x: wp.array, device: str) -> Surfaces:
    """Put the domains onto the device; ``x`` are positions to build the hierarchy with."""
    elements = [np.c_[d.elements, np.full((len(d.elements), 3 - d.elements.shape[1]), -1)] for d in domains]
    stacked = np.concatenate([*elements, np.zeros((0, 3))]).astype(np.int32)
    first = np.cumsum([0] + [len(d.elements) for d in domains]).astype(np.int32)
    n = len(stacked)
    boxes = [wp.zeros(n, dtype=wp.vec3f, device=device) for _ in range(2)]
    surfaces = Surfaces(
        len(domains),
        wp.array(stacked, dtype=wp.int32, device=device),
        wp.array(np.concatenate([*(d.rim for d in domains), np.zeros(0)]).astype(np.int32), dtype=wp.int32, device=device),
        wp.array(first, dtype=wp.int32, device=device),
        *boxes,
        None,
    )
    if n > HIERARCHY_FROM:
        wp.launch(bound_elements, n, inputs=[0, surfaces.elements, x, *boxes], device=device)
        surfaces.tree = wp.Bvh(surfaces.lower, surfaces.upper)
    return surfaces


@wp.func
def outwards(value: real, sign: float):
    """float32 not less (sign 1) or not more (sign -1) than ``value``."""
    f = wp.float32(value)
    return f + sign * (wp.abs(f) * 2.4e-7 + 1.0e-37)


@wp.kernel
def bound_elements(
    begin: int,
    elements: wp.array2d(dtype=wp.int32),
    x: wp.array(dtype=vec3),
    lower_out: wp.array(dtype=wp.vec3f),
    upper_out: wp.array(dtype=wp.vec3f),
):
    """Boxes around all elements, rounded outwards."""
    e = begin + wp.tid()
    a = x[elements[e, 0]]
    b = x[elements[e, 1]]
    lo = wp.min(a, b)
    hi = wp.max(a, b)
    if elements[e, 2] >= 0:
        c = x[elements[e, 2]]
        lo = wp.min(lo, c)
        hi = wp.max(hi, c)
    lower_out[e] = wp.vec3f(outwards(lo[0], -1.0), outwards(lo[1], -1.0), outwards(lo[2], -1.0))
    upper_out[e] = wp.vec3f(outwards(hi[0], 1.0), outwards(hi[1], 1.0), outwards(hi[2], 1.0))


@wp.func
def element_weights(p: vec3, e: int, elements: wp.array2d(dtype=wp.int32), x: wp.array(dtype=vec3)):
    """Weights of the corners of element ``e`` at its point closest to ``p``."""
    a = x[elements[e, 0]]
    b = x[elements[e, 1]]
    if elements[e, 2] < 0:
        return closest_on_segment(p, a, b)
    return closest_on_triangle(p, a, b, x[elements[e, 2]])


@wp.func
def element_place(e: int, weights: vec3, elements: wp.array2d(dtype=wp.int32), x: wp.array(dtype=vec3)):
    """The place with ``weights`` on element ``e``."""
    place = x[elements[e, 0]] * weights[0] + x[elements[e, 1]] * weights[1]
    if elements[e, 2] >= 0:
        place += x[elements[e, 2]] * weights[2]
    return place


@wp.func
def held_directions(
    p: vec3, e: int, weights: vec3, elements: wp.array2d(dtype=wp.int32), rim: wp.array(dtype=wp.int32), x: wp.array(dtype=vec3)
):
    """Projector on the directions that are held at the closest point (see the head of this file)."""
    every = wp.identity(n=3, dtype=real)
    a = x[elements[e, 0]]
    b = x[elements[e, 1]]
    bits = rim[e]
    if elements[e, 2] < 0:  # a segment: end k is left when weight k is 1 and it bounds the line
        if (weights[1] == real(0.0) and (bits & 1) != 0) or (weights[0] == real(0.0) and (bits & 2) != 0):
            return every
        t = wp.normalize(b - a)
        return every - wp.outer(t, t)
    c = x[elements[e, 2]]
    edges = int(0)  # how many rim edges the closest point lies on
    tangent = vec3()
    if weights[0] == real(0.0) and (bits & 1) != 0:
        edges += 1
        tangent = c - b
    if weights[1] == real(0.0) and (bits & 2) != 0:
        edges += 1
        tangent = a - c
    if weights[2] == real(0.0) and (bits & 4) != 0:
        edges += 1
        tangent = b - a
    if edges > 1:
        return every
    if edges == 1:
        t = wp.normalize(tangent)
        return every - wp.outer(t, t)
    n = wp.normalize(wp.cross(b - a, c - a))
    gap = p - element_place(e, weights, elements, x)
    inside = weights[0] > real(0.0) and weights[1] > real(0.0) and weights[2] > real(0.0)
    if not inside and wp.length(gap) > real(1e-9) * wp.length(b - a):
        n = wp.normalize(gap)  # on an edge or corner: between the normals that meet there
    return wp.outer(n, n)


@wp.kernel
def find_places(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    domain: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    elements: wp.array2d(dtype=wp.int32),
    rim: wp.array(dtype=wp.int32),
    tree: wp.uint64,
    x: wp.array(dtype=vec3),
    element: wp.array(dtype=wp.int32),
    count_out: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights_out: wp.array2d(dtype=real),
    directions_out: wp.array(dtype=wp.mat33d),
):
    """The closest place of each row's domain: its element, points, weights and held directions."""
    c = begin + wp.tid()
    if phase[c] == -1:
        return
    p = x[points[c, 0]]
    lo = first[domain[c]]
    hi = first[domain[c] + 1]
    best = element[c]
    distance = real(1e300)
    best_weights = vec3()
    if best >= lo and best < hi:
        best_weights = element_weights(p, best, elements, x)
        distance = wp.length(p - element_place(best, best_weights, elements, x))
    if tree != wp.uint64(0) and distance < real(1e30):
        r = distance * real(1.000001) + real(1e-30)
        query_lower = wp.vec3f(outwards(p[0] - r, -1.0), outwards(p[1] - r, -1.0), outwards(p[2] - r, -1.0))
        query_upper = wp.vec3f(outwards(p[0] + r, 1.0), outwards(p[1] + r, 1.0), outwards(p[2] + r, 1.0))
        query = wp.bvh_query_aabb(tree, query_lower, query_upper)
        e = int(0)  # a variable that the query writes to; a literal would be a constant
        while wp.bvh_query_next(query, e):
            if e >= lo and e < hi:
                candidate = element_weights(p, e, elements, x)
                d = wp.length(p - element_place(e, candidate, elements, x))
                if d < distance or (d == distance and e < best):
                    distance = d
                    best = e
                    best_weights = candidate
    else:
        for e in range(lo, hi):
            candidate = element_weights(p, e, elements, x)
            d = wp.length(p - element_place(e, candidate, elements, x))
            if d < distance or (d == distance and e < best):
                distance = d
                best = e
                best_weights = candidate
    element[c] = best
    corners = int(3)
    if elements[best, 2] < 0:
        corners = 2
    count_out[c] = corners + 1
    weights_out[c, 0] = real(1.0)
    for k in range(3):
        if k < corners:
            points[c, 1 + k] = elements[best, k]
            weights_out[c, 1 + k] = -best_weights[k]
    directions_out[c] = held_directions(p, best, best_weights, elements, rim, x)


@wp.func
def slide_sum(
    c: int, count: int, points: wp.array2d(dtype=wp.int32), weights: wp.array2d(dtype=real), y: wp.array(dtype=vec3)
):
    """``sum_k w_k y_k`` by differences from the point itself."""
    first = y[points[c, 0]]
    total = vec3()
    for k in range(1, count):
        total += weights[c, k] * (y[points[c, k]] - first)
    return total


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
    gap = slide_sum(c, k_end, points, weights, x)
    wanted = vec3()
    closing = vec3()
    if n > 0:
        paper = ramp_paper[c]
        gap_now = slide_sum(c, k_end, points, weights, x_now)
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


@wp.kernel
def guide_slides(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    directions: wp.array(dtype=wp.mat33d),
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
    push = directions[c] * ((closing[c] - slide_sum(c, k_end, points, weights, y)) / flexibility)
    for k in range(k_end):
        i = points[c, k]
        if nailed[i] < 0:
            y[i] = y[i] + push * (weights[c, k] / mass[i])


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
        push = directions[c] * (-slide_sum(c, k_end, points, weights, y) / flexibility)
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


def find(program: Program, table: Slides, surfaces: Surfaces, x: wp.array) -> None:
    """Record the search for the closest places of all rows, for positions ``x``."""
    tree = wp.uint64(0)
    if surfaces.tree is not None:
        program.launch(
            bound_elements, surfaces.elements.shape[0], [surfaces.elements, x, surfaces.lower, surfaces.upper]
        )
        program.host(surfaces.tree.refit)
        tree = wp.uint64(surfaces.tree.id)
    given = [table.phase, table.domain, surfaces.first, surfaces.elements, surfaces.rim, tree, x]
    out = [table.element, table.count, table.points, table.weights, table.directions]
    program.launch(find_places, len(table.phase), [*given, *out])
    program.barrier()


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
        given = [table.phase, *places, table.directions, nailed, mass, closing]
        program.launch(guide_slides, n, [*given, velocity])
        program.barrier()
    program.launch(pass_to_nails, 1, [n, table.phase, *places, nailed, table.force, nail_force])


def project(
    program: Program, table: Slides, nailed: wp.array, mass: wp.array, y: wp.array, force_out: wp.array
) -> None:
    """Record the projection of a rate ``y``."""
    given = [table.count, table.points, table.weights, table.directions, nailed, table.phase, mass, y]
    program.launch(project_slides, len(table.phase), [*given, force_out])
