"""Kernels of the Newton solver: forces of the cone, the gradient of the Lagrangian, multipliers and penalties.

Every kernel works on one *tile*, a contiguous share of a list, ``which``, of contacts or of blocks: of all, or of those
where something is left to do (`newton_region`). Sums are made tile by tile and then in the order of tiles, so that they
do not depend on threads. The length of the list is read from `sizes`, at the place ``of`` (see below).
Letters: u = J v relative velocities, s = l - rho (u - floor + shift), r = P_K(s) impulses, D = rho dP/ds.

J is stored twice: by contacts, and its blocks once more in the order of the columns (`jt`), so that both products read
memory in a row. Native loops run in four lanes, of which three count: that fills the registers of a processor. So arrays
of vectors and blocks have room for one more number behind their last.
"""

import warp as wp

from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})

BLOCKS = wp.constant(0)  # places in `sizes`
CONTACTS = wp.constant(1)
SOME = wp.constant(2)  # blocks of the region
THEIRS = wp.constant(3)  # contacts of those
AROUND = wp.constant(4)  # blocks whose gradient the region changes
PARTS = wp.constant(5)  # small bodies of the region
SIZES = 6

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


@wp.func_native(
    """
    const double* vv = (const double*)v.data;
    double s0[4] = {}, s1[4] = {}, s2[4] = {};
    for (int e = offsets.data[c]; e < offsets.data[c + 1]; ++e) {
        const double* b = (const double*)j.data + 9 * (size_t)e;
        const double* x = vv + 3 * (size_t)columns.data[e];
        for (int k = 0; k < 4; ++k) { s0[k] += b[k] * x[k]; s1[k] += b[3 + k] * x[k]; s2[k] += b[6 + k] * x[k]; }
    }
    double* u = (double*)u_out.data + 3 * (size_t)c;
    u[0] = s0[0] + s0[1] + s0[2]; u[1] = s1[0] + s1[1] + s1[2]; u[2] = s2[0] + s2[1] + s2[2];
"""
)
def relative_to(c: int, offsets: wp.array(dtype=int), columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d),
                v: wp.array(dtype=wp.vec3d), u_out: wp.array(dtype=wp.vec3d)): ...  # fmt: skip


@wp.func
def slip(u: wp.vec3d) -> real:
    """The tangential speed."""
    return wp.sqrt(u[1] * u[1] + u[2] * u[2])


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
def contact_forces(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), offsets: wp.array(dtype=int),
                   columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                   floor: wp.array(dtype=real), mu: wp.array(dtype=real), rho: wp.array(dtype=real),
                   shift: wp.array(dtype=real), multiplier: wp.array(dtype=wp.vec3d), u_out: wp.array(dtype=wp.vec3d),
                   r_out: wp.array(dtype=wp.vec3d), d_out: wp.array(dtype=wp.mat33d), primal_out: wp.array(dtype=real),
                   wrong_out: wp.array(dtype=real)):  # fmt: skip
    """u, r and D of each contact, and the errors of its multiplier and of its shift [m/s].

    A shift that is too large lets a contact be missed without pushing, by as much as it is too large.
    """
    tile = begin + wp.tid()
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        c = which[t]
        relative_to(c, offsets, columns, j, v, u_out)
        u = u_out[c]
        s = multiplier[c] - rho[c] * wp.vec3d(u[0] - floor[c] + shift[c], u[1], u[2])
        r = on_cone(s, mu[c])
        r_out[c] = r
        d_out[c] = rho[c] * cone_derivative(s, mu[c])
        primal_out[c] = wp.length(r - multiplier[c]) / rho[c]
        wrong_out[c] = wp.where(
            r[0] > real(0.0), wp.abs(shift[c] - mu[c] * slip(u)), wp.max(floor[c] - u[0], real(0.0))
        )


