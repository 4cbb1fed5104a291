"""Kernels of operator splitting (see `splitting`). Tiles and letters are those of `newton_kernels`."""

import warp as wp

from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import BLOCKS, CONTACTS, place, relative_to

wp.set_module_options({"enable_backward": False})


@wp.func
def size_of(b: wp.mat33d) -> real:
    """How much of a block's velocity a contact sees: its weight, where the block is a frame times a weight."""
    return wp.sqrt(wp.ddot(b, b) / real(3.0))


@wp.kernel
def weights(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
            columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), local: wp.array(dtype=wp.mat33d),
            fixed: wp.array(dtype=wp.uint8), partner: wp.array(dtype=int), mass: wp.array(dtype=real), scale: real,
            kept: wp.array(dtype=int), weight_out: wp.array(dtype=real), span_out: wp.array(dtype=real)):  # fmt: skip
    """R of each contact, `scale` over an estimate of its compliance, and the sum of the weights of its blocks.

    What gives way is each body as a whole, 1 / m, and the points that carry the contact by themselves, J D_A^-1 J^T.
    The first ``kept`` contacts keep a weight that has grown.
    """
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        w = real(0.0)
        span = real(0.0)
        for e in range(offsets[c], offsets[c + 1]):
            i = columns[e]
            if fixed[i] == wp.uint8(0):
                w += wp.trace(j[e] * local[i] * wp.transpose(j[e])) / real(3.0)
                if partner[i] < 0 or partner[i] > i:
                    size = size_of(j[e])
                    span += size
                    w += size / mass[i]
        fresh = scale / wp.max(w, real(1.0e-100))
        if c < kept[0]:
            fresh = wp.max(fresh, weight_out[c])
        weight_out[c] = fresh
        span_out[c] = span


@wp.kernel
def majorant(begin: int, tiles: int, sizes: wp.array(dtype=int), starts: wp.array(dtype=int),
             others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int),
             t_contacts: wp.array(dtype=int), jt: wp.array(dtype=wp.mat33d), weight: wp.array(dtype=real),
             span: wp.array(dtype=real), partner: wp.array(dtype=int), diagonal_out: wp.array(dtype=wp.mat33d),
             coupled_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """Diagonal blocks of K, and those to the other half of a rigid body.

    With weights s_e of the blocks of a contact, ``|sum_e J_e x_e|^2 <= (sum_e s_e) sum_e |J_e x_e|^2 / s_e``, so K has no
    coupling that A does not have. Both halves of a rigid body are one term of the sum.
    """
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        h = wp.mat33d()
        off = wp.mat33d()
        other = partner[i]
        for e in range(starts[i], starts[i + 1]):
            if others[e] == i:
                h = h + a[e]
            elif others[e] == other:
                off = off + a[e]
        for q in range(t_offsets[i], t_offsets[i + 1]):
            c = t_contacts[q]
            o = q
            if other >= 0:
                o = t_offsets[other] + q - t_offsets[i]
            size = size_of(jt[q])
            if other >= 0 and other < i:
                size = size_of(jt[o])
            if size > real(0.0):
                k = weight[c] * span[c] / size
                h = h + k * (wp.transpose(jt[q]) * jt[q])
                if other >= 0:
                    off = off + k * (wp.transpose(jt[q]) * jt[o])
        diagonal_out[i] = h
        coupled_out[i] = off


@wp.kernel
def contact_step(begin: int, tiles: int, sizes: wp.array(dtype=int), offsets: wp.array(dtype=int),
                 columns: wp.array(dtype=int), j: wp.array(dtype=wp.mat33d), v: wp.array(dtype=wp.vec3d),
                 floor: wp.array(dtype=real), mu: wp.array(dtype=real), weight: wp.array(dtype=real), relax: real,
                 u_out: wp.array(dtype=wp.vec3d), z: wp.array(dtype=wp.vec3d), r: wp.array(dtype=wp.vec3d),
                 push_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """Each contact by itself: Coulomb's law with the compliance 1 / R, which its normal and tangent do not share.

    z and r become those of the next iterate; ``push = r + R (z - u)`` is what pulls u to z.
    """
    tile = begin + wp.tid()
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        relative_to(c, offsets, columns, j, v, u_out)
        u = u_out[c]
        k = weight[c]
        y = relax * u + (real(1.0) - relax) * z[c] - r[c] / k
        n = wp.max(k * (floor[c] - y[0]), real(0.0))
        f = wp.vec3d(n, -k * y[1], -k * y[2])
        slide = wp.sqrt(f[1] * f[1] + f[2] * f[2])
        if slide > mu[c] * n:
            f = wp.vec3d(n, f[1] * mu[c] * n / slide, f[2] * mu[c] * n / slide)
        y = y + f / k
        z[c] = y
        r[c] = f
        push_out[c] = f + k * (y - u)


@wp.kernel
def motion_step(begin: int, tiles: int, sizes: wp.array(dtype=int), partner: wp.array(dtype=int),
                fixed: wp.array(dtype=wp.uint8), apart: wp.array(dtype=wp.uint8), m: wp.array(dtype=wp.mat33d),
                n: wp.array(dtype=wp.mat33d), g: wp.array(dtype=wp.vec3d), change: wp.array(dtype=wp.vec3d),
                v: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """v <- v - K^-1 g; ``change`` is that of blocks whose body is factored, ``apart``."""
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        if fixed[i] == wp.uint8(0):
            if apart[i] != wp.uint8(0):
                v[i] = v[i] - change[i]
            else:
                step = m[i] * g[i]
                if partner[i] >= 0:
                    step = step + n[i] * g[partner[i]]
                v[i] = v[i] - step


@wp.kernel
def stiffen(begin: int, tiles: int, sizes: wp.array(dtype=int), u: wp.array(dtype=wp.vec3d), z: wp.array(dtype=wp.vec3d),
            goal: wp.array(dtype=real), slow: real, growth: real, missed: wp.array(dtype=real),
            weight: wp.array(dtype=real), stiffened_out: wp.array(dtype=real)):  # fmt: skip
    """R of contacts whose u and z come together too slowly grows; how many of the tile that are.

    What is squeezed between others is far stiffer than its bodies are as a whole.
    """
    tile = begin + wp.tid()
    count = real(0.0)
    for c in range(place(tile, tiles, sizes[CONTACTS]), place(tile + 1, tiles, sizes[CONTACTS])):
        miss = wp.length(u[c] - z[c])
        if miss > goal[0] and miss > slow * missed[c]:
            weight[c] = growth * weight[c]
            count += real(1.0)
        missed[c] = miss
    stiffened_out[tile] = count
