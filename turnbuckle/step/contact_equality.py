"""Equality rows beside contact: what point constraints and joints ask of the velocities of a step."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from turnbuckle.constraints import rows as constraint_rows
from turnbuckle.data.rows import Rows
from turnbuckle.data.state import State
from turnbuckle.step.contact_rows import PointMap


@dataclass
class Equalities:
    """Rows ``E v = wanted`` over blocks, and nails, which are no rows but prescribed blocks."""

    nails: Rows | None
    rows: Rows | None
    e: sp.csr_array | None = None
    wanted: np.ndarray | None = None


def split(state: State, h: float, body_of: np.ndarray) -> Equalities:
    """The rows of all point constraints of the step; those that hold one mass point alone are nails."""
    if not any(g.acting for g in state.groups.values()):
        return Equalities(None, None)
    rows = constraint_rows.collect(state, h, drift="end")
    if len(rows.target) == 0:
        return Equalities(None, None)
    single = np.diff(rows.weights.indptr) == 1
    if rows.directions is not None:
        single &= np.abs(rows.directions - np.eye(3)).max(axis=(1, 2)) < 1e-12
    only = np.zeros(len(single), dtype=np.int64)
    only[single] = rows.weights.indices[rows.weights.indptr[:-1][single]]
    single &= body_of[only] < 0
    return Equalities(_part(rows, np.flatnonzero(single)), _part(rows, np.flatnonzero(~single)))


def _part(rows: Rows, which: np.ndarray) -> Rows | None:
    if len(which) == 0:
        return None
    named = ("target", "rate", "mean_rate", "acceleration", "kind", "row", "point")
    held = None if rows.directions is None else rows.directions[which]
    return replace(rows, weights=rows.weights[which], directions=held, **{n: getattr(rows, n)[which] for n in named})


def point_rows(state: State, rows: Rows, h: float, x: np.ndarray, arms: np.ndarray, points: PointMap) -> Equalities:
    """``E v = wanted`` of rows, for velocities that move points from ``x`` (points, 3) to where the rows want them."""
    w = rows.weights.tocsr()
    m = len(rows.target)
    row = np.repeat(np.arange(m), np.diff(w.indptr))
    held = np.tile(np.eye(3), (m, 1, 1)) if rows.directions is None else rows.directions
    matrix = points.rows(row, w.indices, w.data, held[row], arms, m).tocsr()
    wanted = np.einsum("rij,rj->ri", held, (rows.target - w @ x) / h).ravel()
    kept = np.flatnonzero(np.abs(held).sum(axis=2).ravel() > 0.0)
    return Equalities(None, rows, matrix[kept], wanted[kept])
