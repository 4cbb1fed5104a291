"""From contacts on surfaces to rows over the blocks of a step, and impulses carried from one step to the next."""

import numpy as np
import scipy.sparse as sp

from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Contacts, Surfaces
from turnbuckle.data.state import State


def frames(normal: np.ndarray) -> np.ndarray:
    """Orthonormal rows n, t1, t2 for unit normals (m, 3) -> (m, 3, 3); the same for the same normal."""
    n = normal
    least = np.argmin(np.abs(n), axis=1)
    axis = np.zeros_like(n)
    axis[np.arange(len(n)), least] = 1.0
    t1 = np.cross(n, axis)
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    return np.stack([n, t1, np.cross(n, t1)], axis=1)


class PointMap:
    """From velocities of blocks to velocities of points: a point's own block, or both blocks of its rigid body."""

    def __init__(self, points: int, body_of: np.ndarray, blocks: int) -> None:
        self.points, self.body_of, self.blocks = points, body_of, blocks

    def rows(
        self, row: np.ndarray, point: np.ndarray, weight: np.ndarray, frame: np.ndarray, arms: np.ndarray, count: int
    ) -> sp.bsr_array:
        """``sum_e weight_e frame_e V(point_e)`` for entries e of each row, as (count, blocks) blocks of 3 x 3.

        ``frame`` (entries, 3, 3), ``arms`` (points, 3) from the centres of rigid bodies [m].
        """
        body = self.body_of[point]
        own, follows = np.flatnonzero(body < 0), np.flatnonzero(body >= 0)
        values = weight[:, None, None] * frame
        r = arms[point[follows]]
        turned = np.cross(r[:, None, :], values[follows])  # f . (w x r) = w . (r x f), row by row
        block = self.points + 2 * body[follows]
        rows = np.concatenate([row[own], row[follows], row[follows]])
        columns = np.concatenate([point[own], block, block + 1])
        return _summed(rows, columns, np.concatenate([values[own], values[follows], turned]), count, self.blocks)


def _summed(rows: np.ndarray, columns: np.ndarray, values: np.ndarray, count: int, blocks: int) -> sp.bsr_array:
    """Blocks in the order of rows and columns, each once."""
    key = rows.astype(np.int64) * blocks + columns
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]]) if len(key) else np.zeros(0, np.int64)
    data = np.add.reduceat(values[order], first, axis=0) if len(first) else np.zeros((0, 3, 3))
    unique = key[first]
    indptr = np.searchsorted(unique // blocks, np.arange(count + 1)).astype(np.int32)
    indices = (unique % blocks).astype(np.int32)
    return sp.bsr_array((data, indices, indptr), shape=(3 * count, 3 * blocks))


def contact_rows(
    surfaces: Surfaces, contacts: Contacts, frame: np.ndarray, arms: np.ndarray, points: PointMap
) -> sp.bsr_array:
    """J of contacts (Contact, (5)): rows n, t1, t2 of the velocity of the place on a relative to that on b."""
    m = contacts.count
    weight = contacts.coefficients[:, :, None] * surfaces.weights[contacts.vertices]  # (m, 4, 4)
    point = surfaces.support[contacts.vertices]
    used = np.flatnonzero(weight.ravel() != 0.0)
    row = used // 16
    return points.rows(row, point.ravel()[used], weight.ravel()[used], frame[row], arms, m)


class Memory:
    """Impulses of the last step by pair, as world vectors: what a solver starts from (Contact, 5.5, step 1).

    Kept in the state, so that a checkpoint has them, and a step that failed leaves those of the step before it.
    """

    def __init__(self, surfaces: Surfaces, state: State) -> None:
        self._span = int(max(len(surfaces.faces), len(surfaces.edges), surfaces.vertices, 1))
        self._state = state

    @property
    def keys(self) -> np.ndarray:
        """(n,) int64, sorted: which pair."""
        return self._state.contact_keys

    @property
    def impulse(self) -> np.ndarray:
        """(n, 3) on side a of each pair [N s]."""
        return self._state.contact_impulse

    @property
    def sliding(self) -> np.ndarray:
        """(n,) bool: friction was at its limit."""
        return self._state.contact_sliding

    @property
    def yielding(self) -> np.ndarray:
        """(n,) bool: it is squeezed, and comes nearer than at the start of a step."""
        return self._state.contact_yielding

    def _key(self, contacts: Contacts) -> np.ndarray:
        a, b = contacts.a.astype(np.int64), contacts.b.astype(np.int64)
        return ((contacts.kind != VERTEX_FACE) * self._span + a) * self._span + b

    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Kind, a and b (n,) of each, as in `Contacts`."""
        kind_and_a, b = np.divmod(self.keys, self._span)
        other, a = np.divmod(kind_and_a, self._span)
        return np.where(other == 0, VERTEX_FACE, EDGE_EDGE), a, b

    def same(self, contacts: Contacts, known: Contacts) -> np.ndarray:
        """Which contacts (m,) are of pairs that are known."""
        return np.isin(self._key(contacts), self._key(known))

    def _find(self, contacts: Contacts) -> tuple[np.ndarray, np.ndarray]:
        key = self._key(contacts)
        at = np.searchsorted(self.keys, key)
        at = np.minimum(at, max(len(self.keys) - 1, 0))
        known = (self.keys[at] == key) if len(self.keys) else np.zeros(len(key), dtype=bool)
        return at, known

    def recall(self, contacts: Contacts, ratio: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World impulses (m, 3) [N s] times ``ratio`` (of step sizes), which contacts slid, and which yield; zero where new."""
        at, known = self._find(contacts)
        first = np.zeros(len(at), dtype=bool)
        first[np.unique(self._key(contacts), return_index=True)[1]] = True  # of several rows of a pair, one
        known &= first
        out = np.zeros((len(at), 3))
        out[known] = ratio * self.impulse[at[known]]
        slid, yields = np.zeros((2, len(at)), dtype=bool)
        slid[known] = self.sliding[at[known]]
        yields[known] = self.yielding[at[known]]
        return out, slid, yields

    def keep(self, contacts: Contacts, impulse: np.ndarray, sliding: np.ndarray, yielding: np.ndarray) -> None:
        """Remember world impulses (m, 3), summed over rows of one pair, and which contacts slide, and yield."""
        state = self._state
        state.contact_keys, inverse = np.unique(self._key(contacts), return_inverse=True)
        inverse, n = inverse.ravel(), len(state.contact_keys)
        sums = [np.bincount(inverse, weights=impulse[:, k], minlength=n) for k in range(3)]
        state.contact_impulse = np.stack(sums, axis=1)
        state.contact_sliding = np.bincount(inverse, weights=sliding, minlength=n) > 0.0
        state.contact_yielding = np.bincount(inverse, weights=yielding, minlength=n) > 0.0
