"""``[M J^T; J 0] [dv; y] = [p; r]`` with dense matrices: what the block factor is held against."""

import numpy as np


class DenseSystem:
    """Bodies of 6 (two apart blocks of 3) or 3 columns, parts of some rows, each on some bodies."""

    def __init__(self, rng: np.random.Generator, body_size: np.ndarray, parts: list[np.ndarray], rows: np.ndarray):
        self.body_size, self.parts, self.rows = body_size, parts, rows
        self.at = np.r_[0, np.cumsum(body_size)]
        self.row_at = np.r_[0, np.cumsum(rows)]
        n, m = self.at[-1], self.row_at[-1]
        self.M, self.J = np.zeros((n, n)), np.zeros((m, n))
        for first in range(0, n, 3):
            root = rng.normal(size=(3, 3))
            self.M[first : first + 3, first : first + 3] = root @ root.T + np.eye(3)
        for p, bodies in enumerate(parts):
            for b in bodies:
                self.J[self.row_at[p] : self.row_at[p + 1], self.at[b] : self.at[b + 1]] = rng.normal(
                    size=(rows[p], body_size[b])
                )

    def repeat(self, first: int, again: int) -> None:
        """Part ``again`` (on the same bodies, as many rows) asks for the same as ``first``, in other words."""
        turn = np.linalg.qr(np.random.default_rng(again).normal(size=(self.rows[first],) * 2))[0]
        rows = slice(self.row_at[again], self.row_at[again + 1])
        self.J[rows] = turn @ self.J[self.row_at[first] : self.row_at[first + 1]]

    @property
    def rank(self) -> int:
        """Of all rows."""
        return int(np.linalg.matrix_rank(self.J, tol=1e-9))

    def scale(self) -> np.ndarray:
        """Of each row, its own ``J M^-1 J^T``."""
        return np.einsum("ij,ij->i", self.J, np.linalg.solve(self.M, self.J.T).T)

    def solve(self, push: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """dv, which is the same whichever of the repeated rows hold."""
        n, m = len(push), len(rate)
        whole = np.block([[self.M, self.J.T], [self.J, np.zeros((m, m))]])
        return np.linalg.lstsq(whole, np.r_[push, rate], rcond=1e-11)[0][:n]
