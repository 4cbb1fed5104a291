"""Sparse direct solution behind one interface: ``Factor(A).solve(b)``."""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla


class Factor:
    """LU factors of a square sparse matrix, with one step of iterative refinement in each solve.

    Raises `numpy.linalg.LinAlgError` when the matrix is singular or not finite.
    """

    def __init__(self, matrix: sp.csr_array) -> None:
        if not np.isfinite(matrix.data).all():
            raise np.linalg.LinAlgError("the matrix has entries that are not finite")
        self.matrix = matrix
        try:
            self._lu = spla.splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": False})
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from None

    def solve(self, b: np.ndarray) -> np.ndarray:
        """x with A x = b."""
        x = self._lu.solve(b)
        return x + self._lu.solve(b - self.matrix @ x)