@wp.kernel
def update_multipliers(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), u: wp.array(dtype=wp.vec3d),
                       mu: wp.array(dtype=real), r: wp.array(dtype=wp.vec3d), goal: wp.array(dtype=real), slow: real,
                       growth: real, part: real, more: real, most: real, least: wp.array(dtype=real), rho: wp.array(dtype=real), missed: wp.array(dtype=real),
                       lag: wp.array(dtype=real), stride: wp.array(dtype=real), shift: wp.array(dtype=real),
                       multiplier: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """l <- r, and the shift of De Saxce, mu |u_t|, which turns the cone's projection into Coulomb's law.

    The penalty of a contact that still misses more than the goal, and hardly less than at the last update, grows: what is
    squeezed between others is far stiffer than it is by itself.
    A contact that slides faster where it is pressed less comes to rest slowly: an update leaves k / (1 + k) of what its
    shift misses, k = -mu d|u_t| / du_n. As long as that goes on evenly its steps get longer, by ``more`` an update, up to
    what a secant step would be and ``most``. Where it swings from side to side it takes the secant step, which is shorter,
    ``least`` times the usual at least.
    """
    tile = begin + wp.tid()
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        c = which[t]
        miss = wp.length(r[c] - multiplier[c]) / rho[c]
        if miss > goal[0] and miss > slow * missed[c]:
            rho[c] = growth * rho[c]
        missed[c] = miss
        multiplier[c] = r[c]
        behind = mu[c] * slip(u[c]) - shift[c]
        longer = real(1.0)
        if stride[c] * lag[c] > real(0.0) and r[c][0] > real(0.0) and wp.abs(behind) > part * goal[0]:
            secant = stride[c] / (lag[c] - behind)
            if behind * lag[c] < real(0.0):
                longer = wp.max(secant, least[0])
            elif wp.abs(behind) < wp.abs(lag[c]):
                longer = wp.max(wp.min(wp.min(secant, more * stride[c] / lag[c]), most), real(1.0))
        after = wp.max(shift[c] + longer * behind, real(0.0))
        stride[c] = after - shift[c]
        lag[c] = behind
        shift[c] = after


@wp.kernel
def first_shift(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
                columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                mu: wp.array(dtype=real), u_out: wp.array(dtype=wp.vec3d), shift_out: wp.array(dtype=real)):  # fmt: skip
    """The shift of the velocities at the start."""
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        relative_to(c, offsets, columns, j, v, u_out)
        shift_out[c] = mu[c] * slip(u_out[c])


@wp.func_native(
    """
    const double* aa = (const double*)a.data;
    const double* jj = (const double*)jt.data;
    const double* rr = (const double*)r.data;
    const double* vv = (const double*)v.data;
    const double* ff = (const double*)free.data;
    for (int t_ = first; t_ < last; ++t_) {
        const int i = which.data[t_];
        miss_out.data[i] = 0.0;
        double* g = (double*)g_out.data + 3 * (size_t)i;
        g[0] = g[1] = g[2] = 0.0;
        if (fixed.data[i]) continue;
        double s0[4] = {}, s1[4] = {}, s2[4] = {}, t[4] = {};
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) {
            const double* b = aa + 9 * (size_t)e;
            const double* x = vv + 3 * (size_t)others.data[e];
            const double* y = ff + 3 * (size_t)others.data[e];
            for (int k = 0; k < 4; ++k) {
                const double w = x[k] - y[k];
                s0[k] += b[k] * w; s1[k] += b[3 + k] * w; s2[k] += b[6 + k] * w;
            }
        }
        for (int q = t_offsets.data[i]; q < t_offsets.data[i + 1]; ++q) {
            const double* b = jj + 9 * (size_t)q;
            const double* w = rr + 3 * (size_t)t_contacts.data[q];
            if (w[0] == 0.0 && w[1] == 0.0 && w[2] == 0.0) continue;
            for (int k = 0; k < 4; ++k) t[k] += b[k] * w[0] + b[3 + k] * w[1] + b[6 + k] * w[2];
        }
        const double* p = (const double*)load.data + 3 * (size_t)i;
        g[0] = s0[0] + s0[1] + s0[2] - p[0] - t[0];
        g[1] = s1[0] + s1[1] + s1[2] - p[1] - t[1];
        g[2] = s2[0] + s2[1] + s2[2] - p[2] - t[2];
        const double* l = (const double*)local.data + 9 * (size_t)i;
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double u = l[3 * k] * g[0] + l[3 * k + 1] * g[1] + l[3 * k + 2] * g[2];
            square += u * u;
        }
        miss_out.data[i] = square < 1e300 ? sqrt(square) : 1e300;
    }
"""
)
def gradient_of(first: int, last: int, which: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
                a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
                jt: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8), v: wp.array(dtype=wp.vec3d),
                free: wp.array(dtype=wp.vec3d), load: wp.array(dtype=wp.vec3d), r: wp.array(dtype=wp.vec3d),
                local: wp.array(dtype=wp.mat33d), g_out: wp.array(dtype=wp.vec3d), miss_out: wp.array(dtype=real)): ...  # fmt: skip


