"""Which points of a body a selection means."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from turnbuckle.data.errors import InputError
from turnbuckle.scene.definitions import PointsDef
from turnbuckle.scene.expression import compile_expression

BOX_TOLERANCE = 1e-9  # of the body's extent: a rotated corner must not fall out of its own box by rounding


def select(points: PointsDef, positions: np.ndarray, owner: str) -> np.ndarray:
    """Numbers of the points of a body that a selection means, int32, shape (n,), no two the same, n at least 1.

    `positions`: all points of that body at the start, world coordinates [m], shape (count, 3). `owner`: what the
    selection belongs to, such as "constraint 'top'", for messages. `indices` and `nearest` keep the order given; the others go up.
    Raises `InputError` when the selection is empty, names a point that is not there, or the same point twice.
    """
    what = f"{owner}: points of {points.body!r}"
    count = len(positions)
    if points.indices is not None:
        chosen = points.indices
    elif points.index is not None:
        chosen = np.array([points.index])
    elif points.nearest is not None:
        chosen = cKDTree(positions).query(np.atleast_2d(points.nearest))[1]
    else:
        chosen = np.flatnonzero(_mask(points, positions))
        if len(chosen) == 0:
            raise InputError(f"{what}: {_words(points)} selects none of its {count} points; {_extent(positions)}")
    chosen = np.asarray(chosen, dtype=np.int64)
    outside = chosen >= count
    if outside.any():
        raise InputError(
            f"{what}: there is no point {chosen[outside][0]}, the body has {count} points (0 to {count - 1})"
        )
    values, times = np.unique(chosen, return_counts=True)
    if (times > 1).any():
        raise InputError(f"{what}: point {values[np.argmax(times > 1)]} is selected twice; name each point once")
    return chosen.astype(np.int32)


def where_mask(text: str, positions: np.ndarray) -> np.ndarray:
    """Whether an expression in x, y, z [m] holds at each position, bool, shape (n,)."""
    x, y, z = positions.T
    value = compile_expression(text, ("x", "y", "z"))(x=x, y=y, z=z)
    return np.broadcast_to(np.isfinite(value) & (value != 0.0), (len(positions),))


def _mask(points: PointsDef, positions: np.ndarray) -> np.ndarray:
    if points.all:
        return np.ones(len(positions), dtype=bool)
    if points.where is not None:
        return where_mask(points.where, positions)
    low, high = positions.min(axis=0), positions.max(axis=0)
    if points.box is not None:
        slack = BOX_TOLERANCE * float(np.max(high - low))
        inside = (positions >= points.box[0] - slack) & (positions <= points.box[1] + slack)
        return np.asarray(inside.all(axis=1))
    assert points.side is not None  # the definition has exactly one way
    axis = "xyz".index(points.side[1])
    depth = max(points.thickness, BOX_TOLERANCE) * (high[axis] - low[axis])
    if points.side[0] == "+":
        return np.asarray(positions[:, axis] >= high[axis] - depth)
    return np.asarray(positions[:, axis] <= low[axis] + depth)


def _words(points: PointsDef) -> str:
    if points.where is not None:
        return f"where {points.where!r}"
    return "box" if points.box is not None else "side"


def _extent(positions: np.ndarray) -> str:
    low, high = positions.min(axis=0), positions.max(axis=0)
    spans = (f"{axis} from {a:.4g} to {b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True))
    return "the body has " + ", ".join(spans) + " m"
