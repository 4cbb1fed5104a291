"""``L D L^T`` of a symmetric indefinite matrix in small dense blocks, along a plan of `elimination`, in Warp kernels.

Column k of the factor, with the diagonal block ``A_kk = L_k D_k L_k^T``: ``Y_ik = A_ik L_k^-T`` stays where A_ik was, and
``A_ij -= Y_ik D_k^-1 Y_jk^T`` for all i >= j below k. A part's row whose pivot is nothing beside what it started with
repeats earlier rows: it is *dropped* (its multiplier is zero) and counted. Blocks are row-major in one array.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.linalg.elimination import Elimination
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})

RANK = wp.constant(wp.float64(1e-11))  # of a row's own J M^-1 J^T: a pivot below it is round-off


@wp.struct
class BlockMatrix:
    """A matrix, its factor in place, and a right side, over the nodes as eliminated."""

    size: wp.array(dtype=wp.int32)  # (n,) rows of each node
    scalar: wp.array(dtype=wp.int32)  # (n,) first row in vectors
    fresh: wp.array(dtype=wp.int32)  # (n,) 1: a body that no earlier node updates
    diagonal: wp.array(dtype=wp.int32)  # (n,) where its diagonal block starts
    column: wp.array(dtype=wp.int32)  # (n + 1,) into `row` and `block`
    row: wp.array(dtype=wp.int32)  # later node of each block below the diagonal
    block: wp.array(dtype=wp.int32)  # where the block starts
    update: wp.array(dtype=wp.int32)  # (n + 1,) into `target`
    target: wp.array(dtype=wp.int32)  # where A_ij starts, for pairs i >= j of each column
    value: wp.array(dtype=wp.float64)
    inverse: wp.array(dtype=wp.float64)  # (rows,) of the pivots, 0 where dropped
    scale: wp.array(dtype=wp.float64)  # (rows,) what a pivot is compared with; 0: a row of a body, never dropped
    x: wp.array(dtype=wp.float64)  # (rows,) right side, then solution


# The three inner loops are written in C (the same for CPU and CUDA): Warp's own indexing costs half of their time.
I32 = wp.array(dtype=wp.int32)
F64 = wp.array(dtype=wp.float64)


@wp.func_native(
    """
    const int n = size.data[k], s = scalar.data[k];
    const int apart = fresh.data[k] ? 3 : 0;  // a body's mass and inertia are apart until others reach it
    double *a = value.data + diagonal.data[k], *inv = inverse.data + s;
    int dropped = 0;
    for (int r = 0; r < n; ++r) {
        const int begin = r > 2 ? apart : 0;
        double pivot = a[r * n + r], scaled[6];
        for (int c = begin; c < r; ++c) {
            scaled[c] = a[r * n + c] * inv[c];
            pivot -= a[r * n + c] * scaled[c];
        }
        const double least = scale.data[s + r];
        if ((least > 0.0 && pivot > -rank * least) || pivot == 0.0) {
            inv[r] = 0.0;
            ++dropped;
        } else {
            inv[r] = 1.0 / pivot;
        }
        for (int i = r + 1; i < n; ++i) {
            double y = a[i * n + r];
            for (int c = begin; c < r; ++c) y -= a[i * n + c] * scaled[c];
            a[i * n + r] = y;
        }
    }
    const int first = column.data[k], end = column.data[k + 1];
    for (int e = first; e < end; ++e) {
        double *y = value.data + block.data[e];
        const int rows = size.data[row.data[e]];
        for (int r = 1; r < n; ++r)
            for (int c = r > 2 ? apart : 0; c < r; ++c) {
                const double l = a[r * n + c] * inv[c];
                if (l != 0.0)
                    for (int i = 0; i < rows; ++i) y[i * n + r] -= l * y[i * n + c];
            }
    }
    const int *t = target.data + update.data[k];
    for (int e = first; e < end; ++e) {
        const double *ye = value.data + block.data[e];
        const int rows = size.data[row.data[e]];
        double scaled[36];
        for (int i = 0; i < rows; ++i)
            for (int r = 0; r < n; ++r) scaled[i * n + r] = ye[i * n + r] * inv[r];
        for (int f = first; f <= e; ++f) {
            const double *yf = value.data + block.data[f];
            const int columns = size.data[row.data[f]];
            double *out = value.data + *t++;
#define TURNBUCKLE_UPDATE(ROWS, COLUMNS, N)                                                \\
    for (int i = 0; i < ROWS; ++i)                                                         \\
        for (int j = 0; j < COLUMNS; ++j) {                                                \\
            double total = 0.0;                                                            \\
            for (int r = 0; r < N; ++r) total += scaled[i * N + r] * yf[j * N + r];        \\
            out[i * COLUMNS + j] -= total;                                                 \\
        }
            // the usual sizes with known bounds: no branch is left in them
            if (n == 6 && rows == 3 && columns == 3) { TURNBUCKLE_UPDATE(3, 3, 6) }
            else if (n == 3 && rows == 3 && columns == 3) { TURNBUCKLE_UPDATE(3, 3, 3) }
            else { TURNBUCKLE_UPDATE(rows, columns, n) }
#undef TURNBUCKLE_UPDATE
        }
    }
    return dropped;
