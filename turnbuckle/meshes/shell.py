"""Tetrahedra between a primitive solid and the same solid grown by a thickness.

All primitives are images of the surface of a cube of cells, so that one numbering serves them all: cell corners go to
a box as they are, to a sphere along their rays, to a cylinder by squares becoming circles, to a capsule as to a sphere
cut in two and drawn apart.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import boundary_triangles, six_volumes

CELL_LIMIT = 1_000_000
COARSE = 0.4  # of the smallest width: length of a cell where the user gives none


@dataclass(frozen=True)
class Shell:
    """A layer of material around a kernel, in the kernel's frame."""

    vertices: np.ndarray  # [m], (n, 3) float64
    tetrahedra: np.ndarray  # (m, 4) int32, volume > 0
    inner: np.ndarray  # (k,) int32, the vertices on the kernel
    volume: float  # between the true surfaces [m^3]
    edge: float = 0.0  # length of the cells aimed for [m], 0 where there was no such aim

    def outside(self) -> tuple[np.ndarray, np.ndarray]:
        """The outer surface alone: vertices (k, 3) [m] and triangles (m, 3) int32."""
        faces = boundary_triangles(self.tetrahedra)
        faces = faces[~np.isin(faces, self.inner).any(axis=1)]
        used, index = np.unique(faces, return_inverse=True)
        return self.vertices[used], index.reshape(-1, 3).astype(np.int32)


def box_shell(size: np.ndarray, thickness: float, layers: int = 1, edge: float | None = None) -> Shell:
    """Around a box of lengths ``size`` (3,) [m]: its corners stay sharp."""
    size = np.asarray(size, dtype=np.float64)
    outer = size + 2.0 * thickness
    wanted = _edge(edge, thickness / layers, outer.min())
    volume = float(np.prod(outer) - np.prod(size))
    return _shell(_cells(outer, wanted, 1), lambda u, t: u * (0.5 * size + t), thickness, layers, volume, wanted)


def sphere_shell(radius: float, thickness: float, layers: int = 1, edge: float | None = None) -> Shell:
    """Around a ball."""
    outer = radius + thickness
    wanted = _edge(edge, thickness / layers, 2.0 * outer)
    cells = _cells(np.full(3, 0.5 * np.pi * outer), wanted, 3 if edge is None else 2)
    volume = 4.0 / 3.0 * np.pi * (outer**3 - radius**3)
    return _shell(cells, lambda u, t: (radius + t) * _on_sphere(u), thickness, layers, volume, wanted)


def cylinder_shell(radius: float, length: float, thickness: float, layers: int = 1, edge: float | None = None) -> Shell:
    """Around a cylinder along z, its rims sharp."""
    outer = np.array([2.0 * (radius + thickness)] * 2 + [length + 2.0 * thickness])
    wanted = _edge(edge, thickness / layers, outer.min())
    cells = _cells(outer, wanted, 1)
    cells[:2] = max(int(cells[0]), 2)

    def place(u: np.ndarray, t: float) -> np.ndarray:
        across = (
            u[:, :2] * (np.abs(u[:, :2]).max(axis=1) / np.maximum(np.linalg.norm(u[:, :2], axis=1), 1e-300))[:, None]
        )
        return np.c_[(radius + t) * across, u[:, 2] * (0.5 * length + t)]

    volume = np.pi * ((radius + thickness) ** 2 * (length + 2.0 * thickness) - radius**2 * length)
    return _shell(cells, place, thickness, layers, float(volume), wanted)


def capsule_shell(radius: float, length: float, thickness: float, layers: int = 1, edge: float | None = None) -> Shell:
    """Around a capsule along z."""
    outer = radius + thickness
    wanted = _edge(edge, thickness / layers, 2.0 * outer)
    round_cells = 2 * int(_cells(np.full(1, 0.25 * np.pi * outer), wanted, 1)[0])
    straight = int(_cells(np.full(1, length), wanted, 1)[0])
    cells = np.array([round_cells, round_cells, round_cells + straight])

    def place(u: np.ndarray, t: float) -> np.ndarray:
        # The lattice's z is in cells from the bottom: half the round ones, the straight ones, the other half.
        k = 0.5 * (u[:, 2] + 1.0) * cells[2] - 0.5 * round_cells
        along = np.clip(k, 0.0, straight)
        ball = np.c_[u[:, :2], (k - along) / (0.5 * round_cells)]
        points = (radius + t) * _on_sphere(ball)
        points[:, 2] += length * (along / straight - 0.5)
        return points

    volume = np.pi * (outer**2 - radius**2) * length + 4.0 / 3.0 * np.pi * (outer**3 - radius**3)
    return _shell(cells, place, thickness, layers, float(volume), wanted)


