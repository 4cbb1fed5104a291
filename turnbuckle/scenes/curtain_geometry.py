"""The curtain of cubes of Local, Figures 1 and 2: where its points are and which of them are joined."""

from typing import NamedTuple

import numpy as np

from turnbuckle.data.errors import InputError

# Corner k of a unit cube is its bits: x = k & 1, y = k >> 1 & 1, z = k >> 2.
CUBE_CORNERS = np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)])
# A cube in five: the regular tetrahedron on every second corner, and one on each corner that is left. All det > 0.
CUBE_TETRAHEDRA = np.array([[0, 5, 3, 6], [1, 3, 0, 5], [2, 0, 3, 6], [4, 0, 6, 5], [7, 5, 6, 3]], dtype=np.int32)
_TOP = np.array([2, 3, 6, 7], dtype=np.int32)
# Edges along z by the corner they take in the x-y plane, the corner at z = 0 first.
_LOWER_LEFT, _LOWER_RIGHT, _UPPER_LEFT, _UPPER_RIGHT = (np.array([k, k + 4], dtype=np.int32) for k in range(4))


class CurtainGeometry(NamedTuple):
    """Points, elements and joints of a curtain of `cubes` cubes; cube k owns points 8k to 8k + 7."""

    vertices: np.ndarray  # (8 cubes, 3) float64 [m], Y up
    tetrahedra: np.ndarray  # (5 cubes, 4) int32, det > 0
    nails: np.ndarray  # (4 m,) int32, the upper corners of the top row
    pairs: np.ndarray  # (4 (m - 1) (rows - 1), 2) int32, corners that coincide and stay together

    @property
    def cubes(self) -> int:
        return len(self.vertices) // 8

    def worst_gap(self, x: np.ndarray) -> float:
        """Largest distance of two joined corners, or of a nail from its place [m], at positions x [m], (points, 3)."""
        joints = np.linalg.norm(x[self.pairs[:, 0]] - x[self.pairs[:, 1]], axis=1)
        nails = np.linalg.norm(x[self.nails] - self.vertices[self.nails], axis=1)
        return float(max(joints.max(initial=0.0), nails.max(initial=0.0)))


def curtain_geometry(m: int, rows: int = 20, edge: float = 0.1) -> CurtainGeometry:
    """A curtain in the x-y plane, hanging along -y from y = 0, of `rows` rows that alternate m and m - 1 cubes.

    The cubes are the black squares of a chessboard: neighbours in a row stand one `edge` [m] apart, and a cube touches
    the cubes above and below only at its four edges along z, each shared with one other cube. So each of the m - 1
    cubes of a short row meets two cubes of each long row beside it, with two corners each: 4 (m - 1) pairs between
    rows, and no corner is in two of them. With rows = 20 that gives what the paper counts: 10 (2m - 1) cubes of five
    tetrahedra, 4m nails, 76 (m - 1) pairs (m = 40: 3950 tetrahedra, 160 nails, 2964 pairs).

    Raises InputError where m < 2, rows < 1, or edge is not a positive length.
    """
    if m < 2 or rows < 1:
        raise InputError(f"curtain: m = {m}, rows = {rows}; m must be at least 2 and rows at least 1.")
    if not (np.isfinite(edge) and edge > 0.0):
        raise InputError(f"curtain: edge = {edge} m must be a positive length.")

    # Chessboard of rows x (2m - 1) squares: where row + column is even stands a cube.
    row, column = np.indices((rows, 2 * m - 1))
    black = (row + column) % 2 == 0
    cube = np.full(black.shape, -1, dtype=np.int32)
    cube[black] = np.arange(np.count_nonzero(black), dtype=np.int32)

    # Whole numbers times `edge`, so that corners that touch have equal bits.
    grid = np.stack([column[black], -1 - row[black], np.zeros_like(row[black])], axis=1)
    centred = (grid[:, None, :] + CUBE_CORNERS).reshape(-1, 3) - np.array([m - 0.5, 0.0, 0.5])
    vertices = centred * edge
    first = 8 * np.arange(len(grid), dtype=np.int32)
    tetrahedra = (first[:, None, None] + CUBE_TETRAHEDRA).reshape(-1, 4)
    nails = (8 * cube[0, ::2, None] + _TOP).ravel()

    upper_left = _meeting(cube[:-1, :-1], _LOWER_RIGHT, cube[1:, 1:], _UPPER_LEFT)
    upper_right = _meeting(cube[:-1, 1:], _LOWER_LEFT, cube[1:, :-1], _UPPER_RIGHT)
    pairs = np.concatenate([upper_left, upper_right])
    pairs = pairs[np.argsort(pairs[:, 1])]  # in the order of the lower cube: neighbours in memory

    used = np.bincount(np.concatenate([nails, pairs.ravel()]), minlength=len(vertices))
    assert used.max() <= 1, "a corner of the curtain is in two constraints"
    return CurtainGeometry(vertices, tetrahedra, nails, pairs)


def _meeting(above: np.ndarray, edge_above: np.ndarray, below: np.ndarray, edge_below: np.ndarray) -> np.ndarray:
    """Pairs of points, shape (n, 2), of the cubes that stand in the same place of the grids `above` and `below`."""
    both = above >= 0
    points_above = 8 * above[both][:, None] + edge_above
    points_below = 8 * below[both][:, None] + edge_below
    return np.stack([points_above.ravel(), points_below.ravel()], axis=1)
