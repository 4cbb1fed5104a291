"""Tetrahedral solids with the energies of Teschner, Heidelberger, Mueller, Gross 2004.

Each energy is ``E = k C^2 / 2`` of a dimensionless C, and the force on point i is
``-(k C + k_d sum_j dC/dx_j . v_j) dC/dx_i``:

* distance, one per edge:         ``C = (|d| - D0) / D0``,         ``dC/dx_b = d / (|d| D0)``
* area, one per triangle:         ``C = (A - A0) / A0``,           ``dC/dx_1 = e2 x n / (2 A0 |n|)``, ``n = e1 x e2``
* volume, one per tetrahedron:    ``C = (V - V0) / V0`` (signed),  ``dC/dx_1 = b x c / (6 V0)``

An edge or triangle shared by several tetrahedra is computed by the first of them, so the four corners are loaded once
for all that hangs on them. Tetrahedra are taken in blocks of several lanes; a block's ``mask`` has a bit for each of its
6 edges and 4 triangles that at least one lane computes (tetrahedra with like masks are put together by ``build``), and a
lane that does not compute it has an inverse rest measure of 0 there.
"""

from functools import cache

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.lanes import algebra
from turnbuckle.math.types import real, vec3

EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
TRIANGLES = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
OPTIONS = {"enable_backward": False, "cpu_compiler_flags": "-march=native -mllvm=-inline-threshold=9000"}
RESTS = 11  # per block and lane: 1 / (6 V0), six 1 / D0, four 1 / A0


