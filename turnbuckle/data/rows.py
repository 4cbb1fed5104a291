"""Rows: what constraints ask of a step, as plain data over mass points."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


@dataclass
class Rows:
    """Vector rows: row r asks ``P_r (sum_k w_rk x_k) = P_r target_r``, with P_r the projector on its held directions."""

    weights: sp.csr_array  # (rows, points)
    target: np.ndarray  # (rows, 3) [m]
    rate: np.ndarray  # (rows, 3) [m/s], wanted of the same sums of velocities at the end of the step
    mean_rate: np.ndarray  # (rows, 3) [m/s], over the step
    acceleration: np.ndarray  # (rows, 3) [m/s^2]
    directions: np.ndarray | None  # (rows, 3, 3), None when every row holds all three
    kind: np.ndarray  # (rows,) int, place of the table in Tables.by_kind()
    row: np.ndarray  # (rows,) int, row of that table
    point: np.ndarray  # (rows,) int: 0, or for points to point which of its points the row ties to the first

    def jacobian(self) -> sp.csr_array:
        """The scalar rows, (3 rows, 3 points): ``P_r (w_r (x) I)``."""
        j = sp.kron(self.weights, sp.eye_array(3), format="csr")
        if self.directions is None:
            return j
        return (sp.block_diag(list(self.directions), format="csr") @ j).tocsr()
