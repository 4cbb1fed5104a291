"""Ready meshes: boxes and cylinders of tetrahedra, sheets of triangles and springs."""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.errors import InputError

# The corners of a cell are numbered x + 2 y + 4 z. Five tetrahedra fill it: four corners cut off, one in the
# middle. A face's diagonal joins the corners the middle one uses, so neighbouring cells take mirrored
# patterns ("even" and "odd") to share the diagonals of their common face.
_EVEN_CELL = np.array([(1, 0, 5, 3), (2, 0, 3, 6), (4, 0, 6, 5), (7, 3, 5, 6), (0, 3, 6, 5)])
_ODD_CELL = np.array([(0, 1, 2, 4), (3, 1, 7, 2), (5, 1, 4, 7), (6, 2, 7, 4), (1, 2, 4, 7)])

# Faces of a tetrahedron with positive volume, each with its normal pointing outwards.
TETRAHEDRON_FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


@dataclass(frozen=True)
class GridSheet:
    """A rectangular sheet: points on a grid, triangles, and springs by what they resist."""

    vertices: np.ndarray  # [m], (n, 3) float64; point (i, j) has index i + j * (cells[0] + 1)
    triangles: np.ndarray  # (m, 3) int32, normals along +z
    structural: np.ndarray  # (k, 2) int32, the grid's own edges
    shear: np.ndarray  # (k, 2) int32, both diagonals of each cell
    bend: np.ndarray  # (k, 2) int32, each point and the next but one along x and along y