"""
)
def _factor(
    size: I32, scalar: I32, fresh: I32, diagonal: I32, column: I32, row: I32, block: I32, update: I32, target: I32,
    value: F64, inverse: F64, scale: F64, k: int, rank: wp.float64,
) -> int: ...  # fmt: skip


@wp.func_native(
    """
    const int n = size.data[k], s = scalar.data[k];
    const double *a = value.data + diagonal.data[k], *inv = inverse.data + s;
    double *own = x.data + s, scaled[6];
    for (int r = 0; r < n; ++r) {
        for (int c = 0; c < r; ++c) own[r] -= a[r * n + c] * scaled[c];
        scaled[r] = own[r] * inv[r];
    }
    for (int e = column.data[k]; e < column.data[k + 1]; ++e) {
        const double *y = value.data + block.data[e];
        double *other = x.data + scalar.data[row.data[e]];
        const int rows = size.data[row.data[e]];
#define TURNBUCKLE_TAKE(ROWS, N)                                                           \\
    for (int i = 0; i < ROWS; ++i) {                                                       \\
        double total = 0.0;                                                                \\
        for (int r = 0; r < N; ++r) total += y[i * N + r] * scaled[r];                     \\
        other[i] -= total;                                                                 \\
    }
        if (n == 6 && rows == 3) { TURNBUCKLE_TAKE(3, 6) }
        else if (n == 3 && rows == 3) { TURNBUCKLE_TAKE(3, 3) }
        else { TURNBUCKLE_TAKE(rows, n) }
#undef TURNBUCKLE_TAKE
    }
"""
)
def _forward(
    size: I32, scalar: I32, diagonal: I32, column: I32, row: I32, block: I32, value: F64, inverse: F64, x: F64, k: int
): ...


@wp.func_native(
    """
    const int n = size.data[k], s = scalar.data[k];
    const double *a = value.data + diagonal.data[k], *inv = inverse.data + s;
    double *own = x.data + s;
    for (int e = column.data[k]; e < column.data[k + 1]; ++e) {
        const double *y = value.data + block.data[e];
        const double *other = x.data + scalar.data[row.data[e]];
        const int rows = size.data[row.data[e]];
#define TURNBUCKLE_TAKE(ROWS, N)                                                           \\
    for (int i = 0; i < ROWS; ++i)                                                         \\
        for (int r = 0; r < N; ++r) own[r] -= y[i * N + r] * other[i];
        if (n == 6 && rows == 3) { TURNBUCKLE_TAKE(3, 6) }
        else if (n == 3 && rows == 3) { TURNBUCKLE_TAKE(3, 3) }
        else { TURNBUCKLE_TAKE(rows, n) }
#undef TURNBUCKLE_TAKE
    }
    for (int r = n - 1; r >= 0; --r) {
        double total = own[r];
        for (int i = r + 1; i < n; ++i) total -= a[i * n + r] * own[i];
        own[r] = total * inv[r];
    }
