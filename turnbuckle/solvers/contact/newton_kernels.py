"""Kernels of the Newton solver: forces of the cone, the gradient, its preconditioner, and conjugate gradients.

Every kernel works on one *tile*, a contiguous share of the contacts or of the blocks: sums are made tile by tile and
then in the order of tiles, so that they do not depend on threads. Sizes are read from `sizes` (see the places below).
Letters: u = J v relative velocities, s = l - rho (u - floor + shift), r = P_K(s) impulses, D = rho dP/ds.
"""

import warp as wp

from turnbuckle.math.types import real

BLOCKS = wp.constant(0)  # places in `sizes`
CONTACTS = wp.constant(1)

ALPHA = wp.constant(0)  # places in `scalars`: step length of conjugate gradients
BETA = wp.constant(1)
RZ = wp.constant(2)  # r . M r
DONE = wp.constant(3)  # 1 when the residual is small enough
GOAL = wp.constant(4)  # r . M r at which to stop
TRIES = wp.constant(5)  # iterations made
GRADIENT = wp.constant(6)  # largest |D_A^-1 g| [m/s]
PRIMAL = wp.constant(7)  # largest |r - l| / rho [m/s]
SHIFT = wp.constant(8)  # largest error of the shift [m/s]
SCALARS = 16


@wp.func
def place(tile: int, tiles: int, count: int) -> int:
    """Where the share of a tile begins."""
    return int((wp.int64(tile) * wp.int64(count)) / wp.int64(tiles))


@wp.func
def relative(c: int, offsets: wp.array(dtype=int), columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d),
             v: wp.array(dtype=wp.vec3d)) -> wp.vec3d:  # fmt: skip
    """u of contact c."""
    u = wp.vec3d()
    for e in range(offsets[c], offsets[c + 1]):
        u += j[e] * v[columns[e]]
    return u


@wp.func
def on_cone(s: wp.vec3d, mu: real) -> wp.vec3d:
    """The nearest point of the cone ``|r_t| <= mu r_n`` to s = (normal, two tangential)."""
    t = wp.sqrt(s[1] * s[1] + s[2] * s[2])
    if t <= mu * s[0]:
        return s
    if mu * t <= -s[0]:
        return wp.vec3d()
    n = (s[0] + mu * t) / (real(1.0) + mu * mu)
    return wp.vec3d(n, mu * n * s[1] / t, mu * n * s[2] / t)


@wp.func
def cone_derivative(s: wp.vec3d, mu: real) -> wp.mat33d:
    """dP/ds, symmetric and positive semi-definite."""
    t = wp.sqrt(s[1] * s[1] + s[2] * s[2])
    if t <= mu * s[0]:
        return wp.identity(n=3, dtype=real)
    if mu * t <= -s[0]:
        return wp.mat33d()
    one = real(1.0)
    k = one / (one + mu * mu)
    a = real(0.0)
    b = real(0.0)
    bend = real(0.0)
    if t > real(0.0):
        a = s[1] / t
        b = s[2] / t
        bend = mu * (s[0] + mu * t) * k / t
    m = mu * k
    return wp.mat33d(
        k, m * a, m * b,
        m * a, mu * m * a * a + bend * (one - a * a), mu * m * a * b - bend * a * b,
        m * b, mu * m * a * b - bend * a * b, mu * m * b * b + bend * (one - b * b),
    )  # fmt: skip


