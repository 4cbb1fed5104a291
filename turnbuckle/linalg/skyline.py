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
F32 = wp.array(dtype=wp.float32)
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

    @property
    def part(self) -> np.ndarray:
        """(n,) the part of each block of the matrix, -1 for those in none."""
        return np.where(self.local >= 0, np.searchsorted(self.offsets, self.local, side="right") - 1, -1)


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
    lengths = 3 * (width + 3)
    start = np.cumsum(lengths) - lengths
    return Parts(
        nodes, offsets.astype(np.int32), lead.astype(np.int32), start.astype(np.int32), int(lengths.sum()), local
    )


@wp.func_native(
    """
    // With s = width + 3, row k of block i is number[start[i] + k s ...], and its first column is 3 lead[i]. Of diagonal
    // blocks the lower triangle counts, and its diagonal is inverted. Products run in four lanes, so that they fill the
    // registers of a processor.
    double* l = number.data;
    const double* aa = (const double*)a.data;
    for (int i = first; i < last; ++i) {
        const int width = 3 * (i - lead.data[i]), s = width + 3;
        double* row = l + start.data[i];
        for (int q = 0; q < 3 * s; ++q) row[q] = 0.0;
        const int block = nodes.data[i];
        if (fixed.data[block]) {
            for (int k = 0; k < 3; ++k) row[k * s + width + k] = 1.0;
        } else {
            for (int e = starts.data[block]; e < starts.data[block + 1]; ++e) {
                const int j = local.data[others.data[e]];
                if (j < first || j > i || fixed.data[others.data[e]]) continue;
                const double* b = j == i ? (const double*)diagonal.data + 9 * (size_t)block : aa + 9 * (size_t)e;
                for (int k = 0; k < 3; ++k)
                    for (int c = 0; c < 3; ++c) row[k * s + 3 * (j - lead.data[i]) + c] = b[3 * k + c];
            }
            for (int j = lead.data[i]; j <= i; ++j) {
                const int wide = 3 * (j - lead.data[j]), t = wide + 3;
                const int low = lead.data[i] > lead.data[j] ? lead.data[i] : lead.data[j], n = 3 * (j - low);
                const double *p0 = row + 3 * (low - lead.data[i]), *p1 = p0 + s, *p2 = p1 + s;
                const double *q0 = l + start.data[j] + 3 * (low - lead.data[j]), *q1 = q0 + t, *q2 = q1 + t;
                double d[9][4] = {};
                int c = 0;
                for (; c + 3 < n; c += 4)
                    for (int k = 0; k < 4; ++k) {
                        d[0][k] += p0[c + k] * q0[c + k]; d[1][k] += p0[c + k] * q1[c + k]; d[2][k] += p0[c + k] * q2[c + k];
                        d[3][k] += p1[c + k] * q0[c + k]; d[4][k] += p1[c + k] * q1[c + k]; d[5][k] += p1[c + k] * q2[c + k];
                        d[6][k] += p2[c + k] * q0[c + k]; d[7][k] += p2[c + k] * q1[c + k]; d[8][k] += p2[c + k] * q2[c + k];
                    }
                for (; c < n; ++c) {
                    d[0][0] += p0[c] * q0[c]; d[1][0] += p0[c] * q1[c]; d[2][0] += p0[c] * q2[c];
                    d[3][0] += p1[c] * q0[c]; d[4][0] += p1[c] * q1[c]; d[5][0] += p1[c] * q2[c];
                    d[6][0] += p2[c] * q0[c]; d[7][0] += p2[c] * q1[c]; d[8][0] += p2[c] * q2[c];
                }
                double* x = row + 3 * (j - lead.data[i]);
                for (int k = 0; k < 3; ++k)
                    for (int m = 0; m < 3; ++m) {
                        const double* sum = d[3 * k + m];
                        x[k * s + m] -= (sum[0] + sum[1]) + (sum[2] + sum[3]);
                    }
                const double* o = j < i ? l + start.data[j] + wide : x;  // the diagonal block of j
                for (int k = 0; k < 3; ++k)
                    for (int m = 0; m < 3; ++m) {
                        double value = x[k * s + m];
                        if (j == i && m > k) { x[k * s + m] = 0.0; continue; }
                        for (int r = 0; r < m; ++r) value -= x[k * s + r] * o[m * t + r];
                        if (j == i && m == k) x[k * s + m] = value > 0.0 ? 1.0 / sqrt(value) : 0.0;
                        else x[k * s + m] = value * o[m * t + m];
                    }
            }
        }
        float* light = light_out.data + start.data[i];
        for (int q = 0; q < 3 * s; ++q) light[q] = (float)row[q];
    }
"""
)
def factor_part(first: int, last: int, nodes: I32, lead: I32, start: I32, local: I32, starts: I32, others: I32,
                a: wp.array(dtype=wp.mat33d), diagonal: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
                number: F64, light_out: F32): ...  # fmt: skip


