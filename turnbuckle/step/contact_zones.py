"""The last resort: zones of impact move rigidly (Provot 1997; Bridson, Fedkiw, Anderson 2002; Contact, section 4).

Whatever the way of a step still crosses is put into zones, with all that hangs on it by equality rows. A zone moves as
one rigid body with the momentum that its parts would have had, or with what is prescribed of it; after some rounds it is
only shifted, since then the straight ways of its points cannot meet. Zones grow until the way is clear.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from turnbuckle.data.contact import Contacts, Surfaces

ROUNDS = 40  # of growing zones
TURNING = 8  # of them, in which zones may turn
AGREED = 1e-9  # of the largest speed: by how much prescribed velocities in a zone may differ from a rigid motion


@dataclass
class Nodes:
    """What can be put into zones: mass points and dynamic rigid bodies, and what has its motion prescribed."""

    place: np.ndarray  # (n, 3) blocks: position, of rigid bodies in both of their blocks [m]
    mass: np.ndarray  # (n,) [kg], 0 for second blocks of rigid bodies
    inertia: np.ndarray  # (n, 3, 3) [kg m^2] of rigid bodies in their second block
    fixed: np.ndarray  # (n,) bool
    first: np.ndarray  # (n,) the block that stands for the body of this block
    spins: np.ndarray  # (n,) bool, second blocks


class Pinched(ValueError):
    """Prescribed motions that no zone can follow."""


class Zones:
    """Zones of one attempt."""

    def __init__(self, nodes: Nodes, rows: sp.csr_array | None) -> None:
        self.nodes = nodes
        self.links: list[np.ndarray] = []  # (k, 2) blocks that belong together once one of them is in a zone
        if rows is not None and rows.shape[0]:
            block = sp.coo_array(rows)
            row, column = block.row, nodes.first[block.col // 3]
            leader = np.full(rows.shape[0], -1, dtype=np.int64)
            leader[row[::-1]] = column[::-1]
            self.links.append(np.stack([leader[row], column], axis=1))
        self.hit: list[np.ndarray] = []

    def add(self, contacts: Contacts, surfaces: Surfaces, block_of: Callable[[np.ndarray], np.ndarray]) -> None:
        """Put what these contacts touch into one zone each; ``block_of`` gives the blocks of points."""
        used = (contacts.coefficients != 0.0)[:, :, None] & (surfaces.weights[contacts.vertices] != 0.0)
        block = self.nodes.first[block_of(surfaces.support[contacts.vertices])].reshape(contacts.count, 16)
        used = used.reshape(contacts.count, 16)
        lead = block[np.arange(contacts.count), np.argmax(used, axis=1)]
        row, entry = np.nonzero(used)
        self.hit.append(np.stack([lead[row], block[row, entry]], axis=1))

    def labels(self) -> tuple[np.ndarray, np.ndarray]:
        """The zone of each block (n,), and which zones were hit."""
        n = len(self.nodes.mass)
        own = np.stack([self.nodes.first, np.arange(n)], axis=1)
        hit = np.concatenate(self.hit)
        hit = hit[~self.nodes.fixed[hit].all(axis=1)]
        moving = [pair[~self.nodes.fixed[pair].all(axis=1)] for pair in self.links]
        edges = np.concatenate([own, hit, *moving])
        count, label = connected_components(
            sp.coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(n, n)), directed=False
        )
        return label, np.unique(label[hit.ravel()])

    def move(self, v: np.ndarray, turning: bool) -> np.ndarray:
        """Velocities of blocks (n, 3) with every zone moving rigidly. Raises `Pinched`."""
        label, zones = self.labels()
        out = v.copy()
        order = np.argsort(label, kind="stable")
        starts = np.searchsorted(label[order], np.arange(label.max() + 2))
        for zone in zones:
            members = order[starts[zone] : starts[zone + 1]]
            out[members] = self._rigid(members, v[members], turning)
        return out

    def _rigid(self, members: np.ndarray, v: np.ndarray, turning: bool) -> np.ndarray:
        n = self.nodes
        fixed = n.fixed[members]
        spins = n.spins[members]
        place = n.place[members]
        if fixed.any():
            return self._follow(place, v, fixed, spins)
        mass = n.mass[members]
        centre = (mass @ place) / mass.sum()
        velocity = (mass @ np.where(spins[:, None], 0.0, v)) / mass.sum()
        spin = np.zeros(3)
        if turning:
            arm = place - centre
            own = np.einsum("nij,nj->ni", n.inertia[members], np.where(spins[:, None], v, 0.0)).sum(axis=0)
            momentum = (mass[:, None] * np.cross(arm, v))[~spins].sum(axis=0) + own
            square = np.einsum(
                "n,nij->ij",
                mass,
                np.einsum("nk,nk->n", arm, arm)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :],
            )
            square = square + n.inertia[members].sum(axis=0)
            spin = np.linalg.lstsq(square, momentum, rcond=1e-10)[0]
        return np.where(spins[:, None], spin, velocity + np.cross(spin, place - centre))

    @staticmethod
    def _follow(place: np.ndarray, v: np.ndarray, fixed: np.ndarray, spins: np.ndarray) -> np.ndarray:
        """The rigid motion of what is prescribed."""
        given = v[fixed & ~spins]
        velocity = given.mean(axis=0)
        worst = np.abs(given - velocity).max(initial=0.0)
        if worst > AGREED * (1.0 + np.abs(given).max(initial=0.0)):
            raise Pinched
        out = np.where(spins[:, None], 0.0, velocity)
        out[fixed] = v[fixed]
        return out


def clear_with_zones(
    zones: Zones,
    crossed: Contacts,
    v: np.ndarray,
    moved: Callable[[np.ndarray], np.ndarray],
    detect: Callable[[np.ndarray], Contacts],
    surfaces: Surfaces,
    block_of: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray | None, Contacts]:
    """Velocities whose way is clear, or None and what still crosses. ``moved(v)`` gives surface vertices at the end."""
    for n in range(ROUNDS):
        zones.add(crossed, surfaces, block_of)
        try:
            found = zones.move(v, n < TURNING)
        except Pinched:
            return None, crossed
        crossed = detect(moved(found))
        if crossed.count == 0:
            return found, crossed
    return None, crossed
