"""The preconditioner of the Newton solver: diagonal blocks of ``H = A + J^T D J`` and their inverses.

Blocks are 3 x 3 of points, 6 x 6 of rigid bodies. See `newton_kernels` for tiles and letters.
"""

import warp as wp

from turnbuckle.solvers.contact.newton_kernels import BLOCKS, place

wp.set_module_options({"enable_backward": False})


@wp.func_native(
    """
    const double* aa = (const double*)a.data;
    const double* jj = (const double*)jt.data;
    const double* dd = (const double*)d.data;
    for (int t = first; t < last; ++t) {
        const int i = which.data[t];
        const int other = partner.data[i];
        double h[3][4] = {}, off[3][4] = {};
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) {
            const double* b = aa + 9 * (size_t)e;
            const int c = others.data[e];
            if (c == i) for (int k = 0; k < 3; ++k) for (int l = 0; l < 3; ++l) h[k][l] = b[3 * k + l];
            else if (c == other) for (int k = 0; k < 3; ++k) for (int l = 0; l < 3; ++l) off[k][l] = b[3 * k + l];
        }
        for (int q = t_offsets.data[i]; q < t_offsets.data[i + 1]; ++q) {
            const double* b = jj + 9 * (size_t)q;
            const double* m = dd + 9 * (size_t)t_contacts.data[q];
            if (m[0] == 0.0) continue;  // a contact that does not touch
            double bm[3][3];  // J_i^T D
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l) bm[k][l] = b[k] * m[l] + b[3 + k] * m[3 + l] + b[6 + k] * m[6 + l];
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 4; ++l) h[k][l] += bm[k][0] * b[l] + bm[k][1] * b[3 + l] + bm[k][2] * b[6 + l];
            if (other < 0) continue;
            // the other half of a rigid body has its entries in the same order
            const double* o = jj + 9 * (size_t)(t_offsets.data[other] + q - t_offsets.data[i]);
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 4; ++l) off[k][l] += bm[k][0] * o[l] + bm[k][1] * o[3 + l] + bm[k][2] * o[6 + l];
        }
        double* ho = (double*)diagonal_out.data + 9 * (size_t)i;
        double* oo = (double*)coupled_out.data + 9 * (size_t)i;
        for (int k = 0; k < 3; ++k)
            for (int l = 0; l < 3; ++l) { ho[3 * k + l] = h[k][l]; oo[3 * k + l] = off[k][l]; }
    }
"""
)
def diagonals_of(first: int, last: int, which: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
                 a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
                 jt: wp.array(dtype=wp.mat33d), d: wp.array(dtype=wp.mat33d), partner: wp.array(dtype=int),
                 diagonal_out: wp.array(dtype=wp.mat33d), coupled_out: wp.array(dtype=wp.mat33d)): ...  # fmt: skip


@wp.kernel
def diagonals(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
              a: wp.array(dtype=wp.mat33d), t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int),
              jt: wp.array(dtype=wp.mat33d), d: wp.array(dtype=wp.mat33d), partner: wp.array(dtype=int),
              diagonal_out: wp.array(dtype=wp.mat33d), coupled_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """Blocks of H: on the diagonal, and to the other half of a rigid body."""
    tile = begin + wp.tid()
    count = sizes[of]
    diagonals_of(place(tile, tiles, count), place(tile + 1, tiles, count), which, starts, others, a, t_offsets, t_contacts, jt, d,
                 partner, diagonal_out, coupled_out)  # fmt: skip


@wp.kernel
def invert_blocks(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), partner: wp.array(dtype=int),
                  diagonal: wp.array(dtype=wp.mat33d), coupled: wp.array(dtype=wp.mat33d),
                  m_out: wp.array(dtype=wp.mat33d), n_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """The preconditioner M: inverses of blocks, of rigid bodies by the Schur complement of their other half."""
    tile = begin + wp.tid()
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        i = which[t]
        p = partner[i]
        if p < 0:
            m_out[i] = wp.inverse(diagonal[i])
        else:
            other = wp.inverse(diagonal[p])
            m = wp.inverse(diagonal[i] - coupled[i] * other * coupled[p])
            m_out[i] = m
            n_out[i] = -m * coupled[i] * other


@wp.kernel
def local_inverses(begin: int, tiles: int, sizes: wp.array(dtype=int), starts: wp.array(dtype=int),
                   others: wp.array(dtype=int), a: wp.array(dtype=wp.mat33d), local_out: wp.array(dtype=wp.mat33d)):  # fmt: skip
    """D_A^-1: inverses of the diagonal blocks of A."""
    tile = begin + wp.tid()
    for i in range(place(tile, tiles, sizes[BLOCKS]), place(tile + 1, tiles, sizes[BLOCKS])):
        for e in range(starts[i], starts[i + 1]):
            if others[e] == i:
                local_out[i] = wp.inverse(a[e])
