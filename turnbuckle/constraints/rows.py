"""Constraints as rows: plain data for the solvers that take them together (`implicit`, `joint`)."""

import numpy as np
import scipy.sparse as sp

from turnbuckle.constraints.points import ramp_closing
from turnbuckle.data.rows import Rows
from turnbuckle.data.state import State
from turnbuckle.data.tables import OFF, Attachments, Joins, Slides, Table

KINDS = ("nail", "points_to_point", "attach", "slide", "velocity")


def collect(
    state: State, h: float, only: int | None = None, start: np.ndarray | None = None, drift: str = "mean"
) -> Rows:
    """Rows of all constraints that act (of those in the phase ``only``), for a step of ``h``.

    ``start``: positions at the start of the interval that is landed on, those of the state when left out. ``drift``: how
    velocity goals move their points in it: with the "mean" of both ends, or with the velocity at the "end".

    Gradual activation in closing mode is in the targets; rows in the paper's mode are left out (they land afterwards).
    """
    x = state.now.x.numpy() if start is None else start
    parts = [_collect(kind, state, h, only, x, drift) for kind in KINDS]
    n = len(state.owner)
    blocks, targets, rates, means, accelerations, directions, kinds, rows, points = zip(*parts, strict=True)
    counts = [len(t) for t in targets]
    entry_rows = np.concatenate([b[0] + shift for b, shift in zip(blocks, np.cumsum([0, *counts[:-1]]), strict=True)])
    columns, values = (np.concatenate([b[i] for b in blocks]) for i in (1, 2))
    matrix = sp.csr_array((values, (entry_rows, columns)), shape=(sum(counts), n))
    held = None
    if any(d is not None for d in directions):
        held = np.concatenate(
            [np.tile(np.eye(3), (c, 1, 1)) if d is None else d for d, c in zip(directions, counts, strict=True)]
        )
    joined = (np.concatenate(a) for a in (targets, rates, means, accelerations, kinds, rows, points))
    target, rate, mean, acceleration, kind, row, point = joined
    return Rows(matrix, target, rate, mean, acceleration, held, kind, row, point)


def _collect(kind: str, state: State, h: float, only: int | None, x: np.ndarray, drift: str) -> tuple:
    table: Table = getattr(state.tables, kind)
    phase = table.phase.numpy()[: table.rows]
    paper = table.ramp.paper.numpy()[: table.rows] != 0
    r = np.flatnonzero((phase != OFF) & ~((phase > 0) & paper) if only is None else phase == only)
    v = state.now.v.numpy()
    place = KINDS.index(kind)
    directions = acceleration = None
    tied = np.zeros(len(r), dtype=np.int64)
    if kind in ("nail", "velocity"):
        point = table.point.numpy()[r]
        entries = (np.arange(len(r)), point, np.ones(len(r)))
        if kind == "nail":
            base, now, rate = table.goal.numpy()[r], table.goal_now.numpy()[r], table.rate.numpy()[r]
            mean, acceleration = (base - now) / h, table.acceleration.numpy()[r]
        else:
            goal = table.goal.numpy()[r]
            kept = np.maximum(phase[r], 1) - table.ramp.step.numpy()[r] + 1
            kept = np.where(phase[r] > 0, 1.0 - 1.0 / np.maximum(kept, 1), 0.0)[:, None]
            rate = goal + kept * (v[point] - goal)
            before = table.goal_now.numpy()[r]
            mean = rate if drift == "end" else np.where(phase[r][:, None] > 0, rate, 0.5 * (goal + before))
            acceleration = (goal - before) / h
            base = now = x[point] + h * mean
        gap = x[point] - now
    elif isinstance(table, Joins):
        offsets = table.offsets.numpy()
        sizes = offsets[r + 1] - offsets[r] - 1
        row = np.repeat(r, sizes)
        tied = np.concatenate([np.arange(1, s + 1) for s in sizes]) if len(sizes) else tied
        points = table.points.numpy()
        first, other = points[offsets[row]], points[offsets[row] + tied]
        index = np.arange(len(row))
        entries = (np.r_[index, index], np.r_[other, first], np.r_[np.ones(len(row)), -np.ones(len(row))])
        base = rate = np.zeros((len(row), 3))
        gap, r = x[other] - x[first], row
    else:
        assert isinstance(table, Attachments)
        count, points, weights = (a.numpy()[r] for a in (table.count, table.points, table.weights))
        used = np.arange(points.shape[1]) < count[:, None]
        entries = (np.nonzero(used)[0], points[used], weights[used])
        base = rate = np.zeros((len(r), 3))
        gap = np.einsum("nk,nkd->nd", np.where(used, weights, 0.0), x[points])
        if isinstance(table, Slides) and len(r):
            directions = table.directions.numpy()[r].reshape(-1, 3, 3)
    if kind != "velocity":
        base, rate = ramp_closing.adjust(table, r, base, rate, gap, h)
    if acceleration is None:  # relative rows
        mean, acceleration = rate, np.zeros_like(rate)
    return entries, base, rate, mean, acceleration, directions, np.full(len(r), place), r, tied