def _on_sphere(u: np.ndarray) -> np.ndarray:
    """From the surface of the cube [-1, 1]^3 to the unit sphere; the tangent makes cells of like size."""
    warped = np.tan(0.25 * np.pi * u)
    return warped / np.linalg.norm(warped, axis=1, keepdims=True)


def _edge(wanted: float | None, layer: float, width: float) -> float:
    return float(max(layer, COARSE * width)) if wanted is None else wanted


def _cells(lengths: np.ndarray, edge: float, least: int) -> np.ndarray:
    counts = np.maximum(np.ceil(lengths / edge - 1e-9), least)
    if counts.max() ** 2 > CELL_LIMIT:
        raise InputError(f"edge_length {edge:g} m asks for more than {CELL_LIMIT} cells; give a larger one")
    return counts.astype(np.int64)


def _shell(
    cells: np.ndarray,
    place: Callable[[np.ndarray, float], np.ndarray],
    thickness: float,
    layers: int,
    volume: float,
    edge: float,
) -> Shell:
    lattice, quads = cube_surface(cells)
    if len(quads) * layers > CELL_LIMIT:
        raise InputError(f"more than {CELL_LIMIT} cells are asked for; give a larger edge_length or fewer layers")
    unit = 2.0 * lattice / cells - 1.0
    levels = [place(unit, thickness * k / layers) for k in range(layers + 1)]
    triangles = _cut(levels[-1], quads)
    vertices, tetrahedra = prisms(levels, triangles)
    return Shell(vertices, tetrahedra, np.arange(len(lattice), dtype=np.int32), volume, edge)


def cube_surface(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points (n, 3) on the surface of a block of ``cells`` (3,) cells, and quads (m, 4) turned outwards."""
    corners = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        i, j = (a.ravel() for a in np.meshgrid(np.arange(cells[b]), np.arange(cells[c]), indexing="ij"))
        for side in (0, int(cells[axis])):
            steps = ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0))
            quad = np.empty((len(i), 4, 3), dtype=np.int64)
            quad[:, :, axis] = side
            for k, (di, dj) in enumerate(steps):
                quad[:, k, b], quad[:, k, c] = i + di, j + dj
            corners.append(quad)
    all_corners = np.concatenate(corners)
    points, index = np.unique(all_corners.reshape(-1, 3), axis=0, return_inverse=True)
    return points, index.reshape(-1, 4)


def _cut(x: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Each quad in two triangles, along the diagonal that leaves the larger smallest triangle; of equals, in turns."""
    a, b, c, d = quads.T
    ways = [((a, b, c), (a, c, d)), ((a, b, d), (b, c, d))]
    least = []
    for way in ways:
        areas = [np.linalg.norm(np.cross(x[q] - x[p], x[r] - x[p]), axis=1) for p, q, r in way]
        least.append(np.minimum(*areas))
    level = np.abs(least[0] - least[1]) <= 1e-6 * np.maximum(*least)
    first = np.where(level, np.arange(len(quads)) % 2 == 0, least[0] > least[1])
    halves = [np.where(first[:, None], np.stack(p, axis=1), np.stack(q, axis=1)) for p, q in zip(*ways, strict=True)]
    return np.concatenate(halves)


def prisms(levels: list[np.ndarray], triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra between copies of a surface, one inside the next.

    ``levels``: vertices (n, 3) of each copy [m], from inside out; ``triangles`` (m, 3) over one copy, outwards. Returns
    vertices, copy after copy, and tetrahedra (3 m (levels - 1), 4) int32. Each side of a prism is cut from the lower
    corner of the smaller index to the upper one of the larger, a rule that neighbours share.
    Raises InputError where the copies touch.
    """
    vertices = np.concatenate(levels)
    n = len(levels[0])
    low = np.sort(triangles, axis=1)
    low = np.concatenate([low + k * n for k in range(len(levels) - 1)])
    a, b, c = low.T
    a1, b1, c1 = (low + n).T
    tetrahedra = np.stack([(a, b, c, c1), (a, b, b1, c1), (a, a1, b1, c1)]).transpose(2, 0, 1).reshape(-1, 4)
    volumes = six_volumes(vertices, tetrahedra)
    tetrahedra[volumes < 0] = tetrahedra[volumes < 0][:, [0, 2, 1, 3]]
    if not (np.abs(volumes) > 0.0).all():
        raise InputError("the layers around the kernel have no volume; give a larger thickness")
    return vertices, tetrahedra.astype(np.int32)