@wp.kernel
def contact_forces(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
                   columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                   floor: wp.array(dtype=real), mu: wp.array(dtype=real), rho: wp.array(dtype=real),
                   shift: wp.array(dtype=real), multiplier: wp.array(dtype=wp.vec3d),
                   r_out: wp.array(dtype=wp.vec3d), d_out: wp.array(dtype=wp.mat33d), errors_out: wp.array2d(dtype=real)):  # fmt: skip
    """r and D of each contact, and the largest errors of multipliers and shifts in the tile."""
    tile = begin + wp.tid()
    primal = real(0.0)
    wrong = real(0.0)
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        u = relative(c, offsets, columns, j, v)
        w = u
        w[0] = u[0] - floor[c] + shift[c]
        s = multiplier[c] - rho[c] * w
        r = on_cone(s, mu[c])
        r_out[c] = r
        d_out[c] = rho[c] * cone_derivative(s, mu[c])
        primal = wp.max(primal, wp.length(r - multiplier[c]) / rho[c])
        if r[0] > real(0.0):
            wrong = wp.max(wrong, wp.abs(shift[c] - mu[c] * wp.sqrt(u[1] * u[1] + u[2] * u[2])))
    errors_out[0, tile] = primal
    errors_out[1, tile] = wrong


@wp.kernel
def update_multipliers(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
                       columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                       mu: wp.array(dtype=real), r: wp.array(dtype=wp.vec3d), shift_out: wp.array(dtype=real),
                       multiplier_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """l <- r, and the shift of De Saxce, mu |u_t|, which turns the cone's projection into Coulomb's law."""
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        multiplier_out[c] = r[c]
        if mu[c] > real(0.0):
            u = relative(c, offsets, columns, j, v)
            shift_out[c] = mu[c] * wp.sqrt(u[1] * u[1] + u[2] * u[2])


@wp.func_native(
    """
    const double* aa = (const double*)a.data;
    const double* jj = (const double*)j.data;
    const double* dd = (const double*)d.data;
    const double* rr = (const double*)r.data;
    const double* vv = (const double*)v.data;
    const double* ff = (const double*)free.data;
    double worst = 0.0;
    for (int i = first; i < last; ++i) {
        const int other = partner.data[i];
        double g[3], h[9], off[9];
        for (int k = 0; k < 3; ++k) g[k] = -((const double*)load.data)[3 * (size_t)i + k];
        for (int k = 0; k < 9; ++k) h[k] = off[k] = 0.0;
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) {
            const double* b = aa + 9 * (size_t)e;
            const int c = others.data[e];
            const double* x = vv + 3 * (size_t)c;
            const double* y = ff + 3 * (size_t)c;
            const double u0 = x[0] - y[0], u1 = x[1] - y[1], u2 = x[2] - y[2];
            g[0] += b[0] * u0 + b[1] * u1 + b[2] * u2;
            g[1] += b[3] * u0 + b[4] * u1 + b[5] * u2;
            g[2] += b[6] * u0 + b[7] * u1 + b[8] * u2;
            if (c == i) for (int k = 0; k < 9; ++k) h[k] += b[k];
            else if (c == other) for (int k = 0; k < 9; ++k) off[k] += b[k];
        }
        for (int q = t_offsets.data[i]; q < t_offsets.data[i + 1]; ++q) {
            const int e = t_entries.data[q], c = t_contacts.data[q];
            const double* b = jj + 9 * (size_t)e;
            const double* m = dd + 9 * (size_t)c;
            const double* w = rr + 3 * (size_t)c;
            for (int k = 0; k < 3; ++k) g[k] -= b[k] * w[0] + b[3 + k] * w[1] + b[6 + k] * w[2];
            if (m[0] == 0.0) continue;  // a contact that does not touch
            double mb[9];  // D J
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l) mb[3 * k + l] = m[3 * k] * b[l] + m[3 * k + 1] * b[3 + l] + m[3 * k + 2] * b[6 + l];
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l) h[3 * k + l] += b[k] * mb[l] + b[3 + k] * mb[3 + l] + b[6 + k] * mb[6 + l];
            if (other >= 0) {  // the entry of the other half of a rigid body stands next to this one in the row
                const double* o = other > i ? b + 9 : b - 9;
                double mo[9];
                for (int k = 0; k < 3; ++k)
                    for (int l = 0; l < 3; ++l) mo[3 * k + l] = m[3 * k] * o[l] + m[3 * k + 1] * o[3 + l] + m[3 * k + 2] * o[6 + l];
                for (int k = 0; k < 3; ++k)
                    for (int l = 0; l < 3; ++l) off[3 * k + l] += b[k] * mo[l] + b[3 + k] * mo[3 + l] + b[6 + k] * mo[6 + l];
            }
        }
        if (fixed.data[i]) g[0] = g[1] = g[2] = 0.0;
        double* go = (double*)g_out.data + 3 * (size_t)i;
        double* ho = (double*)diagonal_out.data + 9 * (size_t)i;
        double* oo = (double*)coupled_out.data + 9 * (size_t)i;
        for (int k = 0; k < 3; ++k) go[k] = g[k];
        for (int k = 0; k < 9; ++k) { ho[k] = h[k]; oo[k] = off[k]; }
        const double* l = (const double*)local.data + 9 * (size_t)i;
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double u = l[3 * k] * g[0] + l[3 * k + 1] * g[1] + l[3 * k + 2] * g[2];
            square += u * u;
        }
        if (square > worst || square != square) worst = square;
    }
    return worst < 1e300 ? sqrt(worst) : 1e300;
"""
)
def gradient_of(first: int, last: int, starts: wp.array(dtype=int), others: wp.array(dtype=int),
                a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_entries: wp.array(dtype=int),
                t_contacts: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
                v: wp.array(dtype=wp.vec3d), free: wp.array(dtype=wp.vec3d), load: wp.array(dtype=wp.vec3d),
                r: wp.array(dtype=wp.vec3d), d: wp.array(dtype=wp.mat33d), local: wp.array(dtype=wp.mat33d),
                partner: wp.array(dtype=int), g_out: wp.array(dtype=wp.vec3d), diagonal_out: wp.array(dtype=wp.mat33d),
                coupled_out: wp.array(dtype=wp.mat33d)) -> wp.float64: ...  # fmt: skip


@wp.kernel
def gradient(begin: int, tiles: int, sizes: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
             a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_entries: wp.array(dtype=int),
             t_contacts: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
             v: wp.array(dtype=wp.vec3d), free: wp.array(dtype=wp.vec3d), load: wp.array(dtype=wp.vec3d),
             r: wp.array(dtype=wp.vec3d), d: wp.array(dtype=wp.mat33d), local: wp.array(dtype=wp.mat33d),
             partner: wp.array(dtype=int), g_out: wp.array(dtype=wp.vec3d), diagonal_out: wp.array(dtype=wp.mat33d),
             coupled_out: wp.array(dtype=wp.mat33d), errors_out: wp.array2d(dtype=real)):  # fmt: skip
    """g = A (v - v*) - load - J^T r, and the blocks of A + J^T D J: on the diagonal, and to the other half of a rigid body."""
    tile = begin + wp.tid()
    count = sizes[BLOCKS]
    errors_out[2, tile] = gradient_of(
        place(tile, tiles, count), place(tile + 1, tiles, count), starts, others, a, t_offsets, t_entries, t_contacts,
        j, fixed, v, free, load, r, d, local, partner, g_out, diagonal_out, coupled_out,
    )  # fmt: skip


@wp.kernel
def invert_blocks(begin: int, tiles: int, sizes: wp.array(dtype=int), partner: wp.array(dtype=int),
                  diagonal: wp.array(dtype=wp.mat33d), coupled: wp.array(dtype=wp.mat33d),
                  m_out: wp.array(dtype=wp.mat33d), n_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """The preconditioner M: inverses of blocks, of rigid bodies by the Schur complement of their other half."""
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        p = partner[i]
        if p < 0:
            m_out[i] = wp.inverse(diagonal[i])
        else:
            other = wp.inverse(diagonal[p])
            m = wp.inverse(diagonal[i] - coupled[i] * other * coupled[p])
            m_out[i] = m
            n_out[i] = -m * coupled[i] * other


@wp.kernel
def largest(begin: int, tiles: int, errors: wp.array2d(dtype=real), scalars_out: wp.array(dtype=real)):
    """The errors of all tiles, as three numbers."""
    primal = real(0.0)
    shift = real(0.0)
    g = real(0.0)
    for tile in range(tiles):
        primal = wp.max(primal, errors[0, tile])
        shift = wp.max(shift, errors[1, tile])
        g = wp.max(g, errors[2, tile])
    scalars_out[PRIMAL] = primal
    scalars_out[SHIFT] = shift
    scalars_out[GRADIENT] = g


@wp.kernel
def merit(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int), columns: wp.array(dtype=int),
          j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d), floor: wp.array(dtype=real), mu: wp.array(dtype=real),
          rho: wp.array(dtype=real), shift: wp.array(dtype=real), multiplier: wp.array(dtype=wp.vec3d),
          sums_out: wp.array(dtype=real)):  # fmt: skip
    """The contacts' part of the augmented Lagrangian, sum |r|^2 / (2 rho), by tiles."""
    tile = begin + wp.tid()
    total = real(0.0)
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        w = relative(c, offsets, columns, j, v)
        w[0] = w[0] - floor[c] + shift[c]
        r = on_cone(multiplier[c] - rho[c] * w, mu[c])
        total += real(0.5) * wp.dot(r, r) / rho[c]
    sums_out[tile] = total


