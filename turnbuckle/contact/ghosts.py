"""Which contacts that a motion crosses are ghosts: their places are at no minimum of the distance (see `normal_cone`).

The conditions are those for pairs that are near at the start, asked of the surfaces as they are at each contact's own time
of impact. A ghost has a neighbour that is nearer at that time, and most often is found with it. Nothing is ever certified by
this: continuous collision detection decides what a step crosses, and what is still in the way in a later round of the same
step becomes a row, ghost or not.
"""

import numpy as np
import scipy.sparse as sp

from turnbuckle.contact.surface import neighbours
from turnbuckle.data.contact import VERTEX_FACE, Contacts, Surfaces

NOISE = 1e-6  # of a cosine
BORDER = 1e-9  # weights below this are at the border
NEARLY = 0.05  # [rad] less than for what lies: what is needed besides is found in the next round
TINY = 1e-20

OK, NEAR, BLUNT, SHEET = 1, 2, 4, 8  # of a place: at a minimum, nearly so, and flat all around, has faces
INSIDE = OK | NEAR | BLUNT | SHEET  # of a face


class Ghosts:
    """Conditions on one set of surfaces."""

    def __init__(self, surfaces: Surfaces) -> None:
        edges, faces = surfaces.edges.astype(np.int64), surfaces.faces.astype(np.int64)
        self.edges, self.faces = edges, faces
        sums = faces.sum(axis=1) if len(faces) else np.zeros(1, dtype=np.int64)
        beside = surfaces.edge_faces
        self.opposite = np.where(beside >= 0, sums[beside] - edges.sum(axis=1, keepdims=True), -1)
        self.start, self.other = neighbours(surfaces.vertices, surfaces.edges)
        self.sheet = np.zeros(surfaces.vertices, dtype=bool)
        self.sheet[faces.ravel()] = True
        self.span = max(surfaces.vertices, 1)
        step = sp.csr_array((np.ones(len(self.other), dtype=np.int32), self.other, self.start),
                            shape=(surfaces.vertices,) * 2) + sp.eye_array(surfaces.vertices, dtype=np.int32)  # fmt: skip
        near = (step @ step).tocoo()  # vertices that two edges join, at most
        self.joined = np.sort(near.row.astype(np.int64) * self.span + near.col)
        code = edges[:, 0] * self.span + edges[:, 1]
        self.order = np.argsort(code, kind="stable")
        self.code = code[self.order]

    def find(self, contacts: Contacts, x0: np.ndarray, x1: np.ndarray) -> np.ndarray:
        """(m,) bool: contacts on the straight way from ``x0`` to ``x1`` (s, 3) that are ghosts."""
        m = contacts.count
        first = np.where(contacts.kind == VERTEX_FACE, 1, 2)
        used = np.abs(contacts.coefficients) > BORDER
        sides = np.arange(4) < first[:, None]
        state = [self._places(contacts, used & sides, -1.0, x0, x1), self._places(contacts, used & ~sides, 1.0, x0, x1)]
        one, two = state
        points = [(used & side).sum(axis=1) == 1 for side in (sides, ~sides)]
        inside = [(used & side).sum(axis=1) == 3 for side in (sides, ~sides)]
        kept = np.ones(m, dtype=bool)
        for (mine, point), (their, other), face in (
            ((one, points[0]), (two, points[1]), inside[1]),
            ((two, points[1]), (one, points[0]), inside[0]),
        ):
            over = point & face  # a vertex over the inside of a face
            kept &= ~over | ((mine & NEAR) != 0)
            edge = point & ~other & ~face  # a vertex at the inside of an edge
            easy = ((their & BLUNT) != 0) | ((mine & their & SHEET) == 0)
            fits = np.where(easy, (mine & NEAR) != 0, (mine & OK) != 0) & ((their & OK) != 0)
            kept &= ~edge | fits
        both = points[0] & points[1]
        easy = (((one | two) & BLUNT) != 0) | ((one & two & SHEET) == 0)
        kept &= ~both | np.where(easy, (one & two & NEAR) != 0, (one & two & OK) != 0)
        lines = ~points[0] & ~points[1] & ~inside[0] & ~inside[1]
        kept &= ~lines | ((one & two & OK) != 0)
        return ~kept

    def in_folds(self, contacts: Contacts) -> np.ndarray:
        """(m,) bool: contacts whose sides lie beside each other on one surface, at most two edges away."""
        first = np.where(contacts.kind == VERTEX_FACE, 1, 2)
        out = np.zeros(contacts.count, dtype=bool)
        vertices = contacts.vertices.astype(np.int64)
        for i in range(2):
            for j in range(1, 4):
                code = vertices[:, i] * self.span + vertices[:, j]
                place = np.minimum(np.searchsorted(self.joined, code), len(self.joined) - 1)
                out |= (i < first) & (j >= first) & (self.joined[place] == code)
        return out

    def _places(self, contacts: Contacts, used: np.ndarray, sign: float, x0: np.ndarray, x1: np.ndarray) -> np.ndarray:
        """What holds at the places of one side (m,), bits; ``sign`` -1 where the normal points to this side."""
        count = used.sum(axis=1)
        out = np.full(contacts.count, INSIDE)
        rows = np.flatnonzero(count == 1)
        if len(rows):
            vertex = contacts.vertices[rows][used[rows]]
            out[rows] = self._at_vertices(vertex, sign * contacts.normal[rows], contacts.time[rows], x0, x1)
        rows = np.flatnonzero(count == 2)
        if len(rows):
            ends = np.sort(contacts.vertices[rows][used[rows]].reshape(-1, 2).astype(np.int64), axis=1)
            place = np.minimum(np.searchsorted(self.code, ends[:, 0] * self.span + ends[:, 1]), len(self.code) - 1)
            out[rows] = self._at_edges(self.order[place], sign * contacts.normal[rows], contacts.time[rows], x0, x1)
        return out

    def _at_vertices(
        self, vertex: np.ndarray, u: np.ndarray, t: np.ndarray, x0: np.ndarray, x1: np.ndarray
    ) -> np.ndarray:
        counts = self.start[vertex + 1] - self.start[vertex]
        row = np.repeat(np.arange(len(vertex)), counts)
        entry = (
            np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(self.start[vertex], counts)
        )
        away = _at(x0, x1, self.other[entry], t[row]) - _at(x0, x1, vertex[row], t[row])
        cosine = np.einsum("kd,kd->k", away, u[row]) / np.maximum(np.linalg.norm(away, axis=1), TINY)
        most, least = np.full(len(vertex), -2.0), np.full(len(vertex), 2.0)
        np.maximum.at(most, row, cosine)
        np.minimum.at(least, row, cosine)
        sheet = self.sheet[vertex]
        return _bits(most, (most <= NOISE) & sheet & (least >= -NEARLY), sheet)

    def _at_edges(self, edge: np.ndarray, u: np.ndarray, t: np.ndarray, x0: np.ndarray, x1: np.ndarray) -> np.ndarray:
        a, b = (_at(x0, x1, self.edges[edge, k], t) for k in range(2))
        along = b - a
        square = np.maximum(np.einsum("kd,kd->k", along, along), TINY)
        most, least, faces = np.full(len(edge), -2.0), np.full(len(edge), 2.0), np.zeros(len(edge), dtype=bool)
        for k in range(2):
            third = self.opposite[edge, k]
            away = _at(x0, x1, np.maximum(third, 0), t) - a
            away = away - (np.einsum("kd,kd->k", away, along) / square)[:, None] * along
            size = np.einsum("kd,kd->k", away, away)
            has = (third >= 0) & (size > TINY * square)  # a face without area goes nowhere
            cosine = np.einsum("kd,kd->k", away, u) / np.sqrt(np.maximum(size, 1e-300))
            most = np.where(has, np.maximum(most, cosine), most)
            least = np.where(has, np.minimum(least, cosine), least)
            faces |= has
        return _bits(most, (most <= NOISE) & faces & (least >= -NEARLY), faces)


def _at(x0: np.ndarray, x1: np.ndarray, vertex: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Places of vertices (k,) at times (k,)."""
    start = x0[vertex]
    return start + t[:, None] * (x1[vertex] - start)


def _bits(most: np.ndarray, blunt: np.ndarray, sheet: np.ndarray) -> np.ndarray:
    return (most <= NOISE) * OK | (most <= NOISE + NEARLY) * NEAR | blunt * BLUNT | sheet * SHEET
