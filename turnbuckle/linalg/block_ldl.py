"""``L D L^T`` of a symmetric indefinite matrix in small dense blocks, along a plan of `elimination`, in Warp kernels.

Column k of the factor, with the diagonal block ``A_kk = L_k D_k L_k^T``: ``Y_ik = A_ik L_k^-T`` stays where A_ik was, and
``A_ij -= Y_ik D_k^-1 Y_jk^T`` for all i >= j below k. A part's row whose pivot is nothing beside what it started with
repeats earlier rows: it is *dropped* (its multiplier is zero) and counted. Blocks are row-major in one array.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.linalg.elimination import Elimination
from turnbuckle.math.index import known
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


@wp.func
def apart(m: BlockMatrix, k: int, r: int):
    """The first row of node ``k`` that is coupled with its row ``r``: a body's mass and inertia are apart until others reach it."""
    if m.fresh[known(k)] == 1 and r > 2:
        return 3
    return 0


@wp.func
def factor_node(m: BlockMatrix, k: int, rank: real):
    """Eliminate node ``k``; pivots below ``rank`` of their `scale` are dropped. Returns the number of rows dropped."""
    n = known(m.size[k])
    d = known(m.diagonal[k])
    s = known(m.scalar[k])
    dropped = int(0)
    for r in range(n):
        begin = apart(m, k, r)
        pivot = m.value[known(d + r * n + r)]
        for c in range(begin, r):
            y = m.value[known(d + r * n + c)]
            pivot -= y * y * m.inverse[known(s + c)]
        scale = m.scale[known(s + r)]
        if (scale > real(0.0) and pivot > -rank * scale) or pivot == real(0.0):
            m.inverse[known(s + r)] = real(0.0)
            dropped += 1
        else:
            m.inverse[known(s + r)] = real(1.0) / pivot
        for i in range(r + 1, n):  # row i of the unscaled factor: y_ir = L_ir D_r
            y = m.value[known(d + i * n + r)]
            for c in range(begin, r):
                y -= m.value[known(d + i * n + c)] * m.value[known(d + r * n + c)] * m.inverse[known(s + c)]
            m.value[known(d + i * n + r)] = y
    first = known(m.column[k])
    end = m.column[k + 1]
    for e in range(first, end):
        b = known(m.block[known(e)])
        rows = m.size[known(m.row[known(e)])]
        for i in range(rows):
            for r in range(n):
                y = m.value[known(b + i * n + r)]
                for c in range(apart(m, k, r), r):
                    y -= m.value[known(b + i * n + c)] * m.value[known(d + r * n + c)] * m.inverse[known(s + c)]
                m.value[known(b + i * n + r)] = y
    u = int(m.update[k])
    for e in range(first, end):
        be = known(m.block[known(e)])
        rows = m.size[known(m.row[known(e)])]
        for f in range(first, e + 1):
            bf = known(m.block[known(f)])
            columns = m.size[known(m.row[known(f)])]
            t = known(m.target[known(u)])
            u += 1
            for i in range(rows):
                for j in range(columns):
                    total = real(0.0)
                    for r in range(n):
                        y = m.value[known(be + i * n + r)] * m.inverse[known(s + r)]
                        total += y * m.value[known(bf + j * n + r)]
                    m.value[known(t + i * columns + j)] -= total
    return dropped


@wp.func
def forward_node(m: BlockMatrix, k: int):
    """``x_k = L_k^-1 x_k``, and take it out of the later nodes."""
    n = known(m.size[k])
    d = known(m.diagonal[k])
    s = known(m.scalar[k])
    for r in range(n):
        x = m.x[known(s + r)]
        for c in range(r):
            x -= m.value[known(d + r * n + c)] * m.inverse[known(s + c)] * m.x[known(s + c)]
        m.x[known(s + r)] = x
    for e in range(m.column[k], m.column[k + 1]):
        b = known(m.block[known(e)])
        i0 = known(m.row[known(e)])
        t = known(m.scalar[i0])
        for i in range(m.size[i0]):
            total = real(0.0)
            for r in range(n):
                total += m.value[known(b + i * n + r)] * m.inverse[known(s + r)] * m.x[known(s + r)]
            m.x[known(t + i)] -= total


@wp.func
def backward_node(m: BlockMatrix, k: int):
    """``x_k`` of the solution, from those of the later nodes."""
    n = known(m.size[k])
    d = known(m.diagonal[k])
    s = known(m.scalar[k])
    for e in range(m.column[k], m.column[k + 1]):
        b = known(m.block[known(e)])
        i0 = known(m.row[known(e)])
        t = known(m.scalar[i0])
        for i in range(m.size[i0]):
            x = m.x[known(t + i)]
            for r in range(n):
                m.x[known(s + r)] -= m.value[known(b + i * n + r)] * x
    for q in range(n):
        r = n - 1 - q
        x = m.x[known(s + r)]
        for i in range(r + 1, n):
            x -= m.value[known(d + i * n + r)] * m.x[known(s + i)]
        m.x[known(s + r)] = x * m.inverse[known(s + r)]


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
