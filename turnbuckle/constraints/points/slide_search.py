"""Where a sliding point is on its domain: the closest element, its weights, and the directions that are held there.

The closest element is found with a bounding-volume hierarchy over boxes rounded outwards to float32; distances are
float64, and of equal ones the first element is taken.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.compute import Program
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
        wp.array(
            np.concatenate([*(d.rim for d in domains), np.zeros(0)]).astype(np.int32), dtype=wp.int32, device=device
        ),
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
    p: vec3,
    e: int,
    weights: vec3,
    elements: wp.array2d(dtype=wp.int32),
    rim: wp.array(dtype=wp.int32),
    x: wp.array(dtype=vec3),
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
