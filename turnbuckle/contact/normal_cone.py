"""Which near places are contacts: those where the distance is at a minimum over the surfaces around them.

A vertex that slides over a flat floor is near many triangles, but only the one below it says where the floor is: the
closest places on the others lie on their borders, their normals point sideways and would stop the vertex (*ghost
collisions* at internal edges). With u the unit vector from a place to the other side, and d a direction in which the
surface goes on from the place, moving there brings the sides nearer if ``u . d > 0``. So at a place on

* an edge: ``u . d <= noise`` for the direction d into each of its faces, at right angles to the edge;
* a vertex: ``u . d <= noise`` for every edge at it (directions into faces are sums of two of these);
* the inside of a face: nothing.

The pair that is nearest of all fulfils every condition, so what is near always keeps a contact. Three additions:

* A vertex over the inside of a face may be anywhere on it, since a body that rests on its face needs more than its
  lowest corner: of the vertex only ``u . d <= 0.25`` is asked, which leaves out the vertices of a floor beside the steep
  flank of a body. The same at a place that is as good as inside: on an edge or vertex that is *blunt* (the surface turns
  away from the plane square to u by less than 0.25 rad), and where one side is a rope, which has no inside.
* Two edges: where the faces of one are flat and square to u, the place is in truth inside a face, and the contact says
  nothing that vertices and outlines do not: it is left out. An outline has a face on one side only and stays.
* Directions into faces without area are not asked.
"""

import warp as wp

from turnbuckle.contact.neighbourhood import Neighbourhood
from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})

F64 = wp.array(dtype=wp.float64)
I32 = wp.array(dtype=wp.int32)


@wp.func_native(
    """
    const double *base = (const double *)x.data;
    const double *n = scratch.data + 16 * slot + 4;
    const double noise = scratch.data[16 * slot + 9];
    const double *a = base + 3 * edges.data[2 * edge], *b = base + 3 * edges.data[2 * edge + 1];
    const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const double l = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    double most = -2.0, least = 2.0;
    int faces = 0;
    for (int k = 0; k < 2; ++k) {
        const int o = opposite.data[2 * edge + k];
        if (o < 0) continue;
        const double *c = base + 3 * o;
        double d[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
        const double r = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        const double t = l > 0.0 ? (d[0] * u[0] + d[1] * u[1] + d[2] * u[2]) / l : 0.0;
        for (int i = 0; i < 3; ++i) d[i] -= t * u[i];
        const double h = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if (!(h > 1e-20 * (r > l ? r : l))) continue;  // a face without area goes nowhere
        const double c_k = sign * (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / sqrt(h);
        most = c_k > most ? c_k : most;
        least = c_k < least ? c_k : least;
        ++faces;
    }
    const int pass = most <= noise;
    // 1: the distance is at a minimum here; 2: flat, faces on both sides; 4: blunt; 8: there are faces
    return pass | (faces == 2 && pass && least >= -noise) << 1 | (faces > 0 && pass && least >= -blunt) << 2
         | (faces > 0) << 3;
"""
)
def _edge_around(
    x: wp.array(dtype=vec3), edges: I32, opposite: I32, scratch: F64, slot: int, edge: int, sign: wp.float64,
    blunt: wp.float64,
) -> int: ...  # fmt: skip


@wp.func_native(
    """
    const double *base = (const double *)x.data;
    const double *n = scratch.data + 16 * slot + 4;
    const double noise = scratch.data[16 * slot + 9];
    const double *a = base + 3 * v;
    double most = -2.0, least = 2.0;
    for (int k = start.data[v]; k < start.data[v + 1]; ++k) {
        const double *c = base + 3 * other.data[k];
        const double d[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
        const double l = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if (!(l > 0.0)) continue;
        const double c_k = sign * (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / sqrt(l);
        most = c_k > most ? c_k : most;
        least = c_k < least ? c_k : least;
    }
    const int pass = most <= noise;
    // 1: the distance is at a minimum here; 4: blunt; 8: there are faces; 16: nearly at a minimum
    return pass | (most <= noise + blunt) << 4 | (pass && sheet.data[v] && least >= -blunt) << 2 | (sheet.data[v] != 0) << 3;
"""
)
def _vertex_around(
    x: wp.array(dtype=vec3), start: I32, other: I32, sheet: wp.array(dtype=wp.uint8), scratch: F64, slot: int, v: int,
    sign: wp.float64, blunt: wp.float64,
) -> int: ...  # fmt: skip


ANGLE = wp.constant(wp.float64(0.25))  # [rad] what counts as nearly


@wp.func
def vertex_meets_face(x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, v: int):
    """Whether a vertex and a place inside of a face are a contact. The normal points to the vertex."""
    vertex = _vertex_around(x, near.start, near.other, near.sheet, scratch, slot, v, wp.float64(-1.0), ANGLE)
    return (vertex & 16) != 0


@wp.func
def edges_meet(x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, a: int, b: int):
    """Whether places inside of two edges are a contact. The normal points from b to a."""
    one = _edge_around(x, near.edges, near.opposite, scratch, slot, a, wp.float64(-1.0), ANGLE)
    two = _edge_around(x, near.edges, near.opposite, scratch, slot, b, wp.float64(1.0), ANGLE)
    return (one & two & 1) != 0 and ((one | two) & 2) == 0


@wp.func
def vertex_meets_edge(
    x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, v: int, e: int, sign: wp.float64
):
    """Whether a vertex and a place inside of an edge are a contact; ``sign`` 1 where the normal points to the vertex."""
    edge = _edge_around(x, near.edges, near.opposite, scratch, slot, e, sign, ANGLE)
    if (edge & 1) == 0:
        return False
    vertex = _vertex_around(x, near.start, near.other, near.sheet, scratch, slot, v, -sign, ANGLE)
    if (edge & 4) != 0 or (edge & vertex & 8) == 0:
        return (vertex & 16) != 0
    return (vertex & 1) != 0


@wp.func
def vertices_meet(
    x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, v: int, w: int, sign: wp.float64
):
    """Whether two vertices are a contact; ``sign`` 1 where the normal points from w to v."""
    one = _vertex_around(x, near.start, near.other, near.sheet, scratch, slot, v, -sign, ANGLE)
    two = _vertex_around(x, near.start, near.other, near.sheet, scratch, slot, w, sign, ANGLE)
    if ((one | two) & 4) != 0 or (one & two & 8) == 0:
        return (one & two & 16) != 0
    return (one & two & 1) != 0