@wp.func_native(
    """
    const double* rr = (const double*)r.data;
    double* zz = (double*)z_out.data;
    double* y = work.data;  // of all parts, in the order of nodes
    for (int i = first; i < last; ++i) {
        const int width = 3 * (i - lead.data[i]), s = width + 3;
        const float *r0 = light.data + start.data[i], *r1 = r0 + s, *r2 = r1 + s;
        const double* p = y + 3 * (size_t)lead.data[i];
        double d0[8] = {}, d1[8] = {}, d2[8] = {};
        int t = 0;
        for (; t + 7 < width; t += 8)
            for (int k = 0; k < 8; ++k) {
                d0[k] += p[t + k] * r0[t + k]; d1[k] += p[t + k] * r1[t + k]; d2[k] += p[t + k] * r2[t + k];
            }
        for (; t < width; ++t) { d0[0] += p[t] * r0[t]; d1[0] += p[t] * r1[t]; d2[0] += p[t] * r2[t]; }
        const double* given = rr + 3 * (size_t)nodes.data[i];
        double* own = y + 3 * (size_t)i;
        own[0] = (given[0] - (((d0[0] + d0[1]) + (d0[2] + d0[3])) + ((d0[4] + d0[5]) + (d0[6] + d0[7])))) * r0[width];
        own[1] = (given[1] - (((d1[0] + d1[1]) + (d1[2] + d1[3])) + ((d1[4] + d1[5]) + (d1[6] + d1[7])))
                  - own[0] * r1[width]) * r1[width + 1];
        own[2] = (given[2] - (((d2[0] + d2[1]) + (d2[2] + d2[3])) + ((d2[4] + d2[5]) + (d2[6] + d2[7])))
                  - own[0] * r2[width] - own[1] * r2[width + 1]) * r2[width + 2];
    }
    for (int i = last - 1; i >= first; --i) {
        const int width = 3 * (i - lead.data[i]), s = width + 3;
        const float *r0 = light.data + start.data[i], *r1 = r0 + s, *r2 = r1 + s;
        double* own = y + 3 * (size_t)i;
        const double z2 = own[2] * r2[width + 2];
        const double z1 = (own[1] - r2[width + 1] * z2) * r1[width + 1];
        const double z0 = (own[0] - r1[width] * z1 - r2[width] * z2) * r0[width];
        double* __restrict p = y + 3 * (size_t)lead.data[i];
        for (int t = 0; t < width; ++t) p[t] -= z0 * r0[t] + z1 * r1[t] + z2 * r2[t];
        const int block = nodes.data[i];
        const bool held = fixed.data[block];
        double* z = zz + 3 * (size_t)block;
        z[0] = held ? 0.0 : z0; z[1] = held ? 0.0 : z1; z[2] = held ? 0.0 : z2;
    }
"""
)
def solve_part(first: int, last: int, nodes: I32, lead: I32, start: I32, light: F32, fixed: wp.array(dtype=wp.uint8),
               r: wp.array(dtype=wp.vec3d), work: F64, z_out: wp.array(dtype=wp.vec3d)): ...  # fmt: skip


