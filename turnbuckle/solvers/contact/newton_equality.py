"""Equality rows in the Newton solver: kept exactly, by projecting all that conjugate gradients see.

With L = D_A^-1, the inverse of the diagonal of A, and ``S = E L E^T``, ``P = 1 - L E^T S^-1 E`` projects velocities on the null
space of E, and its transpose takes out of a gradient what impulses of the rows can be. Conjugate gradients with gradients
``P^T g``, products ``P^T A p`` and the preconditioner ``P M P^T`` solve the problem on that space. S knows no contacts, so it is
factored once for a problem, whatever M becomes.
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
        self.local = self._inverse(problem)
        self.l_et = (self.local @ self.e.T).tocsc()
        self.l_et_t = self.l_et.T.tocsr()
        self.impulse = np.zeros(len(self.wanted))
        s = (self.e @ self.l_et).tocsc()
        s = s + sp.diags_array(SLIGHT * s.diagonal() + 1e-300)
        self.s = spla.splu(
            s.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

    def _inverse(self, problem: ContactProblem) -> sp.csr_array:
        """D_A^-1: the metric in which velocities are put on the rows."""
        n, a = self.blocks, problem.a
        own = diagonal_blocks(a.data, a.indptr, a.indices)
        return sp.bsr_array((np.linalg.inv(own), np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()

    def meet(self) -> None:
        """Put the velocities of the buffers on the rows."""
        v = self.buffers.read("v", self.blocks).ravel()
        for _ in range(2):
            v = v + self.l_et @ self.s.solve(self.wanted - self.full @ v)
        self.buffers.write("v", v.reshape(-1, 3))

    def remove(self) -> float:
        """Take the rows' own impulses out of the gradient; the largest ``|D_A^-1 g|`` left [m/s]."""
        self.impulse = self._taken("g") + self._taken("g")  # twice, for all digits
        g = self.buffers.read("g", self.blocks).ravel()
        return float(np.linalg.norm((self.local @ g).reshape(-1, 3), axis=1).max(initial=0.0))

    def take_out(self) -> None:
        """q <- P^T q, in the buffers."""
        self._taken("q")

    def project(self) -> None:
        """z <- P z, in the buffers."""
        z = self.buffers.read("z", self.blocks).ravel()
        z = z - self.l_et @ self.s.solve(self.e @ z)
        self.buffers.write("z", z.reshape(-1, 3))

    def _taken(self, name: str) -> np.ndarray:
        """Take impulses of the rows (k,) out of forces, which are in the buffers; what they were."""
        force = self.buffers.read(name, self.blocks).ravel()
        impulse = self.s.solve(self.l_et_t @ force)
        self.buffers.write(name, (force - self.e.T @ impulse).reshape(-1, 3))
        return impulse
