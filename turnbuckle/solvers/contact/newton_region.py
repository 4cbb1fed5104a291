"""Where there is something left to do: the blocks that a Newton step moves.

After a step on everything, and in the rounds of refinement that follow the first, what is unsettled are some dozens
of places where contacts change, while thousands of blocks rest. A step then moves the blocks whose gradient is a notable
part of the largest, and their neighbours, by A or by a contact that pushes; of small bodies, all blocks. It is a Newton
step of the same function on fewer unknowns. Nothing is held for longer than a step, so what a step disturbs around it is
moved by the next.
"""

import warp as wp

from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import AROUND, BLOCKS, CONTACTS, PARTS, SOME, THEIRS

wp.set_module_options({"enable_backward": False})

NOTABLE = 0.01  # of the largest |D_A^-1 g|
SETTLED = 0.3  # of the tolerance: blocks whose gradient is smaller are left alone
SLIGHT = 0.2  # of the tolerance: multipliers and shifts that miss by less keep their values
MOST = 0.6  # of all blocks: a step on more than that takes them all


@wp.func_native(
    """
    unsigned char *mark = block_mark.data, *theirs_mark = contact_mark.data;
    enum { LEFT = 1, NEXT = 2, NEAR = 4 };
    for (int i = 0; i < n; ++i) mark[i] = miss.data[i] > least && !fixed.data[i] ? LEFT : 0;
    for (int c = 0; c < m; ++c) theirs_mark[c] = 0;
    for (int i = 0; i < n; ++i) {
        if (!(mark[i] & LEFT)) continue;
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) mark[others.data[e]] |= NEXT;
        for (int q = t_offsets.data[i]; q < t_offsets.data[i + 1]; ++q) {
            const int c = t_contacts.data[q];
            if (((const double*)r.data)[3 * (size_t)c] == 0.0) continue;  // does not push
            for (int e = offsets.data[c]; e < offsets.data[c + 1]; ++e) mark[columns.data[e]] |= NEXT;
        }
    }
    int parts = 0;
    for (int p = 0; p < bodies; ++p) {  // small bodies move as a whole
        bool any = false;
        for (int k = body_starts.data[p]; k < body_starts.data[p + 1]; ++k) any |= (mark[body_blocks.data[k]] & (LEFT | NEXT)) != 0;
        if (!any) continue;
        some_parts.data[parts++] = p;
        for (int k = body_starts.data[p]; k < body_starts.data[p + 1]; ++k) mark[body_blocks.data[k]] |= NEXT;
    }
    int moved = 0;
    for (int i = 0; i < n; ++i) {
        const int other = partner.data[i];
        if (fixed.data[i] || !((mark[i] | (other < 0 ? 0 : mark[other])) & (LEFT | NEXT))) continue;
        some.data[moved++] = i;
        for (int e = starts.data[i]; e < starts.data[i + 1]; ++e) mark[others.data[e]] |= NEAR;
        for (int q = t_offsets.data[i]; q < t_offsets.data[i + 1]; ++q) theirs_mark[t_contacts.data[q]] = 1;
    }
    int touched = 0, near = 0;
    for (int c = 0; c < m; ++c) {
        if (!theirs_mark[c]) continue;
        theirs.data[touched++] = c;
        for (int e = offsets.data[c]; e < offsets.data[c + 1]; ++e) mark[columns.data[e]] |= NEAR;
    }
    for (int i = 0; i < n; ++i)
        if (mark[i] & NEAR) around.data[near++] = i;
    sizes.data[of_parts] = parts;
    sizes.data[of_some] = moved;
    sizes.data[of_theirs] = touched;
    sizes.data[of_around] = near;
"""
)
def find_region(least: wp.float64, n: int, m: int, bodies: int, body_starts: wp.array(dtype=int),
                body_blocks: wp.array(dtype=int), some_parts: wp.array(dtype=int), miss: wp.array(dtype=real), fixed: wp.array(dtype=wp.uint8),
                partner: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
                t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int), offsets: wp.array(dtype=int),
                columns: wp.array(dtype=int), r: wp.array(dtype=wp.vec3d), block_mark: wp.array(dtype=wp.uint8),
                contact_mark: wp.array(dtype=wp.uint8), some: wp.array(dtype=int), theirs: wp.array(dtype=int),
                around: wp.array(dtype=int), sizes: wp.array(dtype=int), of_some: int, of_theirs: int,
                of_around: int, of_parts: int): ...  # fmt: skip


