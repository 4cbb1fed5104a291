"""Cholesky factors of many small diagonal parts of one block-sparse matrix, one part a thread (Jennings 1966).

A part is a set of blocks that the matrix couples to nothing else, a small soft body for instance. Its rows are ordered by
reverse Cuthill and McKee and stored from their first entry to the diagonal: there is no fill outside, and every inner
loop runs over contiguous numbers.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import warp as wp
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)
F64 = wp.array(dtype=wp.float64)
SMALLEST, LARGEST = 2, 250  # blocks of a part that is factored


@dataclass
class Parts:
    """The plan of all parts, host arrays."""

    nodes: np.ndarray  # blocks of the matrix, part after part, in the order of elimination
    offsets: np.ndarray  # (parts + 1,) into `nodes`
    lead: np.ndarray  # (nodes,) first block of each row, as a place in `nodes`
    start: np.ndarray  # (nodes,) where the three rows of each block begin among the numbers
    numbers: int
    local: np.ndarray  # (n,) place in `nodes` of each block of the matrix, -1 for those in no part

    @property
    def count(self) -> int:
        """Parts."""
        return len(self.offsets) - 1


def find_parts(indptr: np.ndarray, indices: np.ndarray, left_out: np.ndarray) -> Parts:
    """Parts of a symmetric block pattern; ``left_out`` (n,) bool: blocks whose part is not wanted."""
    n = len(indptr) - 1
    graph = sp.csr_matrix((np.ones(len(indices), dtype=np.int8), indices, indptr), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    size = np.bincount(label, minlength=count)
    wanted = (size >= SMALLEST) & (size <= LARGEST)
    wanted[label[left_out]] = False
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    order = order[wanted[label[order]]]
    nodes = order[np.argsort(label[order], kind="stable")].astype(np.int32)
    local = np.full(n, -1, dtype=np.int32)
    local[nodes] = np.arange(len(nodes))
    cuts = np.flatnonzero(np.diff(label[nodes])) + 1 if len(nodes) else np.zeros(0, int)
    offsets = np.concatenate([[0], cuts, [len(nodes)]]) if len(nodes) else np.zeros(1, int)
    lead = np.arange(len(nodes))
    if len(nodes):
        row = np.repeat(np.arange(n), np.diff(indptr))
        inside = local[row] >= 0
        np.minimum.at(lead, local[row[inside]], local[indices[inside]])
    width = 3 * (np.arange(len(nodes)) - lead)
    lengths = 3 * width + 6  # rows of width + 1, + 2, + 3
    start = np.cumsum(lengths) - lengths
    return Parts(
        nodes, offsets.astype(np.int32), lead.astype(np.int32), start.astype(np.int32), int(lengths.sum()), local
    )


@wp.func_native(
    """
    double* l = number.data;
    const double* aa = (const double*)a.data;
    // row s = 3 i + k of block i begins at start[i] + k width + k (k - 1) / 2 + k, its first column is 3 lead[i]
    for (int i = first; i < last; ++i) {
        const int width = 3 * (i - lead.data[i]);
        double* row = l + start.data[i];
        for (int q = 0; q < 3 * width + 6; ++q) row[q] = 0.0;
        const int block = nodes.data[i];
        if (fixed.data[block]) {
            row[width] = row[2 * width + 2] = row[3 * width + 5] = 1.0;
            continue;
        }
        for (int e = starts.data[block]; e < starts.data[block + 1]; ++e) {
            const int j = local.data[others.data[e]];
            if (j < first || j > i || fixed.data[others.data[e]]) continue;
            const double* b = j == i ? (const double*)diagonal.data + 9 * (size_t)block : aa + 9 * (size_t)e;
            const int at = 3 * (j - lead.data[i]);
            for (int k = 0; k < 3; ++k)
                for (int c = 0; c < 3 && (j < i || c <= k); ++c) row[k * width + k * (k + 1) / 2 + at + c] = b[3 * k + c];
        }
        for (int k = 0; k < 3; ++k) {
            double* own = row + k * width + k * (k + 1) / 2;
            const int begin = 3 * lead.data[i], end = 3 * i + k;
            double diagonal = own[end - begin];
            for (int c = begin; c < end; ++c) {
                const int j = c / 3, m = c - 3 * j;
                const int from = 3 * lead.data[j], w = 3 * (j - lead.data[j]);
                const double* other = l + start.data[j] + m * w + m * (m + 1) / 2;
                const int low = from > begin ? from : begin, n = c - low;
                const double *p = own + (low - begin), *q = other + (low - from);
                double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
                int t = 0;
                for (; t + 3 < n; t += 4) {
                    s0 += p[t] * q[t]; s1 += p[t + 1] * q[t + 1]; s2 += p[t + 2] * q[t + 2]; s3 += p[t + 3] * q[t + 3];
                }
                for (; t < n; ++t) s0 += p[t] * q[t];
                const double value = (own[c - begin] - ((s0 + s1) + (s2 + s3))) * other[c - from];  // its diagonal is inverted
                own[c - begin] = value;
                diagonal -= value * value;
            }
            own[end - begin] = diagonal > 0.0 ? 1.0 / sqrt(diagonal) : 0.0;
        }
    }
