"""Constraints that share mass points, solved together on the explicit response ``c_i = c / m_i``.

``J dx = g`` with the least ``sum m_i |dx_i|^2``: ``dx = W J^T mu``, ``W = 1/m``. Where rows contradict each other or repeat,
rows are scaled by their own flexibility and taken in the sense of least squares through the singular values of
``J W^(1/2)``: exact where they agree, else the mass-weighted least correction.
"""

import numpy as np
import scipy.sparse.linalg as spla

from turnbuckle.data.rows import Rows

DENSE = 1500  # rows up to which singular values are computed; above, LSQR iterates to round-off
RANK = 1e-11  # singular values below this part of the largest count as zero


class JointSolver:
    """Factors of one set of rows; valid as long as the same rows act with the same weights."""

    def __init__(self, rows: Rows, mass: np.ndarray) -> None:
        self.directions = rows.directions
        self.spatial = rows.directions is not None  # rows over coordinates, not over points
        jacobian = rows.jacobian() if self.spatial else rows.weights
        used = np.unique(jacobian.indices)
        self.used = used
        self.j = jacobian[:, used]
        m = np.repeat(mass, 3)[used] if self.spatial else mass[used]
        self.root = 1.0 / np.sqrt(m)
        half = self.j.multiply(self.root[None, :]).tocsr()
        norm = np.sqrt(np.asarray(half.multiply(half).sum(axis=1)).ravel())
        self.row_scale = np.where(norm > 1e-9 * norm.max(initial=0.0), 1.0 / np.maximum(norm, 1e-300), 0.0)
        self.half = half.multiply(self.row_scale[:, None]).tocsr()
        self.dense = self.half.shape[0] <= DENSE
        if self.dense:
            u, s, vt = np.linalg.svd(self.half.toarray(), full_matrices=False)
            keep = s > RANK * max(s[0] if len(s) else 0.0, 1e-300)
            self.u, self.s, self.vt = u[:, keep], s[keep], vt[keep]

    def solve(self, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``(dx, mu)`` with ``J dx = gap``, gap (rows, 3): dx at `used` points, mu (rows, 3) with ``m dx = J^T mu``."""
        g = gap
        if self.directions is not None:  # what a row does not hold, it does not ask for
            g = np.einsum("nij,nj->ni", self.directions, gap).reshape(-1, 1)
        dx = np.zeros((len(self.used), g.shape[1]))
        mu = np.zeros_like(g)
        for _ in range(2):  # the second pass takes out the round-off of the first
            y, part = self._least(self.row_scale[:, None] * (g - self.j @ dx))
            dx += self.root[:, None] * y
            mu += self.row_scale[:, None] * part
        return dx, mu.reshape(-1, 3)

    def _least(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.dense:
            coefficients = (self.u.T @ g) / self.s[:, None]
            return self.vt.T @ coefficients, self.u @ (coefficients / self.s[:, None])
        y = np.stack([spla.lsqr(self.half, c, atol=1e-15, btol=1e-15, iter_lim=20000)[0] for c in g.T], axis=1)
        mu = np.stack([spla.lsqr(self.half.T, c, atol=1e-15, btol=1e-15, iter_lim=20000)[0] for c in y.T], axis=1)
        return y, mu

    def spread(self, values: np.ndarray, dx: np.ndarray, factor: float = 1.0) -> None:
        """Add ``factor dx`` to the rows of ``values`` (points, 3) in place."""
        if self.spatial:
            values.reshape(-1)[self.used] += factor * dx[:, 0]
        else:
            values[self.used] += factor * dx