"""
)
def _backward(
    size: I32, scalar: I32, diagonal: I32, column: I32, row: I32, block: I32, value: F64, inverse: F64, x: F64, k: int
): ...


@wp.func
def factor_node(m: BlockMatrix, k: int, rank: real):
    """Eliminate node ``k``; pivots below ``rank`` of their `scale` are dropped. Returns the number of rows dropped."""
    return _factor(
        m.size, m.scalar, m.fresh, m.diagonal, m.column, m.row, m.block, m.update, m.target, m.value, m.inverse, m.scale,
        k, rank,
    )  # fmt: skip


@wp.func
def forward_node(m: BlockMatrix, k: int):
    """``x_k = L_k^-1 x_k``, and take it out of the later nodes."""
    _forward(m.size, m.scalar, m.diagonal, m.column, m.row, m.block, m.value, m.inverse, m.x, k)


@wp.func
def backward_node(m: BlockMatrix, k: int):
    """``x_k`` of the solution, from those of the later nodes."""
    _backward(m.size, m.scalar, m.diagonal, m.column, m.row, m.block, m.value, m.inverse, m.x, k)


@dataclass
class Plan:
    """Where everything of a `BlockMatrix` lies; host arrays."""

    elimination: Elimination
    size: np.ndarray
    scalar: np.ndarray  # (n + 1,)
    diagonal: np.ndarray
    column: np.ndarray
    row: np.ndarray
    block: np.ndarray
    update: np.ndarray
    target: np.ndarray
    values: int

    def place(self, node: int, other: int) -> tuple[int, bool]:
        """Where the block between two nodes (as eliminated) starts, and whether it is stored as (other, node)."""
        low, high = min(node, other), max(node, other)
        first, end = self.column[low], self.column[low + 1]
        e = first + int(np.searchsorted(self.row[first:end], high))
        return int(self.block[e]), high == other


def make_plan(elimination: Elimination, sizes: np.ndarray) -> Plan:
    """Lay out the blocks. ``sizes``: rows of the nodes of the graph."""
    n = len(elimination.number)
    size = np.empty(n, dtype=np.int64)
    size[elimination.number] = sizes
    counts = np.array([len(r) for r in elimination.rows], dtype=np.int64)
    column = np.r_[0, np.cumsum(counts)]
    row = np.concatenate([np.zeros(0, np.int64), *elimination.rows])
    of = np.repeat(np.arange(n), counts)
    diagonal = np.r_[0, np.cumsum(size * size)]
    block = np.r_[0, np.cumsum(size[row] * size[of])] + diagonal[-1]
    key = of * n + row  # increasing: columns in order, rows in order within
    pairs = counts * (counts + 1) // 2
    update = np.r_[0, np.cumsum(pairs)]
    lower = [np.tril_indices(c) for c in range(int(counts.max(initial=0)) + 1)]
    i = np.concatenate(
        [np.zeros(0, np.int64), *(r[lower[c][0]] for r, c in zip(elimination.rows, counts, strict=True))]
    )
    j = np.concatenate(
        [np.zeros(0, np.int64), *(r[lower[c][1]] for r, c in zip(elimination.rows, counts, strict=True))]
    )
    target = np.where(i == j, diagonal[i], 0)
    off = i != j
    target[off] = block[np.searchsorted(key, j[off] * n + i[off])]
    return Plan(
        elimination,
        size,
        np.r_[0, np.cumsum(size)],
        diagonal[:-1],
        column,
        row,
        block[:-1],
        update,
        target,
        int(block[-1]),
    )


def upload(plan: Plan, device: str) -> BlockMatrix:
    """An empty matrix on ``device``."""
    m = BlockMatrix()
    for name in ("size", "diagonal", "column", "row", "block", "update", "target"):
        setattr(m, name, wp.array(getattr(plan, name).astype(np.int32), dtype=wp.int32, device=device))
    m.scalar = wp.array(plan.scalar[:-1].astype(np.int32), dtype=wp.int32, device=device)
    reached = np.zeros(len(plan.size), dtype=bool)
    reached[plan.row] = True
    m.fresh = wp.array(((plan.size == 6) & ~reached).astype(np.int32), dtype=wp.int32, device=device)
    m.value = wp.zeros(max(plan.values, 1), dtype=wp.float64, device=device)
    for name in ("inverse", "scale", "x"):
        setattr(m, name, wp.zeros(max(int(plan.scalar[-1]), 1), dtype=wp.float64, device=device))
    return m
