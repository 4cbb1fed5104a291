"""Kernels that sum element blocks into a matrix along a `BlockPattern`, and use its diagonal and its rows."""

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d


@wp.struct
class PatternArrays:
    """The lists of a `BlockPattern` on a device."""

    diagonal: wp.array(dtype=wp.int32)
    upper: wp.array(dtype=wp.int32)
    lower: wp.array(dtype=wp.int32)
    block_offsets: wp.array(dtype=wp.int32)
    block_slots: wp.array(dtype=wp.int32)
    outer_offsets: wp.array(dtype=wp.int32)
    outer_slots: wp.array(dtype=wp.vec2i)
    row_offsets: wp.array(dtype=wp.int32)
    row_places: wp.array(dtype=wp.int32)


@wp.kernel
def gather_pairs(
    begin: int,
    pattern: PatternArrays,
    block: wp.array(dtype=mat33),
    vector: wp.array(dtype=vec3),
    data_out: wp.array(dtype=mat33),
):
    """A_ij and ``A_ji = A_ij^T`` of each pair: blocks of elements, and outer products of their vectors."""
    p = known(begin + wp.tid())
    total = mat33()
    for k in range(pattern.block_offsets[p], pattern.block_offsets[p + 1]):
        slot = pattern.block_slots[known(k)]
        if slot < 0:
            total += wp.transpose(block[known(-slot - 1)])
        else:
            total += block[known(slot)]
    for k in range(pattern.outer_offsets[p], pattern.outer_offsets[p + 1]):
        slots = pattern.outer_slots[known(k)]
        total += wp.outer(vector[known(slots[0])], vector[known(slots[1])])
    data_out[known(pattern.upper[p])] = total
    data_out[known(pattern.lower[p])] = wp.transpose(total)


@wp.kernel
def gather_diagonal(
    begin: int,
    pattern: PatternArrays,
    mass: wp.array(dtype=real),
    data_out: wp.array(dtype=mat33),
):
    """``A_ii = m_i I - sum_j A_ij``, exactly symmetric; the identity for rows without mass of their own."""
    i = known(begin + wp.tid())
    total = mat33()
    m = mass[i]
    one = real(1.0)
    if m > real(0.0):
        for k in range(pattern.row_offsets[i], pattern.row_offsets[i + 1]):
            total -= data_out[known(pattern.row_places[known(k)])]
        total = (total + wp.transpose(total)) * real(0.5)
        one = m
    zero = real(0.0)
    data_out[known(pattern.diagonal[i])] = total + mat33(one, zero, zero, zero, one, zero, zero, zero, one)
