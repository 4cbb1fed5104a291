"""Implicit steps: ``(M - alpha h D - beta h^2 K) a = b`` with constraint rows, in one sparse symmetric-pattern system.

    [ A  -J^T ] [ a ]   [ b ]
    [ J   -e  ] [ f ] = [ g ]

f are the constraint forces in the directions of the rows. The acceleration moves the step's end by ``beta h^2 a``, so a row
that wants ``J x = target`` asks ``J a = (target - J x_free) / (beta h^2)``. ``e`` is zero, unless rows may contradict each
other (``conflicts="solve"``): then it is a tiny flexibility, which turns contradiction into least squares.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from turnbuckle.bodies.corotational_stiffness import corotational_jacobians
from turnbuckle.bodies.hinge_hessian import bends
from turnbuckle.bodies.stiffness import all_elements, jacobians
from turnbuckle.data.model import Model
from turnbuckle.data.rows import Rows
from turnbuckle.linalg.assembly import Pattern
from turnbuckle.linalg.factor import Factor
from turnbuckle.solvers.joint import JointSolver

ROOM = 0.25  # part of m / (beta h^2) that a turning element may take from the diagonal (see bodies/stiffness.py)


def agreed(rows: Rows, mass: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Point displacements that come as near to ``wanted`` (rows, 3) as rows allow (see `turnbuckle.solvers.joint`)."""
    solver = JointSolver(replace(rows, directions=None), mass)
    out = np.zeros((len(mass), 3))
    solver.spread(out, solver.solve(wanted)[0])
    return out


class ImplicitSolver:
    """Assembles and solves; keeps the sparsity pattern."""

    def __init__(self, model: Model) -> None:
        self.model = model
        s, t = model.springs, model.tetrahedra
        self.pattern = Pattern(
            [s.pairs, t.edges, t.triangles, t.corners, model.hinges.points, model.corotational.corners], model.points
        )

    def solve(
        self,
        h: float,
        alpha: float,
        beta: float,
        push: float,
        at: tuple[np.ndarray, np.ndarray],
        force: np.ndarray,
        free: np.ndarray,
        rows: Rows | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (points, 3) [m/s^2] and row forces (rows, 3) [N]; raises `LinAlgError` when singular.

        ``b = force + push h K v``; ``free`` are the positions that the step would end at with ``a = 0``.
        """
        x, v = at
        mass = np.where(self.model.mass > 0.0, self.model.mass, 1.0)  # points of rigid bodies are placed afterwards
        room = ROOM * mass / (beta * h * h)
        elements = [*all_elements(self.model, x), bends(self.model.hinges, x)]
        parts = [jacobians(e, v, room) for e in elements]
        parts.append(corotational_jacobians(self.model.corotational, x, room))
        a = self.pattern.matrix(np.repeat(mass, 3), [-alpha * h * d - beta * h * h * k for k, d in parts])
        b = force.ravel().copy()
        if push != 0.0:
            stiffness = self.pattern.matrix(np.zeros(3 * len(mass)), [k for k, _ in parts])
            b += push * h * (stiffness @ v.ravel())
        if rows is None or len(rows.target) == 0:
            return Factor(a).solve(b).reshape(-1, 3), np.zeros((0, 3))
        wanted = (rows.target - rows.weights @ free) / (beta * h * h)
        if (
            self.model.conflicts == "solve"
        ):  # what rows can agree on; e alone would answer a contradiction with a huge force
            wanted = rows.weights @ agreed(rows, mass, wanted)
        return self._with_rows(a, b, rows, wanted)

    def _with_rows(
        self, a: sp.csr_array, b: np.ndarray, rows: Rows, wanted: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        j = rows.jacobian()
        if rows.directions is None:
            g = wanted.ravel()
        else:
            g = np.einsum("nij,nj->ni", rows.directions, wanted).ravel()
        scale = float(np.median(np.abs(a.diagonal())))  # puts J beside A in size, so that pivoting sees no cliff
        n = len(g)
        flexibility = np.zeros(n)
        if self.model.conflicts == "solve":
            flexibility[:] = 1e-10 * scale
        if rows.directions is not None:  # directions that a row does not hold must not leave the system singular
            held = rows.directions
            free_part = sp.block_diag(list(np.eye(3) - held), format="csr") * scale
        else:
            free_part = sp.csr_array((n, n))
        js = (j * scale).tocsr()
        kkt = sp.block_array([[a, -js.T], [js, -sp.diags_array(flexibility) + free_part]], format="csr")
        solution = Factor(kkt).solve(np.r_[b, scale * g])
        return solution[: len(b)].reshape(-1, 3), scale * solution[len(b) :].reshape(-1, 3)
