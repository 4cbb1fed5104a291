"""Conjugate gradients for ``(A + J^T D J) dv = -g``, as kernels over tiles (see `newton_kernels` for tiles and letters).

Each iteration is a handful of launches without a look from the host: step lengths and the test of convergence are on the
device, and once it is met the rest do nothing.
"""

import warp as wp

from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import (
    BETA,
    BLOCKS,
    CONTACTS,
    DONE,
    GOAL,
    RZ,
    TRIES,
    place,
)

wp.set_module_options({"enable_backward": False})


@wp.kernel
def begin_gradients(begin: int, tiles: int, sizes: wp.array(dtype=int), g: wp.array(dtype=wp.vec3d),
                    residual_out: wp.array(dtype=wp.vec3d), dv_out: wp.array(dtype=wp.vec3d),
                    p_out: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d), pq_out: wp.array(dtype=real),
                    scalars: wp.array(dtype=real)):  # fmt: skip
    """residual = -g; dv, p and q = 0, so that `advance` makes the first z."""
    tile = begin + wp.tid()
    if tile == 0:
        scalars[DONE] = real(0.0)
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        residual_out[i] = -g[i]
        dv_out[i] = wp.vec3d()
        p_out[i] = wp.vec3d()
        q_out[i] = wp.vec3d()
    pq_out[tile] = real(0.0)


@wp.kernel
def first_direction(begin: int, tiles: int, sums: wp.array(dtype=real), forcing: real, scalars: wp.array(dtype=real)):
    """beta = 0, and the goal: ``forcing`` of the first residual."""
    total = real(0.0)
    for tile in range(tiles):
        total += sums[tile]
    scalars[RZ] = total
    scalars[BETA] = real(0.0)
    scalars[GOAL] = forcing * forcing * total
    scalars[TRIES] = real(0.0)
    if total <= real(0.0):
        scalars[DONE] = real(1.0)


@wp.func_native(
    """
    const double* jj = (const double*)j.data;
    const double* dd = (const double*)d.data;
    const double* pp = (const double*)p.data;
    double* yy = (double*)y_out.data;
    const int* o = offsets.data;
    const int* col = columns.data;
    for (int c = first; c < last; ++c) {
        double u0 = 0.0, u1 = 0.0, u2 = 0.0;
        for (int e = o[c]; e < o[c + 1]; ++e) {
            const double* b = jj + 9 * (size_t)e;
            const double* x = pp + 3 * (size_t)col[e];
            u0 += b[0] * x[0] + b[1] * x[1] + b[2] * x[2];
            u1 += b[3] * x[0] + b[4] * x[1] + b[5] * x[2];
            u2 += b[6] * x[0] + b[7] * x[1] + b[8] * x[2];
        }
        const double* m = dd + 9 * (size_t)c;
        yy[3 * (size_t)c] = m[0] * u0 + m[1] * u1 + m[2] * u2;
        yy[3 * (size_t)c + 1] = m[3] * u0 + m[4] * u1 + m[5] * u2;
        yy[3 * (size_t)c + 2] = m[6] * u0 + m[7] * u1 + m[8] * u2;
    }
"""
)
def contact_product_of(first: int, last: int, offsets: wp.array(dtype=int), columns: wp.array(dtype=int),
                       j: wp.array(dtype=wp.mat33d), d: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
                       y_out: wp.array(dtype=wp.vec3d)): ...  # fmt: skip


@wp.func_native(
    """
    const double* aa = (const double*)a.data;
    const double* jj = (const double*)j.data;
    const double* pp = (const double*)p.data;
    const double* yy = (const double*)y.data;
    double* qq = (double*)q_out.data;
    const int* st = starts.data;
    const int* col = others.data;
    const int* to = t_offsets.data;
    const int* te = t_entries.data;
    const int* tc = t_contacts.data;
    double total = 0.0;
    for (int i = first; i < last; ++i) {
        double q0 = 0.0, q1 = 0.0, q2 = 0.0;
        if (!fixed.data[i]) {
            for (int e = st[i]; e < st[i + 1]; ++e) {
                const double* b = aa + 9 * (size_t)e;
                const double* x = pp + 3 * (size_t)col[e];
                q0 += b[0] * x[0] + b[1] * x[1] + b[2] * x[2];
                q1 += b[3] * x[0] + b[4] * x[1] + b[5] * x[2];
                q2 += b[6] * x[0] + b[7] * x[1] + b[8] * x[2];
            }
            for (int k = to[i]; k < to[i + 1]; ++k) {
                const double* b = jj + 9 * (size_t)te[k];
                const double* x = yy + 3 * (size_t)tc[k];
                q0 += b[0] * x[0] + b[3] * x[1] + b[6] * x[2];
                q1 += b[1] * x[0] + b[4] * x[1] + b[7] * x[2];
                q2 += b[2] * x[0] + b[5] * x[1] + b[8] * x[2];
            }
        }
        double* q = qq + 3 * (size_t)i;
        const double* x = pp + 3 * (size_t)i;
        q[0] = q0; q[1] = q1; q[2] = q2;
        total += x[0] * q0 + x[1] * q1 + x[2] * q2;
    }
    return total;
"""
)
def product_of(first: int, last: int, starts: wp.array(dtype=int), others: wp.array(dtype=int),
               a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_entries: wp.array(dtype=int),
               t_contacts: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
               y: wp.array(dtype=wp.vec3d), p: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d)) -> wp.float64: ...  # fmt: skip