@wp.kernel
def gradient(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int),
             starts: wp.array(dtype=int), others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
             jt: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8), v: wp.array(dtype=wp.vec3d),
             free: wp.array(dtype=wp.vec3d), load: wp.array(dtype=wp.vec3d), r: wp.array(dtype=wp.vec3d),
             local: wp.array(dtype=wp.mat33d), g_out: wp.array(dtype=wp.vec3d), miss_out: wp.array(dtype=real)):  # fmt: skip
    """g = A (v - v*) - load - J^T r, and |D_A^-1 g| [m/s]."""
    tile = begin + wp.tid()
    count = sizes[of]
    gradient_of(place(tile, tiles, count), place(tile + 1, tiles, count), which, starts, others, a, t_offsets,
                t_contacts, jt, fixed, v, free, load, r, local, g_out, miss_out)  # fmt: skip


@wp.func_native(
    """
    double most[4] = {};
    int i = first;
    for (; i + 3 < last; i += 4)
        for (int k = 0; k < 4; ++k) most[k] = values.data[i + k] > most[k] ? values.data[i + k] : most[k];
    for (; i < last; ++i) most[0] = values.data[i] > most[0] ? values.data[i] : most[0];
    const double a = most[0] > most[1] ? most[0] : most[1], b = most[2] > most[3] ? most[2] : most[3];
    return a > b ? a : b;
"""
)
def most_of(first: int, last: int, values: wp.array(dtype=real)) -> wp.float64: ...


@wp.kernel
def largest_errors(begin: int, tiles: int, sizes: wp.array(dtype=int), primal: wp.array(dtype=real),
                   wrong: wp.array(dtype=real), miss: wp.array(dtype=real), errors_out: wp.array2d(dtype=real)):  # fmt: skip
    """The largest errors of all contacts and blocks, by tiles."""
    tile = begin + wp.tid()
    m = sizes[CONTACTS]
    n = sizes[BLOCKS]
    errors_out[0, tile] = most_of(place(tile, tiles, m), place(tile + 1, tiles, m), primal)
    errors_out[1, tile] = most_of(place(tile, tiles, m), place(tile + 1, tiles, m), wrong)
    errors_out[2, tile] = most_of(place(tile, tiles, n), place(tile + 1, tiles, n), miss)


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
def move(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int),
         length: wp.array(dtype=real), v: wp.array(dtype=wp.vec3d), dv: wp.array(dtype=wp.vec3d),
         p: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """v += length dv; dv and p become zero, as they are outside of the region all the time."""
    tile = begin + wp.tid()
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        i = which[t]
        v[i] = v[i] + length[0] * dv[i]
        dv[i] = wp.vec3d()
        p[i] = wp.vec3d()


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
