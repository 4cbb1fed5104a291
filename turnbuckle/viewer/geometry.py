"""All bodies of a scene gathered into one list of triangles and one of lines, with colours."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from turnbuckle.data.shape import Shape

# Muted, of like lightness, far apart in hue; neighbours in the list differ most.
PALETTE = np.array(
    [
        (0.31, 0.55, 0.73),
        (0.90, 0.56, 0.32),
        (0.45, 0.68, 0.52),
        (0.80, 0.42, 0.45),
        (0.60, 0.52, 0.74),
        (0.86, 0.74, 0.38),
        (0.38, 0.67, 0.70),
        (0.78, 0.58, 0.68),
    ]
)

_CREASE = np.cos(np.radians(40.0))


@dataclass(frozen=True)
class Patch:
    """Cells (m, 2 or 3) over their own vertices, a colour a cell (m, 3)."""

    cells: np.ndarray
    colors: np.ndarray


class SceneGeometry:
    """What is drawn of the shapes: the skin, else the triangles, else the lines of each.

    ``x`` [m] (points, 3) is the first state: where its surfaces have a crease, vertices are doubled, so that shading
    is smooth across a curved surface and sharp across an edge.
    """

    def __init__(self, shapes: list[Shape], x: np.ndarray) -> None:
        self._sources: dict[str, list[tuple[Shape, np.ndarray]]] = {"surface": [], "lines": []}
        gathered: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {"surface": [], "lines": []}
        count = dict.fromkeys(self._sources, 0)
        for number, shape in enumerate(shapes):
            if not shape.drawn:
                continue
            if shape.skin is not None or len(shape.triangles):
                kind = "surface"
                cells, used = split_creases(
                    _own(shape, x), shape.triangles if shape.skin is None else shape.skin.triangles
                )
            elif len(shape.lines):
                kind = "lines"
                used, cells = np.unique(shape.lines, return_inverse=True)
                cells = cells.reshape(-1, 2)
            else:
                continue
            color = PALETTE[number % len(PALETTE)] if shape.color is None else np.asarray(shape.color, dtype=float)
            gathered[kind].append((cells + count[kind], np.tile(color, (len(cells), 1))))
            self._sources[kind].append((shape, used))
            count[kind] += len(used)
        self.surface = _patch(gathered["surface"], 3)
        self.lines = _patch(gathered["lines"], 2)

    def vertices(self, kind: str, x: np.ndarray) -> np.ndarray:
        """Vertices [m] (n, 3) of the patch "surface" or "lines" for all points ``x`` of the state."""
        return np.concatenate([np.zeros((0, 3)), *(_own(shape, x)[used] for shape, used in self._sources[kind])])

    def everything(self, x: np.ndarray) -> np.ndarray:
        """All vertices that are drawn [m], (n, 3)."""
        return np.concatenate([self.vertices(kind, x) for kind in self._sources])


def _own(shape: Shape, x: np.ndarray) -> np.ndarray:
    return shape.skin.positions(x) if shape.skin is not None else x[shape.begin : shape.end]


def split_creases(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (m, 3) over new vertices, and the old vertex of each new one (n,), so that no two triangles share a
    vertex unless a fan of edges without a crease joins them. Vertices in no triangle are left out.

    The corners of all triangles are nodes of a graph; each edge without a crease joins two pairs of them.
    """
    count = len(triangles)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    corner = np.arange(3 * count).reshape(-1, 3)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    nodes = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    swap = ends[:, 0] > ends[:, 1]
    ends[swap], nodes[swap] = ends[swap][:, ::-1], nodes[swap][:, ::-1]
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    same = np.flatnonzero((ends[order][1:] == ends[order][:-1]).all(axis=1))
    left, right = nodes[order[same]], nodes[order[same + 1]]
    flat = np.abs(np.einsum("ij,ij->i", normal[left[:, 0] // 3], normal[right[:, 0] // 3])) > _CREASE
    left, right = left[flat].ravel(), right[flat].ravel()
    graph = coo_array((np.ones(len(left)), (left, right)), shape=(3 * count, 3 * count))
    _, label = connected_components(graph, directed=False)
    _, first, cells = np.unique(label, return_index=True, return_inverse=True)
    return cells.reshape(-1, 3), triangles.ravel()[first]


def _patch(parts: list[tuple[np.ndarray, np.ndarray]], corners: int) -> Patch:
    cells = np.concatenate([np.zeros((0, corners), np.int64), *(cells for cells, _ in parts)])
    return Patch(cells, np.concatenate([np.zeros((0, 3)), *(colors for _, colors in parts)]))
