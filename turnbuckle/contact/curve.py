"""Order along Hilbert's curve: neighbours on it are neighbours in space (Skilling 2004, Programming the Hilbert curve)."""

import numpy as np
import warp as wp

wp.set_module_options({"enable_backward": False})

BITS = 16  # an axis


@wp.func_native(
    """
    unsigned x[3];
    for (int k = 0; k < 3; ++k) x[k] = (unsigned)cell.data[3 * i + k];
    for (unsigned bit = 1u << (bits - 1); bit > 1u; bit >>= 1) {
        const unsigned mask = bit - 1u;
        for (int k = 0; k < 3; ++k) {
            if (x[k] & bit) {
                x[0] ^= mask;
            } else {
                const unsigned swap = (x[0] ^ x[k]) & mask;
                x[0] ^= swap;
                x[k] ^= swap;
            }
        }
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    unsigned turn = 0;
    for (unsigned bit = 1u << (bits - 1); bit > 1u; bit >>= 1)
        if (x[2] & bit) turn ^= bit - 1u;
    long long code = 0;
    for (int place = bits - 1; place >= 0; --place)
        for (int k = 0; k < 3; ++k) code = 2 * code + (long long)(((x[k] ^ turn) >> place) & 1u);
    return code;
"""
)
def _place(cell: wp.array2d(dtype=wp.int32), i: int, bits: int) -> wp.int64: ...


@wp.kernel
def places_on_curve(begin: int, cell: wp.array2d(dtype=wp.int32), bits: int, place_out: wp.array(dtype=wp.int64)):
    """How far along the curve each cell is."""
    i = begin + wp.tid()
    place_out[i] = _place(cell, i, bits)


def curve_order(points: np.ndarray) -> np.ndarray:
    """Numbers of the points (n, 3) in the order of the curve through their box, lower numbers first in a cell."""
    n = len(points)
    if n == 0:
        return np.zeros(0, dtype=np.int64)
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-300)
    cell = wp.array(((points - low) / size * (2**BITS - 1)).astype(np.int32), dtype=wp.int32, device="cpu")
    place = wp.zeros(n, dtype=wp.int64, device="cpu")
    wp.launch(places_on_curve, n, inputs=[0, cell, BITS, place], device="cpu")
    return np.argsort(place.numpy(), kind="stable")
