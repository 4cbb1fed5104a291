"""Conjugate gradients for ``(A + J^T D J) dv = -g``, as kernels over tiles (see `newton_kernels` for tiles and letters).

Each iteration is a handful of launches without a look from the host: step lengths and the test of convergence are on the
device, and once it is met the rest do nothing.
"""

import warp as wp

from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import (
    BETA,
    DONE,
    GOAL,
    RZ,
    TRIES,
    place,
)

wp.set_module_options({"enable_backward": False})


@wp.kernel
def begin_gradients(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int),
                    g: wp.array(dtype=wp.vec3d), residual_out: wp.array(dtype=wp.vec3d), dv_out: wp.array(dtype=wp.vec3d),
                    p_out: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d), pq_out: wp.array(dtype=real),
                    scalars: wp.array(dtype=real)):  # fmt: skip
    """residual = -g; dv, p and q = 0, so that `advance` makes the first z."""
    tile = begin + wp.tid()
    if tile == 0:
        scalars[DONE] = real(0.0)
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        i = which[t]
        residual_out[i] = -g[i]
        dv_out[i] = wp.vec3d()
        p_out[i] = wp.vec3d()
        q_out[i] = wp.vec3d()
    pq_out[tile] = real(0.0)


@wp.kernel
def first_direction(
    begin: int, tiles: int, sums: wp.array(dtype=real), forcing: wp.array(dtype=real), scalars: wp.array(dtype=real)
):
    """beta = 0, and the goal: ``forcing`` of the first residual."""
    total = real(0.0)
    for tile in range(tiles):
        total += sums[tile]
    scalars[RZ] = total
    scalars[BETA] = real(0.0)
    scalars[GOAL] = forcing[0] * forcing[0] * total
    scalars[TRIES] = real(0.0)
    if total <= real(0.0):
        scalars[DONE] = real(1.0)


@wp.func_native(
    """
    const double* jj = (const double*)j.data;
    const double* dd = (const double*)d.data;
    const double* pp = (const double*)p.data;
    double* yy = (double*)y_out.data;
    for (int t = first; t < last; ++t) {
        const int c = which.data[t];
        const double* m = dd + 9 * (size_t)c;
        double* y = yy + 3 * (size_t)c;
        y[0] = y[1] = y[2] = 0.0;
        if (m[0] == 0.0) continue;  // does not touch
        double s0[4] = {}, s1[4] = {}, s2[4] = {};
        for (int e = offsets.data[c]; e < offsets.data[c + 1]; ++e) {
            const double* b = jj + 9 * (size_t)e;
            const double* x = pp + 3 * (size_t)columns.data[e];
            for (int k = 0; k < 4; ++k) { s0[k] += b[k] * x[k]; s1[k] += b[3 + k] * x[k]; s2[k] += b[6 + k] * x[k]; }
        }
        const double u0 = s0[0] + s0[1] + s0[2], u1 = s1[0] + s1[1] + s1[2], u2 = s2[0] + s2[1] + s2[2];
        for (int k = 0; k < 3; ++k) y[k] = m[3 * k] * u0 + m[3 * k + 1] * u1 + m[3 * k + 2] * u2;
    }
"""
)
def contact_product_of(first: int, last: int, which: wp.array(dtype=int), offsets: wp.array(dtype=int), columns: wp.array(dtype=int),
                       j: wp.array(dtype=wp.mat33d), d: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
                       y_out: wp.array(dtype=wp.vec3d)): ...  # fmt: skip