@wp.kernel
def factor_parts(begin: int, count: I32, of: int, which: I32, offsets: I32, nodes: I32, lead: I32, start: I32, local: I32, starts: I32, others: I32,
                 a: wp.array(dtype=wp.mat33d), diagonal: wp.array(dtype=wp.mat33d), fixed: wp.array(dtype=wp.uint8),
                 number: F64, light_out: F32):  # fmt: skip
    """L of each part, its diagonal inverted, and a copy in single precision; ``fixed`` blocks are those of the identity.

    ``diagonal`` (n,) stands for the diagonal blocks of ``a``, and may be more. Parts are the first ``count[of]`` of ``which``.
    """
    item = begin + wp.tid()
    if item >= count[of]:
        return
    part = which[item]
    factor_part(offsets[part], offsets[part + 1], nodes, lead, start, local, starts, others, a, diagonal, fixed, number,
                light_out)  # fmt: skip


@wp.kernel
def solve_parts(begin: int, count: I32, of: int, which: I32, offsets: I32, nodes: I32, lead: I32, start: I32, light: F32,
                fixed: wp.array(dtype=wp.uint8), r: wp.array(dtype=wp.vec3d), work: F64, stop: F64, at: int,
                z_out: wp.array(dtype=wp.vec3d)):  # fmt: skip
    """z = (L L^T)^-1 r of each part, unless ``stop[at]``; zero in ``fixed`` blocks, nothing written outside of parts.

    L is taken in single precision: as a preconditioner it is as good, and the time is that of reading it.
    """
    item = begin + wp.tid()
    if stop[at] != real(0.0) or item >= count[of]:
        return
    part = which[item]
    solve_part(offsets[part], offsets[part + 1], nodes, lead, start, light, fixed, r, work, z_out)


class SkylineFactors:
    """Parts on a device: inputs for both kernels."""

    def __init__(self, parts: Parts, device: str) -> None:
        self.parts = parts

        def put(values: np.ndarray) -> wp.array:
            return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.int32, device=device)

        self.every = put(np.array([parts.count])), 0, put(np.arange(parts.count))
        self.offsets, self.nodes, self.lead = put(parts.offsets), put(parts.nodes), put(parts.lead)
        self.start, self.local = put(parts.start), put(parts.local)
        self.number = wp.zeros(max(parts.numbers, 1), dtype=real, device=device)
        self.light = wp.zeros(max(parts.numbers, 1), dtype=wp.float32, device=device)
        self.work = wp.zeros(max(3 * len(parts.nodes), 1), dtype=real, device=device)

    def factor_inputs(
        self,
        starts: wp.array,
        others: wp.array,
        a: wp.array,
        diagonal: wp.array,
        fixed: wp.array,
        some: tuple | None = None,
    ) -> list:
        """Of `factor_parts`; ``some``: an array of counts, which of them it is, and numbers of parts. All parts by default."""
        given = [starts, others, a, diagonal, fixed]
        return [
            *(some or self.every),
            self.offsets,
            self.nodes,
            self.lead,
            self.start,
            self.local,
            *given,
            self.number,
            self.light,
        ]

    def solve_inputs(
        self, fixed: wp.array, r: wp.array, z: wp.array, stop: wp.array, at: int = 0, some: tuple | None = None
    ) -> list:
        """Of `solve_parts`, which does nothing where ``stop[at]`` is not zero; ``some`` as of `factor_inputs`."""
        return [
            *(some or self.every),
            self.offsets,
            self.nodes,
            self.lead,
            self.start,
            self.light,
            fixed,
            r,
            self.work,
            stop,
            at,
            z,
        ]
