"""The block diagonal D_A of the discretised dynamics and what contacts see of it (Contact, (9), (10)).

Blocks are 3 x 3 of points and 6 x 6 of rigid bodies. Fixed blocks have no response: their part of ``D_A^-1`` is zero.
"""

import numpy as np
import scipy.sparse as sp

from turnbuckle.data.contact import ContactProblem


def block_rows(matrix: sp.bsr_array) -> np.ndarray:
    """Block row of each stored block."""
    return np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))


def partners(problem: ContactProblem) -> np.ndarray:
    """(n,) the other block of each block's rigid body, or the block itself. Half-fixed bodies count as two."""
    n = len(problem.free) // 3
    other = np.arange(n)
    first = np.asarray(problem.pairs, dtype=int)
    if problem.fixed is not None:
        first = first[~problem.fixed[first] & ~problem.fixed[first + 1]]
    other[first], other[first + 1] = first + 1, first
    return other


def inverse_diagonal(problem: ContactProblem) -> sp.bsr_array:
    """``D_A^-1`` [1/kg], (3 n, 3 n)."""
    a, other = problem.a, partners(problem)
    n = len(other)
    row, column = block_rows(a), a.indices
    own, cross = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))  # A_kk; A_k,partner
    diagonal = column == row
    np.add.at(own, row[diagonal], a.data[diagonal])
    beside = (column == other[row]) & ~diagonal
    np.add.at(cross, row[beside], a.data[beside])
    inverse, inverse_cross = np.linalg.inv(own), np.zeros((n, 3, 3))
    first = np.flatnonzero(other > np.arange(n))
    if len(first):
        whole = np.block([[own[first], cross[first]], [cross[first + 1], own[first + 1]]])
        whole = np.linalg.inv(whole)
        inverse[first], inverse[first + 1] = whole[:, :3, :3], whole[:, 3:, 3:]
        inverse_cross[first], inverse_cross[first + 1] = whole[:, :3, 3:], whole[:, 3:, :3]
    if problem.fixed is not None:
        inverse[problem.fixed] = 0.0
    paired = np.flatnonzero(other != np.arange(n))
    rows = np.concatenate([np.arange(n), paired])
    columns = np.concatenate([np.arange(n), other[paired]])
    order = np.argsort(rows * n + columns)
    start = np.searchsorted(rows[order], np.arange(n + 1))
    data = np.concatenate([inverse, inverse_cross[paired]])[order]
    return sp.bsr_array((data, columns[order], start), shape=a.shape)


def contact_blocks(j: sp.bsr_array, response: sp.bsr_array) -> np.ndarray:
    """Diagonal blocks ``J_i D^-1 J_i^T`` (m, 3, 3) [1/kg] of the anticipation, for J and J D^-1."""
    j = on_pattern(j, response)
    each = np.einsum("bik,bjk->bij", response.data, j.data)
    total = np.zeros((response.shape[0] // 3, 3, 3))
    filled = np.flatnonzero(np.diff(response.indptr))
    if len(filled):
        total[filled] = np.add.reduceat(each, response.indptr[filled], axis=0)
    return total


def on_pattern(matrix: sp.bsr_array, pattern: sp.bsr_array) -> sp.bsr_array:
    """The matrix stored on the pattern of another, which has sorted indices and every block that is not zero."""
    n = pattern.shape[1] // 3
    keys = block_rows(pattern) * n + pattern.indices
    own = block_rows(matrix) * n + matrix.indices
    place = np.minimum(np.searchsorted(keys, own), max(len(keys) - 1, 0))
    there = keys[place] == own if len(keys) else np.zeros(len(own), bool)
    data = np.zeros((len(keys), 3, 3))
    place, blocks = place[there], matrix.data[there]
    if len(np.unique(place)) == len(place):
        data[place] = blocks
    else:
        np.add.at(data, place, blocks)
    return sp.bsr_array((data, pattern.indices, pattern.indptr), shape=pattern.shape)
