"""What small gradients hide: the motion of whole bodies.

``|D_A^-1 g|`` of a block is what it alone would do. In a stiff body blocks cannot move alone, and the sum of gradients far
below the tolerance may still be a large part of its momentum: A has M for translations of a body, and D_A is thousands of
times as large. So the sum of g over each body that nothing holds, over its mass, must be below the tolerance as well.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components


class Drift:
    """Bodies of one pattern of A: blocks that it couples."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, left_out: np.ndarray) -> None:
        """``left_out`` (n,) bool: blocks whose body is not asked, since rows hold it."""
        n = len(indptr) - 1
        graph = sp.csr_array((np.ones(len(indices), dtype=np.int8), indices, indptr), shape=(n, n))
        count, label = connected_components(graph, directed=False)
        alone = np.bincount(label, minlength=count) < 3  # single points and rigid bodies: D_A is all of A
        alone[label[left_out]] = True
        self.label, self.count, self._alone = label, count, alone

    def take(self, a: sp.bsr_array, fixed: np.ndarray | None) -> None:
        """Masses of the bodies of A, ``masses`` (n,) [kg] by block, and sums; those with fixed blocks are not asked."""
        alone = self._alone.copy()
        if fixed is not None:
            alone[self.label[fixed]] = True
        blocks = np.flatnonzero(~alone[self.label])
        bodies, part = np.unique(self.label[blocks], return_inverse=True)
        shape = (len(bodies), len(self.label))
        self._sums = sp.csr_array((np.ones(len(blocks)), (part, blocks)), shape=shape)
        traces = np.einsum("eii->e", a.data) / 3.0
        row = np.add.reduceat(np.append(traces, 0.0), a.indptr[:-1]) * (np.diff(a.indptr) > 0)
        self._mass = self._sums @ row
        self.masses = np.maximum(np.bincount(self.label, row, minlength=self.count), 1e-300)[self.label]

    def speeds(self, g: np.ndarray) -> np.ndarray:
        """The mean velocities [m/s] that gradients g (n, 3) [N s] would still give to bodies."""
        if len(self._mass) == 0:
            return np.zeros(0)
        return np.linalg.norm(self._sums @ g, axis=1) / self._mass

    def blocks(self, speeds: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
        """Blocks of bodies whose speed is above ``least``, and that speed."""
        some = self._sums[np.flatnonzero(speeds > least)]
        return some.indices, np.repeat(speeds[speeds > least], np.diff(some.indptr))