@wp.func_native(
    """
    unsigned char* mark = block_mark.data;
    for (int i = 0; i < n; ++i) mark[i] = 0;
    int touched = 0, near = 0;
    for (int c = 0; c < m; ++c) {
        if (primal.data[c] <= least && wrong.data[c] <= least) continue;
        theirs.data[touched++] = c;
        for (int e = offsets.data[c]; e < offsets.data[c + 1]; ++e) mark[columns.data[e]] = 1;
    }
    for (int i = 0; i < n; ++i)
        if (mark[i]) around.data[near++] = i;
    sizes.data[of_theirs] = touched;
    sizes.data[of_around] = near;
"""
)
def find_unsettled(least: wp.float64, n: int, m: int, primal: wp.array(dtype=real), wrong: wp.array(dtype=real),
                   offsets: wp.array(dtype=int), columns: wp.array(dtype=int), block_mark: wp.array(dtype=wp.uint8),
                   theirs: wp.array(dtype=int), around: wp.array(dtype=int), sizes: wp.array(dtype=int), of_theirs: int,
                   of_around: int): ...  # fmt: skip


@wp.kernel
def unsettled(begin: int, least: wp.array(dtype=real), primal: wp.array(dtype=real), wrong: wp.array(dtype=real),
              offsets: wp.array(dtype=int), columns: wp.array(dtype=int), block_mark: wp.array(dtype=wp.uint8),
              theirs: wp.array(dtype=int), around: wp.array(dtype=int), sizes: wp.array(dtype=int)):  # fmt: skip
    """Contacts whose multiplier or shift misses by more than ``least``, and the blocks that they act on."""
    find_unsettled(least[0], sizes[BLOCKS], sizes[CONTACTS], primal, wrong, offsets, columns, block_mark, theirs, around,
                   sizes, THEIRS, AROUND)  # fmt: skip


@wp.kernel
def region(begin: int, least: wp.array(dtype=real), bodies: int, body_starts: wp.array(dtype=int),
           body_blocks: wp.array(dtype=int), some_parts: wp.array(dtype=int), miss: wp.array(dtype=real), fixed: wp.array(dtype=wp.uint8),
           partner: wp.array(dtype=int), starts: wp.array(dtype=int), others: wp.array(dtype=int),
           t_offsets: wp.array(dtype=int), t_contacts: wp.array(dtype=int), offsets: wp.array(dtype=int),
           columns: wp.array(dtype=int), r: wp.array(dtype=wp.vec3d), block_mark: wp.array(dtype=wp.uint8),
           contact_mark: wp.array(dtype=wp.uint8), some: wp.array(dtype=int), theirs: wp.array(dtype=int),
           around: wp.array(dtype=int), sizes: wp.array(dtype=int)):  # fmt: skip
    """Blocks with ``|D_A^-1 g| > least`` and their neighbours, `some`; their contacts; blocks whose gradient they change.

    One item does it all, in the order of numbers: some tens of microseconds.
    """
    find_region(least[0], sizes[BLOCKS], sizes[CONTACTS], bodies, body_starts, body_blocks, some_parts, miss, fixed, partner, starts, others, t_offsets, t_contacts,
                offsets, columns, r, block_mark, contact_mark, some, theirs, around, sizes, SOME, THEIRS, AROUND,
                PARTS)  # fmt: skip
