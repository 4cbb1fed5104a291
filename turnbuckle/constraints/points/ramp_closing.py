"""Gradual activation on the host: the closing fraction of `ramp.py`, for rows that are solved together."""

import numpy as np

from turnbuckle.data.tables import Table


def adjust(
    table: Table, r: np.ndarray, target: np.ndarray, rate: np.ndarray, gap: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Targets and rates of rows ``r`` whose gap at the start of the step is ``gap``; rows fully active stay as they are.

    A points-to-point row is split into one row a point; the bound on speed is then on each point against the first.
    """
    n = table.phase.numpy()[r]
    if not (n > 0).any():
        return target, rate
    j = table.ramp.step.numpy()[r]
    speed = table.ramp.speed.numpy()[r]
    length = np.linalg.norm(gap, axis=1)
    kept = 1.0 - 1.0 / np.maximum(n - j + 1, 1)
    kept = np.maximum(kept, np.where(length > 0.0, 1.0 - speed * h / np.where(length > 0.0, length, 1.0), 0.0))
    kept = np.where(n > 0, kept, 0.0)[:, None]
    closing = np.where(kept > 0.0, gap * (kept - 1.0) / h, 0.0)
    return target + kept * gap, rate + closing