@cache
def tetrahedra_forces(width: int) -> wp.Kernel:
    """The force kernel for blocks of ``width`` lanes."""
    lanes = algebra(width)
    scalars, Vectors = lanes.scalars, lanes.Vectors
    add, sub, scale, dot, cross = lanes.add, lanes.sub, lanes.scale, lanes.dot, lanes.cross
    length, total, used, load, store = lanes.length, lanes.total, lanes.used, lanes.load, lanes.store

    @wp.struct
    class Element:
        """What one energy gives: the force factor's vector, its energy and the power lost, a number for each lane."""

        vector: Vectors
        energy: scalars
        power: scalars

    @wp.func
    def edge(d: Vectors, w: Vectors, inverse_rest: scalars, k: real, k_d: real):
        """Distance energy of an edge vector ``d`` with velocity ``w``; ``vector`` is the force on its end."""
        size = length(d)
        g = wp.cw_div(inverse_rest, size)
        c = wp.cw_mul(size, inverse_rest) - used(inverse_rest)
        rate = wp.cw_mul(g, dot(d, w))
        r = Element()
        r.vector = scale(d, -wp.cw_mul(g, c * k + rate * k_d))
        r.energy = wp.cw_mul(c, c) * k
        r.power = wp.cw_mul(rate, rate) * k_d
        return r

    @wp.func
    def area(e1: Vectors, e2: Vectors, w1: Vectors, w2: Vectors, inverse_rest: scalars, k: real, k_d: real):
        """Area energy of a triangle; the force on its second point is ``e2 x vector``, on its third ``vector x e1``."""
        n = cross(e1, e2)
        size = length(n)
        s = wp.cw_div(inverse_rest, size) * real(0.5)
        c = wp.cw_mul(size, inverse_rest) * real(0.5) - used(inverse_rest)
        rate = wp.cw_mul(s, dot(n, sub(cross(w1, e2), cross(w2, e1))))
        r = Element()
        r.vector = scale(n, -wp.cw_mul(s, c * k + rate * k_d))
        r.energy = wp.cw_mul(c, c) * k
        r.power = wp.cw_mul(rate, rate) * k_d
        return r

    @wp.kernel(module="unique", module_options=OPTIONS)
    def forces(
        begin: int,
        corners: wp.array2d(dtype=wp.int32),
        mask: wp.array(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        materials: wp.array2d(dtype=real),
        rest: wp.array2d(dtype=scalars),
        first: int,
        x: wp.array(dtype=vec3),
        v: wp.array(dtype=vec3),
        force_out: wp.array(dtype=vec3),
        energy_out: wp.array(dtype=real),
        power_out: wp.array(dtype=real),
    ):
        """Forces on the four corners of each tetrahedron [N], energy [J] and damping power [W] of each block.

        ``corners[4 b + k, lane]``; ``materials[m] = k_distance, k_area, k_volume, and their k_d``; corner k of block b
        goes to ``force_out[first + (4 b + k) width + lane]``.
        """
        e = known(begin + wp.tid())
        m = material[e]
        k_distance = materials[m, 0]
        k_area = materials[m, 1]
        k_volume = materials[m, 2]
        d_distance = materials[m, 3]
        d_area = materials[m, 4]
        d_volume = materials[m, 5]
        x0 = load(x, corners, 4 * e)
        v0 = load(v, corners, 4 * e)
        a = sub(load(x, corners, 4 * e + 1), x0)
        b = sub(load(x, corners, 4 * e + 2), x0)
        c = sub(load(x, corners, 4 * e + 3), x0)
        va = sub(load(v, corners, 4 * e + 1), v0)
        vb = sub(load(v, corners, 4 * e + 2), v0)
        vc = sub(load(v, corners, 4 * e + 3), v0)
        ab = sub(b, a)
        ac = sub(c, a)
        bc = sub(c, b)
        vab = sub(vb, va)
        vac = sub(vc, va)
        vbc = sub(vc, vb)
        # volume
        g1 = cross(b, c)
        g2 = cross(c, a)
        g3 = cross(a, b)
        s = rest[e, 0]
        strain = wp.cw_mul(dot(a, g1), s) - used(s)
        rate = wp.cw_mul(dot(g1, va) + dot(g2, vb) + dot(g3, vc), s)
        factor = -wp.cw_mul(s, strain * k_volume + rate * d_volume)
        energy = wp.cw_mul(strain, strain) * k_volume
        power = wp.cw_mul(rate, rate) * d_volume
        f1 = scale(g1, factor)
        f2 = scale(g2, factor)
        f3 = scale(g3, factor)
        # edges
        bits = mask[e]
        if bits & 1:
            q = edge(a, va, rest[e, 1], k_distance, d_distance)
            f1 = add(f1, q.vector)
            energy += q.energy
            power += q.power
        if bits & 2:
            q = edge(b, vb, rest[e, 2], k_distance, d_distance)
            f2 = add(f2, q.vector)
            energy += q.energy
            power += q.power
        if bits & 4:
            q = edge(c, vc, rest[e, 3], k_distance, d_distance)
            f3 = add(f3, q.vector)
            energy += q.energy
            power += q.power
        if bits & 8:
            q = edge(ab, vab, rest[e, 4], k_distance, d_distance)
            f1 = sub(f1, q.vector)
            f2 = add(f2, q.vector)
            energy += q.energy
            power += q.power
        if bits & 16:
            q = edge(ac, vac, rest[e, 5], k_distance, d_distance)
            f1 = sub(f1, q.vector)
            f3 = add(f3, q.vector)
            energy += q.energy
            power += q.power
        if bits & 32:
            q = edge(bc, vbc, rest[e, 6], k_distance, d_distance)
            f2 = sub(f2, q.vector)
            f3 = add(f3, q.vector)
            energy += q.energy
            power += q.power
        # triangles
        if bits & 64:
            q = area(a, b, va, vb, rest[e, 7], k_area, d_area)
            f1 = add(f1, cross(b, q.vector))
            f2 = add(f2, cross(q.vector, a))
            energy += q.energy
            power += q.power
        if bits & 128:
            q = area(a, c, va, vc, rest[e, 8], k_area, d_area)
            f1 = add(f1, cross(c, q.vector))
            f3 = add(f3, cross(q.vector, a))
            energy += q.energy
            power += q.power
        if bits & 256:
            q = area(b, c, vb, vc, rest[e, 9], k_area, d_area)
            f2 = add(f2, cross(c, q.vector))
            f3 = add(f3, cross(q.vector, b))
            energy += q.energy
            power += q.power
        if bits & 512:
            q = area(ab, ac, vab, vac, rest[e, 10], k_area, d_area)
            h2 = cross(ac, q.vector)
            h3 = cross(q.vector, ab)
            f2 = add(f2, h2)
            f3 = add(f3, h3)
            f1 = sub(f1, add(h2, h3))
            energy += q.energy
            power += q.power
        slot = first + 4 * e * width
        store(force_out, slot + width, f1)
        store(force_out, slot + 2 * width, f2)
        store(force_out, slot + 3 * width, f3)
        store(force_out, slot, scale(add(f1, add(f2, f3)), scalars(real(-1.0))))
        energy_out[e] = real(0.5) * total(energy)
        power_out[e] = total(power)

    return forces
