"""Looking up curves, surfaces and domains of the user for joints beside contact (Displacement, 4.1.3)."""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.rigid import ROWS
from turnbuckle.data.state import State


@dataclass
class Look:
    """What domains hold of points, in their own frames."""

    point: np.ndarray  # (k, 3) nearest permissible points [m]
    directions: np.ndarray  # (k, ROWS, 3), zero beyond `count`
    count: np.ndarray  # (k,)
    one_sided: np.ndarray  # (k, ROWS) bool


def look_up(state: State, which: np.ndarray, p: np.ndarray) -> Look:
    """The parts ``which`` (k,), whose points are at ``p[which]`` in the frames of their domains."""
    k = len(which)
    out = Look(np.zeros((k, 3)), np.zeros((k, ROWS, 3)), np.zeros(k, dtype=int), np.zeros((k, ROWS), dtype=bool))
    number = state.parts.domain[which]
    for d in np.unique(number):
        rows = np.flatnonzero(number == d)
        held = state.domains[d].held(p[which[rows]])
        out.point[rows], out.count[rows] = held.point, held.count
        there = np.arange(ROWS) < held.count[:, None]
        out.directions[rows] = np.where(there[:, :, None], held.directions, 0.0)
        out.one_sided[rows] = there & held.one_sided
    return out


def aligned(then: Look, now: Look) -> np.ndarray:
    """Directions of ``then``, with bases turned as near to those of ``now`` as can be; those of ``now`` where they differ.

    (k, ROWS, 3). The same number of directions, none of them a limit: else what is held now counts alone.
    """
    out = now.directions.copy()
    same = (then.count == now.count) & ~now.one_sided.any(axis=1) & ~then.one_sided.any(axis=1)
    i = np.flatnonzero(same & (now.count > 0))
    if len(i):
        u, _, vt = np.linalg.svd(now.directions[i] @ then.directions[i].transpose(0, 2, 1))
        out[i] = (u @ vt) @ then.directions[i]
        out[i] *= (np.arange(ROWS) < now.count[i, None])[:, :, None]
    return out
