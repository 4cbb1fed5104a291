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

_ROOM = 0.5  # of the size of all that moves: how far around it still bodies are shown
_FLOOR = 3.0  # of that size: still bodies larger than this, below all others, are the ground

_CREASE = np.cos(np.radians(40.0))


@dataclass(frozen=True)
class Patch:
    """Cells (m, 2 or 3) over their own vertices, a colour a cell (m, 3), whether its back is never seen (m,)."""

    cells: np.ndarray
    colors: np.ndarray
    closed: np.ndarray


class SceneGeometry:
    """What is drawn of the shapes: the skin, else the triangles, else the lines of each.

    ``x`` [m] (points, 3) is the first state: where its surfaces have a crease, vertices are doubled, so that shading
    is smooth across a curved surface and sharp across an edge. A wide floor without a colour of its own is not drawn:
    its height is `ground`, where shadows fall.
    """

    def __init__(self, shapes: list[Shape], x: np.ndarray, up_axis: str = "Z") -> None:
        self._sources: dict[str, list[tuple[Shape, np.ndarray]]] = {"surface": [], "lines": []}
        gathered: dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {"surface": [], "lines": []}
        count = dict.fromkeys(self._sources, 0)
        self.ground, floors = _ground(shapes, x, "XYZ".index(up_axis))
        for number, shape in enumerate(shapes):
            if not shape.drawn or number in floors:
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
            closed = np.full(len(cells), shape.local is not None and _closed(shape.triangles))
            gathered[kind].append((cells + count[kind], np.tile(color, (len(cells), 1)), closed))
            self._sources[kind].append((shape, used))
            count[kind] += len(used)
        self.surface = _patch(gathered["surface"], 3)
        self.lines = _patch(gathered["lines"], 2)

    def vertices(self, kind: str, x: np.ndarray) -> np.ndarray:
        """Vertices [m] (n, 3) of the patch "surface" or "lines" for all points ``x`` of the state."""
        return np.concatenate([np.zeros((0, 3)), *(_own(shape, x)[used] for shape, used in self._sources[kind])])

    def everything(self, x: np.ndarray) -> np.ndarray:
        """What the camera should show [m], (n, 3): all vertices of what moves, and of still bodies what is near it."""
        sources = [source for kind in self._sources.values() for source in kind]
        moving = [_own(shape, x)[used] for shape, used in sources if not shape.still]
        still = [_own(shape, x)[used] for shape, used in sources if shape.still]
        if not moving or not still:
            return np.concatenate([np.zeros((0, 3)), *moving, *still])
        around = np.concatenate(moving)
        seen = around[np.isfinite(around).all(axis=1)]
        if not len(seen):
            return around
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = _ROOM * float(np.linalg.norm(high - low))
        return np.concatenate(
            [around, *(np.clip(v, low - room, high + room) for v in still if _near(v, low, high, room))]
        )


def _near(vertices: np.ndarray, low: np.ndarray, high: np.ndarray, room: float) -> bool:
    """Whether the box around the vertices comes within ``room`` [m] of the box from ``low`` to ``high``."""
    return bool((vertices.min(axis=0) <= high + room).all() and (vertices.max(axis=0) >= low - room).all())


def _ground(shapes: list[Shape], x: np.ndarray, up: int) -> tuple[float | None, set[int]]:
    """Height of the floor [m], None where there is none, and which shapes are floors."""
    moving = [_own(s, x) for s in shapes if s.drawn and not s.still and (s.skin is not None or s.end > s.begin)]
    if not moving:
        return None, set()
    around = np.concatenate(moving)
    around = around[np.isfinite(around).all(axis=1)]
    if not len(around):
        return None, set()
    size = float(np.linalg.norm(np.ptp(around, axis=0)))
    across = [k for k in range(3) if k != up]
    heights, floors = [], set()
    for number, shape in enumerate(shapes):
        if shape.still and shape.drawn and shape.color is None and len(shape.triangles):
            own = _own(shape, x)
            if (
                np.ptp(own, axis=0)[across].min() > _FLOOR * size
                and own[:, up].max() < around[:, up].min() + 0.05 * size
            ):
                heights.append(float(own[:, up].max()))
                floors.add(number)
    return (max(heights) if heights else None), floors


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


def _closed(triangles: np.ndarray) -> bool:
    """Whether every edge is passed as often one way as the other."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    back = edges[:, ::-1]
    return bool((edges[np.lexsort(edges.T)] == back[np.lexsort(back.T)]).all())


def _patch(parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]], corners: int) -> Patch:
    cells = np.concatenate([np.zeros((0, corners), np.int64), *(cells for cells, _, _ in parts)])
    colors = np.concatenate([np.zeros((0, 3)), *(colors for _, colors, _ in parts)])
    return Patch(cells, colors, np.concatenate([np.zeros(0, dtype=bool), *(closed for _, _, closed in parts)]))
