"""Impulses of contacts that were there before, as the start of the next solve (Contact, 5.5, step 1).

The normal part is carried as a number, friction as a vector of the world: the tangents of a frame may turn from one round
to the next, the force does not. A contact is the same if its two features are; where two features have several contacts
(normals added by later rounds), those with the nearest normals belong together, one to one. New contacts start at zero.
"""

import numpy as np

from turnbuckle.data.contact import Contacts


def to_world(frames: np.ndarray, impulse: np.ndarray) -> np.ndarray:
    """Impulses (m, 3) [N s] in world axes, of those in frames (m, 3, 3) whose rows are n, t1, t2."""
    return np.einsum("mab,ma->mb", frames, impulse)


def carry_over(
    before: Contacts,
    impulse: np.ndarray,
    now: Contacts,
    frames: np.ndarray,
    scale: float = 1.0,
    friction: np.ndarray | None = None,
) -> np.ndarray:
    """Start (m, 3) [N s] in the ``frames`` (m, 3, 3) of contacts ``now``, from impulses of contacts ``before``.

    ``impulse`` (b, 3) is in world axes (`to_world`); ``scale`` is the ratio of the steps' lengths (1/2 for a half step);
    with ``friction`` (m,) coefficients the tangential part is cut to the cone.
    """
    start = np.zeros((now.count, 3))
    old, new = match(before, now)
    normal = np.einsum("md,md->m", before.normal[old], impulse[old])
    tangential = impulse[old] - normal[:, None] * before.normal[old]
    size = np.maximum(normal, 0.0)
    along = np.einsum("mad,md->ma", frames[new, 1:], tangential)
    if friction is not None:
        length = np.hypot(along[:, 0], along[:, 1])
        most = friction[new] * size
        along = along * np.where(length > most, most / np.where(length > 0.0, length, 1.0), 1.0)[:, None]
    start[new, 0] = scale * size
    start[new, 1:] = scale * along
    return start


def match(before: Contacts, now: Contacts) -> tuple[np.ndarray, np.ndarray]:
    """Indices (k,) of the same contacts in both lists, each at most once, in the order of ``now``."""
    key_before, key_now = _keys(before), _keys(now)
    order = np.argsort(key_before, kind="stable")
    low = np.searchsorted(key_before[order], key_now, "left")
    count = np.searchsorted(key_before[order], key_now, "right") - low
    new = np.repeat(np.arange(now.count), count)
    old = order[np.repeat(low - (np.cumsum(count) - count), count) + np.arange(len(new))]
    likeness = np.einsum("kd,kd->k", before.normal[old], now.normal[new])
    new, old, likeness = new[likeness > 0.0], old[likeness > 0.0], likeness[likeness > 0.0]
    for of in (0, 1):  # the best old one of each new one, then the best new one of each old one
        sides = (new, old) if of == 0 else (old, new)
        best = np.lexsort((sides[1], -likeness, sides[0]))
        best = best[np.concatenate([[True], np.diff(sides[0][best]) > 0])[: len(best)]]
        new, old, likeness = new[best], old[best], likeness[best]
    place = np.argsort(new)
    return old[place], new[place]


def _keys(contacts: Contacts) -> np.ndarray:
    """One number for both features."""
    return (contacts.kind.astype(np.int64) << 62) + (contacts.a.astype(np.int64) << 31) + contacts.b.astype(np.int64)
