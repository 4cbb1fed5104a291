"""Products and diagonals of block-sparse matrices (3 x 3 blocks) that live in Warp arrays."""

import numpy as np
import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d


@wp.kernel
def block_multiply(
    begin: int,
    indptr: wp.array(dtype=wp.int32),
    indices: wp.array(dtype=wp.int32),
    data: wp.array(dtype=mat33),
    x: wp.array(dtype=vec3),
    y_out: wp.array(dtype=vec3),
):
    """``y = A x``, a row of blocks an item."""
    i = known(begin + wp.tid())
    a = real(0.0)  # numbers, not a vector: the sums stay in registers
    b = real(0.0)
    c = real(0.0)
    for k in range(indptr[i], indptr[i + 1]):
        y = data[known(k)] * x[known(indices[known(k)])]
        a += y[0]
        b += y[1]
        c += y[2]
    y_out[i] = vec3(a, b, c)


@wp.kernel
def invert_diagonal(
    begin: int, diagonal: wp.array(dtype=wp.int32), data: wp.array(dtype=mat33), inverse_out: wp.array(dtype=mat33)
):
    """``A_ii^-1`` of each row of blocks: block Jacobi's part of Contact, (9)."""
    i = known(begin + wp.tid())
    inverse_out[i] = wp.inverse(data[known(diagonal[i])])


def diagonal_blocks(data: np.ndarray, indptr: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """The diagonal blocks (n, 3, 3) of a matrix that has them all (scipy's BSR arrays)."""
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    return data[np.flatnonzero(indices == rows)]