@wp.func_native(
    """
    const double* aa = (const double*)a.data;
    const double* jj = (const double*)jt.data;
    const double* pp = (const double*)p.data;
    const double* yy = (const double*)y.data;
    double* qq = (double*)q_out.data;
    double total = 0.0;
    for (int t_ = first; t_ < last; ++t_) {
        const int i = which.data[t_];
        double* q = qq + 3 * (size_t)i;
        q[0] = q[1] = q[2] = 0.0;
        if (fixed.data[i]) continue;
        double s0[4] = {}, s1[4] = {}, s2[4] = {}, t[4] = {};
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) {
            const double* b = aa + 9 * (size_t)e;
            const double* x = pp + 3 * (size_t)others.data[e];
            for (int k = 0; k < 4; ++k) { s0[k] += b[k] * x[k]; s1[k] += b[3 + k] * x[k]; s2[k] += b[6 + k] * x[k]; }
        }
        for (int e = t_offsets.data[i]; e < t_offsets.data[i + 1]; ++e) {
            const double* x = yy + 3 * (size_t)t_contacts.data[e];
            if (x[0] == 0.0 && x[1] == 0.0 && x[2] == 0.0) continue;
            const double* b = jj + 9 * (size_t)e;
            for (int k = 0; k < 4; ++k) t[k] += b[k] * x[0] + b[3 + k] * x[1] + b[6 + k] * x[2];
        }
        q[0] = s0[0] + s0[1] + s0[2] + t[0];
        q[1] = s1[0] + s1[1] + s1[2] + t[1];
        q[2] = s2[0] + s2[1] + s2[2] + t[2];
        const double* x = pp + 3 * (size_t)i;
        total += x[0] * q[0] + x[1] * q[1] + x[2] * q[2];
    }
    return total;
"""
)
def product_of(first: int, last: int, which: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
               a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
               jt: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8), y: wp.array(dtype=wp.vec3d), p: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d)) -> wp.float64: ...  # fmt: skip


@wp.kernel
def contact_product(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), scalars: wp.array(dtype=real),
                    offsets: wp.array(dtype=int), columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d),
                    d: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d), y_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """y = D J p."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[of]
        contact_product_of(
            place(tile, tiles, count), place(tile + 1, tiles, count), which, offsets, columns, j, d, p, y_out
        )


@wp.kernel
def product(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), scalars: wp.array(dtype=real),
            starts: wp.array(dtype=int), others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d),
            t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int), jt: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8), y: wp.array(dtype=wp.vec3d),
            p: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d), sums_out: wp.array(dtype=real)):  # fmt: skip
    """q = A p + J^T y, and p . q by tiles."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[of]
        sums_out[tile] = product_of(
            place(tile, tiles, count), place(tile + 1, tiles, count), which, starts, others, a, t_offsets, t_contacts, jt,
            fixed, y, p, q_out,
        )  # fmt: skip


@wp.kernel
def next_direction(begin: int, tiles: int, sums: wp.array(dtype=real), limit: real, scalars: wp.array(dtype=real)):
    """beta, and whether the goal is reached."""
    if scalars[DONE] == real(0.0):
        total = real(0.0)
        for tile in range(tiles):
            total += sums[tile]
        scalars[BETA] = total / scalars[RZ]
        scalars[RZ] = total
        scalars[TRIES] = scalars[TRIES] + real(1.0)
        if total <= scalars[GOAL] or scalars[TRIES] >= limit:
            scalars[DONE] = real(1.0)


@wp.func_native(
    """
    double* rr = (double*)residual.data;
    double* vv = (double*)dv.data;
    const double* pp = (const double*)p.data;
    const double* qq = (const double*)q.data;
    double* zz = (double*)z_out.data;
    const double* mm = (const double*)m.data;
    const double* nn = (const double*)n.data;
    double total = 0.0;
    for (int t = first; t < last; ++t) {
        const int i = which.data[t];
        const int other = partner.data[i];
        if (other >= 0 && other < i) continue;  // done with the first half of its body
        for (int b = i; b <= (other > i ? other : i); ++b) {
            for (int k = 0; k < 3; ++k) {
                const size_t at = 3 * (size_t)b + k;
                vv[at] += alpha * pp[at];
                rr[at] -= alpha * qq[at];
            }
        }
        for (int b = i; b <= (other > i ? other : i); ++b) {
            if (apart.data[b]) continue;  // z is made by the factor of its body
            double* z = zz + 3 * (size_t)b;
            const double* r = rr + 3 * (size_t)b;
            if (fixed.data[b]) { z[0] = z[1] = z[2] = 0.0; continue; }
            const double* w = mm + 9 * (size_t)b;
            double z0 = w[0] * r[0] + w[1] * r[1] + w[2] * r[2];
            double z1 = w[3] * r[0] + w[4] * r[1] + w[5] * r[2];
            double z2 = w[6] * r[0] + w[7] * r[1] + w[8] * r[2];
            if (other >= 0) {
                const double* o = rr + 3 * (size_t)(b == i ? other : i);
                const double* u = nn + 9 * (size_t)b;
                z0 += u[0] * o[0] + u[1] * o[1] + u[2] * o[2];
                z1 += u[3] * o[0] + u[4] * o[1] + u[5] * o[2];
                z2 += u[6] * o[0] + u[7] * o[1] + u[8] * o[2];
            }
            z[0] = z0; z[1] = z1; z[2] = z2;
            total += r[0] * z0 + r[1] * z1 + r[2] * z2;
        }
    }
    return total;
"""
)
def advance_of(first: int, last: int, which: wp.array(dtype=int), alpha: wp.float64, partner: wp.array(dtype=int), fixed: wp.array(dtype=wp.uint8),
               apart: wp.array(dtype=wp.uint8), m: wp.array(dtype=wp.mat33d), n: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
               q: wp.array(dtype=wp.vec3d), dv: wp.array(dtype=wp.vec3d), residual: wp.array(dtype=wp.vec3d),
               z_out: wp.array(dtype=wp.vec3d)) -> wp.float64: ...  # fmt: skip