@wp.kernel
def inertia_merit(begin: int, tiles: int, sizes: wp.array(dtype=int), starts: wp.array(dtype=int),
                  others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                  free: wp.array(dtype=wp.vec3d), load: wp.array(dtype=wp.vec3d), sums_out: wp.array(dtype=real)):  # fmt: skip
    """(v - v*) . (A (v - v*) / 2 - load) by tiles."""
    tile = begin + wp.tid()
    total = real(0.0)
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        q = wp.vec3d()
        for e in range(starts[i], starts[i + 1]):
            q += a[e] * (v[others[e]] - free[others[e]])
        total += wp.dot(v[i] - free[i], real(0.5) * q - load[i])
    sums_out[tile] = total


@wp.kernel
def move(begin: int, tiles: int, sizes: wp.array(dtype=int), length: wp.array(dtype=real), v: wp.array(dtype=wp.vec3d),
         dv: wp.array(dtype=wp.vec3d), v_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """v_out = v + length dv."""
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        v_out[i] = v[i] + length[0] * dv[i]


@wp.kernel
def local_inverses(begin: int, tiles: int, sizes: wp.array(dtype=int), starts: wp.array(dtype=int),
                   others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d), local_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """Inverses of the diagonal blocks of A."""
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        for e in range(starts[i], starts[i + 1]):
            if others[e] == i:
                local_out[i] = wp.inverse(a[e])


@wp.kernel
def penalties(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
              columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), local: wp.array(dtype=wp.mat33d),
              fixed: wp.array(dtype=wp.uint8), scale: wp.array(dtype=real), rho_out: wp.array(dtype=real)):  # fmt: skip
    """rho = scale over the mean compliance of the contact, J D_A^-1 J^T."""
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        w = real(0.0)
        for e in range(offsets[c], offsets[c + 1]):
            if fixed[columns[e]] == wp.uint8(0):
                w += wp.trace(j[e] * local[columns[e]] * wp.transpose(j[e]))
        rho_out[c] = real(3.0) * scale[0] / wp.max(w, real(1.0e-300))


@wp.kernel
def wanted_shift(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
                 columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                 mu: wp.array(dtype=real), y_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """mu |u_t| into the first component of y: what the shift is at the start."""
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        u = relative(c, offsets, columns, j, v)
        y_out[c] = wp.vec3d(mu[c] * wp.sqrt(u[1] * u[1] + u[2] * u[2]), real(0.0), real(0.0))
