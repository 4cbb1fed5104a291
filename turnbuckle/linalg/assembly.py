"""Sparse matrices from element blocks: the pattern is found once, values are summed in a fixed order every step."""

import numpy as np
import scipy.sparse as sp


class Pattern:
    """Where the entries of element blocks go.

    ``points``: for each kind of element an array (n, p) of point numbers; its blocks are (n, 3p, 3p).
    """

    def __init__(self, points: list[np.ndarray], size: int) -> None:
        self.size = 3 * size
        rows, columns = [np.arange(self.size)], [np.arange(self.size)]  # the diagonal is always there
        for p in points:
            unknowns = (3 * p[:, :, None] + np.arange(3)).reshape(len(p), 3 * p.shape[1])
            rows.append(np.repeat(unknowns, unknowns.shape[1], axis=1).ravel())
            columns.append(np.tile(unknowns, (1, unknowns.shape[1])).ravel())
        r, c = np.concatenate(rows).astype(np.int64), np.concatenate(columns).astype(np.int64)
        key = r * self.size + c
        self._order = np.argsort(key, kind="stable")
        ordered = key[self._order]
        self._starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
        unique = ordered[self._starts]
        self._indices = (unique % self.size).astype(np.int32)
        self._indptr = np.searchsorted(unique // self.size, np.arange(self.size + 1)).astype(np.int32)

    def matrix(self, diagonal: np.ndarray, blocks: list[np.ndarray]) -> sp.csr_array:
        """``diag(diagonal) + sum of blocks``; ``diagonal`` (3 size,), ``blocks`` as the points of the constructor."""
        values = np.concatenate([diagonal, *(b.reshape(-1) for b in blocks)])
        data = np.add.reduceat(values[self._order], self._starts)
        return sp.csr_array((data, self._indices, self._indptr), shape=(self.size, self.size))