def six_volumes(vertices: np.ndarray, tetrahedra: np.ndarray) -> np.ndarray:
    """Six times the signed volume of each tetrahedron [m^3], shape (m,)."""
    a, b, c, d = (vertices[tetrahedra[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)


def box_tetrahedra(size: tuple[float, float, float], cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A box from the origin to ``size`` [m], five tetrahedra a cell.

    Returns vertices [m] (n, 3) float64, point (i, j, k) at index ``i + (nx+1) (j + (ny+1) k)``, and tetrahedra
    (m, 4) int32 of positive volume. Cells alternate, so that neighbours share the diagonals of their faces.
    Raises InputError for sizes or counts that are not positive.
    """
    _positive("box", size, cells)
    nx, ny, nz = (int(c) for c in cells)
    z, y, x = np.meshgrid(
        np.linspace(0, size[2], nz + 1), np.linspace(0, size[1], ny + 1), np.linspace(0, size[0], nx + 1), indexing="ij"
    )
    vertices = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    k, j, i = (a.ravel() for a in np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij"))
    corner = np.arange(8)
    ids = (
        (i[:, None] + (corner & 1))
        + (nx + 1) * ((j[:, None] + (corner >> 1 & 1)) + (ny + 1) * (k[:, None] + (corner >> 2)))
    )  # fmt: skip
    odd = ((i + j + k) % 2).astype(bool)
    tetrahedra = np.where(odd[:, None, None], ids[:, _ODD_CELL], ids[:, _EVEN_CELL]).reshape(-1, 4).astype(np.int32)
    inverted = six_volumes(vertices, tetrahedra) < 0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return vertices, tetrahedra


def grid_sheet(size: tuple[float, float], cells: tuple[int, int]) -> GridSheet:
    """A sheet in the x-y plane from the origin to ``size`` [m]. Raises InputError for sizes or counts not positive."""
    _positive("sheet", size, cells)
    nx, ny = (int(c) for c in cells)
    y, x = np.meshgrid(np.linspace(0, size[1], ny + 1), np.linspace(0, size[0], nx + 1), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    ids = np.arange((nx + 1) * (ny + 1)).reshape(ny + 1, nx + 1)
    a, b, c, d = ids[:-1, :-1].ravel(), ids[:-1, 1:].ravel(), ids[1:, 1:].ravel(), ids[1:, :-1].ravel()
    # the diagonals alternate, so that the sheet has no preferred direction
    odd = (np.add.outer(np.arange(ny), np.arange(nx)) % 2).astype(bool).ravel()[:, None]
    first = np.where(odd, np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(odd, np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    return GridSheet(
        vertices=vertices,
        triangles=np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int32),
        structural=_pairs((ids[:, :-1], ids[:, 1:]), (ids[:-1], ids[1:])),
        shear=_pairs((a, c), (b, d)),
        bend=_pairs((ids[:, :-2], ids[:, 2:]), (ids[:-2], ids[2:])),
    )


def cylinder_tetrahedra(
    radius: float, length: float, segments_around: int, segments_along: int
) -> tuple[np.ndarray, np.ndarray]:
    """A solid rope along x from 0 to ``length`` [m], its axis through the origin.

    Each slice is a fan of ``segments_around`` prisms of three tetrahedra. Point 0 of slice k, on the axis, has index
    ``k * (segments_around + 1)``, the points of the rim follow it. Returns vertices [m] (n, 3) float64 and tetrahedra
    (m, 4) int32 of positive volume. Raises InputError for fewer than 3 segments around or sizes that are not positive.
    """
    _positive("cylinder", (radius, length), (segments_around, segments_along))
    if segments_around < 3:
        raise InputError(f"cylinder: segments_around is {segments_around}; give at least 3")
    n, angle = int(segments_around), 2 * np.pi * np.arange(segments_around) / segments_around
    disc = np.concatenate([[[0.0, 0.0]], radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    along = np.linspace(0, length, int(segments_along) + 1)
    vertices = np.concatenate(
        [np.repeat(along, n + 1)[:, None], np.tile(disc, (len(along), 1))],
        axis=1,
    )
    rim = np.arange(n)
    fan = np.sort(np.stack([np.zeros(n, int), 1 + rim, 1 + (rim + 1) % n], axis=1), axis=1)
    low = (fan[None] + ((n + 1) * np.arange(int(segments_along)))[:, None, None]).reshape(-1, 3)
    high = low + n + 1
    # With a < b < c each side of the prism is cut from the lower corner of the smaller index to the upper corner
    # of the larger, a rule both neighbours follow.
    a, b, c = low.T
    a1, b1, c1 = high.T
    tetrahedra = np.stack([(a, b, c, c1), (a, b, b1, c1), (a, a1, b1, c1)], axis=0).transpose(2, 0, 1)
    tetrahedra = tetrahedra.reshape(-1, 4).astype(np.int32)
    inverted = six_volumes(vertices, tetrahedra) < 0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return vertices, tetrahedra


def boundary_triangles(tetrahedra: np.ndarray) -> np.ndarray:
    """The faces that belong to one tetrahedron only, (k, 3) int32, outwards where the tetrahedra have volume > 0."""
    return boundary_faces(tetrahedra)[0]


def boundary_faces(tetrahedra: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `boundary_triangles`, and for each the index of its tetrahedron, (k,) int32."""
    tetrahedra = np.asarray(tetrahedra).reshape(-1, 4)
    faces = tetrahedra[:, TETRAHEDRON_FACES].reshape(-1, 3)
    if not len(faces):
        return np.zeros((0, 3), np.int32), np.zeros(0, np.int32)
    _, inverse, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    single = np.flatnonzero(count[inverse.ravel()] == 1)
    return faces[single].astype(np.int32), (single // 4).astype(np.int32)


def _pairs(*ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return np.concatenate([np.stack([p.ravel(), q.ravel()], axis=1) for p, q in ends]).astype(np.int32)


def _positive(what: str, sizes: tuple[float, ...], counts: tuple[int, ...]) -> None:
    if not all(np.isfinite(s) and s > 0 for s in sizes):
        raise InputError(f"{what}: the sizes are {tuple(sizes)}; give positive lengths in metres")
    if not all(int(c) == c and c >= 1 for c in counts):
        raise InputError(f"{what}: the counts are {tuple(counts)}; give whole numbers of at least 1")