@wp.kernel
def contact_product(begin: int, tiles: int, sizes: wp.array(dtype=int), scalars: wp.array(dtype=real),
                    offsets: wp.array(dtype=int), columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d),
                    d: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d), y_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """y = D J p."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[CONTACTS]
        contact_product_of(place(tile, tiles, count), place(tile + 1, tiles, count), offsets, columns, j, d, p, y_out)


@wp.kernel
def product(begin: int, tiles: int, sizes: wp.array(dtype=int), scalars: wp.array(dtype=real),
            starts: wp.array(dtype=int), others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d),
            t_offsets: wp.array(dtype=int), t_entries: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
            j: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8), y: wp.array(dtype=wp.vec3d),
            p: wp.array(dtype=wp.vec3d), q_out: wp.array(dtype=wp.vec3d), sums_out: wp.array(dtype=real)):  # fmt: skip
    """q = A p + J^T y, and p . q by tiles."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[BLOCKS]
        sums_out[tile] = product_of(
            place(tile, tiles, count), place(tile + 1, tiles, count), starts, others, a, t_offsets, t_entries,
            t_contacts, j, fixed, y, p, q_out,
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
    for (int i = first; i < last; ++i) {
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
def advance_of(first: int, last: int, alpha: wp.float64, partner: wp.array(dtype=int), fixed: wp.array(dtype=wp.uint8),
               m: wp.array(dtype=wp.mat33d), n: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
               q: wp.array(dtype=wp.vec3d), dv: wp.array(dtype=wp.vec3d), residual: wp.array(dtype=wp.vec3d),
               z_out: wp.array(dtype=wp.vec3d)) -> wp.float64: ...  # fmt: skip


@wp.kernel
def advance(begin: int, tiles: int, sizes: wp.array(dtype=int), scalars: wp.array(dtype=real),
            pq: wp.array(dtype=real), partner: wp.array(dtype=int), fixed: wp.array(dtype=wp.uint8),
            m: wp.array(dtype=wp.mat33d), n: wp.array(dtype=wp.mat33d), p: wp.array(dtype=wp.vec3d),
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
        count = sizes[BLOCKS]
        sums_out[tile] = advance_of(place(tile, tiles, count), place(tile + 1, tiles, count), alpha, partner, fixed, m,
                                    n, p, q, dv, residual, z_out)  # fmt: skip


@wp.func_native(
    """
    const double* zz = (const double*)z.data;
    double* pp = (double*)p.data;
    for (int k = 3 * first; k < 3 * last; ++k) pp[k] = zz[k] + beta * pp[k];
"""
)
def direct_of(first: int, last: int, beta: wp.float64, z: wp.array(dtype=wp.vec3d), p: wp.array(dtype=wp.vec3d)): ...


@wp.kernel
def direct(begin: int, tiles: int, sizes: wp.array(dtype=int), scalars: wp.array(dtype=real), z: wp.array(dtype=wp.vec3d),
           p: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """p = z + beta p."""
    tile = begin + wp.tid()
    if scalars[DONE] == real(0.0):
        count = sizes[BLOCKS]
        direct_of(place(tile, tiles, count), place(tile + 1, tiles, count), scalars[BETA], z, p)


@wp.func_native(
    """
    const double* xx = (const double*)x.data;
    const double* yy = (const double*)y.data;
    double total = 0.0;
    for (int k = 3 * first; k < 3 * last; ++k) total += xx[k] * yy[k];
    return total;
"""
)
def dot_of(first: int, last: int, x: wp.array(dtype=wp.vec3d), y: wp.array(dtype=wp.vec3d)) -> wp.float64: ...


@wp.kernel
def dot(begin: int, tiles: int, sizes: wp.array(dtype=int), x: wp.array(dtype=wp.vec3d), y: wp.array(dtype=wp.vec3d),
        sums_out: wp.array(dtype=real)):  # fmt: skip
    """x . y by tiles."""
    tile = begin + wp.tid()
    count = sizes[BLOCKS]
    sums_out[tile] = dot_of(place(tile, tiles, count), place(tile + 1, tiles, count), x, y)
