"""Contacts that several pairs share: a place on an edge belongs to all faces at the edge, a vertex to all around it."""

import numpy as np
import warp as wp

wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)


@wp.func_native(
    """
    // open addressing; the first of each key stays
    for (int i = 0; i < n; ++i) {
        const int *k = key.data + 3 * i;
        unsigned h = (unsigned)k[0] * 73856093u ^ (unsigned)k[1] * 19349663u ^ (unsigned)k[2] * 83492791u;
        h ^= h >> 15;
        for (h &= (unsigned)size - 1u;; h = (h + 1u) & ((unsigned)size - 1u)) {
            const int at = table.data[h];
            if (at < 0) {
                table.data[h] = i;
                first.data[i] = 1;
                break;
            }
            const int *other = key.data + 3 * at;
            if (other[0] == k[0] && other[1] == k[1] && other[2] == k[2]) {
                first.data[i] = 0;
                break;
            }
        }
    }
"""
)
def _firsts(
    key: wp.array2d(dtype=wp.int32), n: int, table: I32, size: int, first: wp.array(dtype=wp.uint8)
): ...  # fmt: skip


@wp.kernel
def mark_firsts(begin: int, key: wp.array2d(dtype=wp.int32), table: I32, first_out: wp.array(dtype=wp.uint8)):
    """Which of the keys (n, 3) did not come before; ``table`` is full of -1 and at least twice as long."""
    _firsts(key, key.shape[0], table, table.shape[0], first_out)


def first_of_each(vertices: np.ndarray, coefficients: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Which contacts (n,) to keep: all but those of ``shared`` whose places came before, on the same vertices."""
    out = np.ones(len(vertices), dtype=bool)
    rows = np.flatnonzero(shared)
    if not len(rows):
        return out
    c = coefficients[rows]
    # at most three vertices: one against one or two; the lone vertex first. With two lone ones the lower first.
    v = np.where(c != 0.0, vertices[rows], np.iinfo(np.int32).max)
    negative = np.sort(np.where(c < 0.0, v, np.iinfo(np.int32).max), axis=1)[:, :2]
    positive = np.sort(np.where(c > 0.0, v, np.iinfo(np.int32).max), axis=1)[:, :2]
    swap = (positive[:, 1] < np.iinfo(np.int32).max) | (
        (negative[:, 1] == np.iinfo(np.int32).max) & (negative[:, 0] < positive[:, 0])
    )
    one, two = np.where(swap[:, None], negative, positive), np.where(swap[:, None], positive, negative)
    key = wp.array(np.ascontiguousarray(np.column_stack([one[:, 0], two])), dtype=wp.int32, device="cpu")
    table = wp.full(1 << int(2 * len(rows)).bit_length(), -1, dtype=wp.int32, device="cpu")
    first = wp.zeros(len(rows), dtype=wp.uint8, device="cpu")
    wp.launch(mark_firsts, 1, inputs=[0, key, table, first], device="cpu")
    out[rows] = first.numpy().astype(bool)
    return out