"""
)
def factor_part(first: int, last: int, nodes: I32, lead: I32, start: I32, local: I32, starts: I32, others: I32,
                a: wp.array(dtype=wp.mat33d), diagonal: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
                number: F64): ...  # fmt: skip


@wp.func_native(
    """
    const double* l = number.data;
    const double* rr = (const double*)r.data;
    double* zz = (double*)z_out.data;
    double* y = work.data + 3 * (size_t)first;
    const int shift = 3 * first;
    for (int i = first; i < last; ++i) {
        const int width = 3 * (i - lead.data[i]), begin = 3 * lead.data[i];
        const double* row = l + start.data[i];
        const double* given = rr + 3 * (size_t)nodes.data[i];
        for (int k = 0; k < 3; ++k) {
            const double* own = row + k * width + k * (k + 1) / 2;
            const double* p = y + (begin - shift);
            const int n = width + k;
            double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
            int t = 0;
            for (; t + 3 < n; t += 4) {
                s0 += p[t] * own[t]; s1 += p[t + 1] * own[t + 1]; s2 += p[t + 2] * own[t + 2]; s3 += p[t + 3] * own[t + 3];
            }
            for (; t < n; ++t) s0 += p[t] * own[t];
            y[3 * i + k - shift] = (given[k] - ((s0 + s1) + (s2 + s3))) * own[n];
        }
    }
    for (int i = last - 1; i >= first; --i) {
        const int width = 3 * (i - lead.data[i]), begin = 3 * lead.data[i];
        const double* row = l + start.data[i];
        for (int k = 2; k >= 0; --k) {
            const double* own = row + k * width + k * (k + 1) / 2;
            const int n = width + k;
            const double z = y[3 * i + k - shift] * own[n];
            y[3 * i + k - shift] = z;
            double* p = y + (begin - shift);
            for (int t = 0; t < n; ++t) p[t] -= own[t] * z;
        }
        const int block = nodes.data[i];
        for (int k = 0; k < 3; ++k) zz[3 * (size_t)block + k] = fixed.data[block] ? 0.0 : y[3 * i + k - shift];
    }
"""
)
def solve_part(first: int, last: int, nodes: I32, lead: I32, start: I32, number: F64, fixed: wp.array(dtype=wp.uint8),
               r: wp.array(dtype=wp.vec3d), work: F64, z_out: wp.array(dtype=wp.vec3d)): ...  # fmt: skip


@wp.kernel
def factor_parts(begin: int, offsets: I32, nodes: I32, lead: I32, start: I32, local: I32, starts: I32, others: I32,
                 a: wp.array(dtype=wp.mat33d), diagonal: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
                 number: F64):  # fmt: skip
    """L of each part, its diagonal inverted; ``fixed`` blocks are those of the identity.

    ``diagonal`` (n,) stands for the diagonal blocks of ``a``, and may be more.
    """
    part = begin + wp.tid()
    factor_part(offsets[part], offsets[part + 1], nodes, lead, start, local, starts, others, a, diagonal, fixed, number)


@wp.kernel
def solve_parts(begin: int, offsets: I32, nodes: I32, lead: I32, start: I32, number: F64,
                fixed: wp.array(dtype=wp.uint8), r: wp.array(dtype=wp.vec3d), work: F64, stop: F64, at: int,
                z_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """z = (L L^T)^-1 r of each part, unless ``stop[at]``; zero in ``fixed`` blocks, nothing written outside of parts."""
    part = begin + wp.tid()
    if stop[at] != real(0.0):
        return
    solve_part(offsets[part], offsets[part + 1], nodes, lead, start, number, fixed, r, work, z_out)


class SkylineFactors:
    """Parts on a device: inputs for both kernels."""

    def __init__(self, parts: Parts, device: str) -> None:
        self.parts = parts

        def put(values: np.ndarray) -> wp.array:
            return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.int32, device=device)

        self.offsets, self.nodes, self.lead = put(parts.offsets), put(parts.nodes), put(parts.lead)
        self.start, self.local = put(parts.start), put(parts.local)
        self.number = wp.zeros(max(parts.numbers, 1), dtype=real, device=device)
        self.work = wp.zeros(max(3 * len(parts.nodes), 1), dtype=real, device=device)

    def factor_inputs(
        self, starts: wp.array, others: wp.array, a: wp.array, diagonal: wp.array, fixed: wp.array
    ) -> list:
        """Of `factor_parts`."""
        given = [starts, others, a, diagonal, fixed]
        return [self.offsets, self.nodes, self.lead, self.start, self.local, *given, self.number]

    def solve_inputs(self, fixed: wp.array, r: wp.array, z: wp.array, stop: wp.array, at: int = 0) -> list:
        """Of `solve_parts`, which does nothing where ``stop[at]`` is not zero."""
        return [self.offsets, self.nodes, self.lead, self.start, self.number, fixed, r, self.work, stop, at, z]
