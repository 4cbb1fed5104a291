"""Equality rows in the Newton solver: kept exactly, by projecting the preconditioned residual.

With M the block preconditioner and ``S = E M E^T``, ``z <- z - M E^T S^-1 E z`` stays in the null space of E, and
conjugate gradients with it solve the problem on that space.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from turnbuckle.data.contact import ContactProblem
from turnbuckle.linalg.block_matrix import diagonal_blocks
from turnbuckle.solvers.contact.newton_buffers import Buffers

SLIGHT = 1e-12  # of the diagonal of S: what keeps rows that repeat each other solvable


class EqualityRows:
    """``E v = wanted`` of one problem."""

    def __init__(self, problem: ContactProblem, buffers: Buffers) -> None:
        assert problem.e is not None
        self.buffers = buffers
        self.blocks = len(problem.free) // 3
        free = np.ones(self.blocks) if problem.fixed is None else (~problem.fixed).astype(float)
        self.full = problem.e.tocsr()
        self.e = (self.full @ sp.diags_array(np.repeat(free, 3))).tocsr()
        self.wanted = problem.wanted
        self.pairs = problem.pairs
        self.local = self._inverse(problem)
        self.impulse = np.zeros(len(self.wanted))
        self._factor(self.local)

    def _inverse(self, problem: ContactProblem) -> sp.csr_array:
        """D_A^-1: the metric in which velocities are first put on the rows."""
        n, a = self.blocks, problem.a
        own = diagonal_blocks(a.data, a.indptr, a.indices)
        return sp.bsr_array((np.linalg.inv(own), np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()

    def _factor(self, m: sp.csr_array) -> None:
        self.m_et = (m @ self.e.T).tocsc()
        s = (self.e @ self.m_et).tocsc()
        s = s + sp.diags_array(SLIGHT * s.diagonal() + 1e-300)
        self.s = spla.splu(
            s.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

    def meet(self) -> None:
        """Put the velocities of the buffers on the rows."""
        v = self.buffers.read("v", self.blocks).ravel()
        for _ in range(2):
            v = v + self.m_et @ self.s.solve(self.wanted - self.full @ v)
        self.buffers.write("v", v.reshape(-1, 3))

    def remove(self) -> float:
        """Take the rows' own impulses out of the gradient; the largest ``|D_A^-1 g|`` left [m/s]. Renews M."""
        b, n = self.buffers, self.blocks
        indices = np.arange(n, dtype=np.int32)
        m = sp.bsr_array((b.read("m", n), indices, np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()
        if len(self.pairs):
            both = np.concatenate([self.pairs, self.pairs + 1])
            other = np.concatenate([self.pairs + 1, self.pairs])
            order = np.argsort(both)
            starts = np.searchsorted(both[order], np.arange(n + 1))
            m = m + sp.bsr_array((b.read("n", n)[both[order]], other[order], starts), shape=(3 * n, 3 * n)).tocsr()
        self._factor(m)
        g = b.read("g", n).ravel()
        self.impulse = self.s.solve(self.m_et.T @ g)
        g = g - self.e.T @ self.impulse
        more = self.s.solve(self.m_et.T @ g)
        self.impulse = self.impulse + more
        g = g - self.e.T @ more
        b.write("g", g.reshape(-1, 3))
        return float(np.linalg.norm((self.local @ g).reshape(-1, 3), axis=1).max(initial=0.0))

    def project(self) -> None:
        """z <- z - M E^T S^-1 E z, in the buffers."""
        b, n = self.buffers, self.blocks
        z = b.read("z", n).ravel()
        z = z - self.m_et @ self.s.solve(self.e @ z)
        b.write("z", z.reshape(-1, 3))