@wp.kernel
def advance(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), scalars: wp.array(dtype=real),
            pq: wp.array(dtype=real), partner: wp.array(dtype=int), fixed: wp.array(dtype=wp.uint8),
            apart: wp.array(dtype=wp.uint8), m: wp.array(dtype=wp.mat33d), n: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
            q: wp.array(dtype=wp.vec3d), dv: wp.array(dtype=wp.vec3d), residual: wp.array(dtype=wp.vec3d),
            z_out: wp.array(dtype=wp.vec3d), sums_out: wp.array(dtype=real)):  # fmt: skip
    """alpha = r . z / p . q, dv += alpha p, residual -= alpha q, z = M residual, and residual . z by tiles.

    Both halves of a rigid body belong to the tile of the first.
    """
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        total = real(0.0)
        for k in range(tiles):
            total += pq[k]
        alpha = real(0.0)
        if total > real(0.0):
            alpha = scalars[RZ] / total
        count = sizes[of]
        sums_out[tile] = advance_of(place(tile, tiles, count), place(tile + 1, tiles, count), which, alpha, partner, fixed, apart,
                                    m, n, p, q, dv, residual, z_out)  # fmt: skip


@wp.func_native(
    """
    const double* zz = (const double*)z.data;
    double* pp = (double*)p.data;
    for (int t = first; t < last; ++t) {
        const size_t i = 3 * (size_t)which.data[t];
        for (size_t k = i; k < i + 3; ++k) pp[k] = zz[k] + beta * pp[k];
    }
"""
)
def direct_of(
    first: int,
    last: int,
    which: wp.array(dtype=int),
    beta: wp.float64,
    z: wp.array(dtype=wp.vec3d),
    p: wp.array(dtype=wp.vec3d),
): ...


@wp.kernel
def direct(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), scalars: wp.array(dtype=real), z: wp.array(dtype=wp.vec3d),
           p: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """p = z + beta p."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[of]
        direct_of(place(tile, tiles, count), place(tile + 1, tiles, count), which, scalars[BETA], z, p)


@wp.func_native(
    """
    const double* xx = (const double*)x.data;
    const double* yy = (const double*)y.data;
    double total = 0.0;
    for (int t = first; t < last; ++t) {
        const size_t i = 3 * (size_t)which.data[t];
        for (size_t k = i; k < i + 3; ++k) total += xx[k] * yy[k];
    }
    return total;
"""
)
def dot_of(
    first: int, last: int, which: wp.array(dtype=int), x: wp.array(dtype=wp.vec3d), y: wp.array(dtype=wp.vec3d)
) -> wp.float64: ...


@wp.kernel
def dot(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int),
        x: wp.array(dtype=wp.vec3d), y: wp.array(dtype=wp.vec3d), sums_out: wp.array(dtype=real)):  # fmt: skip
    """x . y by tiles."""
    tile = begin + wp.tid()
    count = sizes[of]
    sums_out[tile] = dot_of(place(tile, tiles, count), place(tile + 1, tiles, count), which, x, y)
