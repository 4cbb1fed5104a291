"""Surfaces of contact from the bodies' triangles and lines.

The distance that contact keeps, where it is not given, is a tenth (`DELTA_FRACTION`) of the mean length of the edges at
each vertex; no length counts for more than the median edge of the finest part, so that a floor of two large triangles
does not keep cloth metres away.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from turnbuckle.data.contact import Surfaces
from turnbuckle.data.errors import InputError

DELTA_FRACTION = 0.1  # of the local edge length


def _none(columns: int) -> np.ndarray:
    return np.zeros((0, columns), dtype=np.int32)


@dataclass(frozen=True)
class SurfacePart:
    """The surface of one body: its vertices, each a weighted sum of up to four points of the state."""

    shape: int  # which of `Model.shapes` it is
    support: np.ndarray  # (n,) or (n, k <= 4) points of the state
    weights: np.ndarray | None = None  # (n, k), rows sum to 1; None for k = 1
    triangles: np.ndarray = field(default_factory=lambda: _none(3))  # (f, 3) numbers of this part's vertices
    lines: np.ndarray = field(default_factory=lambda: _none(2))  # (l, 2) edges of ropes
    delta: float | np.ndarray | None = None  # [m] scalar or (n,); None: a tenth of the local edge length


def make_surfaces(
    parts: Sequence[SurfacePart],
    rest: np.ndarray,
    collides: np.ndarray | None = None,
    friction: np.ndarray | None = None,
    delta_fraction: float = DELTA_FRACTION,
) -> Surfaces:
    """All parts in one numbering, vertices, faces and lines part after part.

    ``rest`` (points, 3) [m] are positions of the state's points, which lengths of edges are taken from. ``collides``
    (shapes, shapes) is true everywhere and ``friction`` (shapes, shapes, 2) 0 where not given. Faces without area are
    kept: nothing later divides by an area. Raises `InputError` for indices or weights that cannot be right.
    """
    rest = np.asarray(rest, dtype=np.float64)
    counts = [len(part.support) for part in parts]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    support = np.zeros((first[-1], 4), dtype=np.int32)
    weights = np.zeros((first[-1], 4))
    faces, lines = [_none(3)], [_none(2)]
    for part, begin, end in zip(parts, first, first[1:], strict=False):
        _check(part, len(rest))
        given = np.asarray(part.support, dtype=np.int32).reshape(end - begin, -1)
        support[begin:end] = given[:, :1]  # unused columns: weight 0 of the first point
        support[begin:end, : given.shape[1]] = given
        weights[begin:end, : given.shape[1]] = 1.0 if part.weights is None else part.weights
        faces.append(np.asarray(part.triangles, dtype=np.int64).reshape(-1, 3) + begin)
        lines.append(np.asarray(part.lines, dtype=np.int64).reshape(-1, 2) + begin)
    face = np.concatenate(faces).astype(np.int32)
    edges, edge_faces = find_edges(face, np.concatenate(lines).astype(np.int32))
    shape = np.repeat(np.array([part.shape for part in parts], dtype=np.int32), counts).astype(np.int32)
    x = np.einsum("sk,skd->sd", weights, rest[support])
    shapes = int(shape.max(initial=-1)) + 1
    return Surfaces(
        support=support,
        weights=weights,
        faces=face,
        edges=edges,
        edge_faces=edge_faces,
        shape=shape,
        delta=_distances(parts, first, x, edges, delta_fraction),
        collides=np.ones((shapes, shapes), dtype=bool) if collides is None else np.asarray(collides, dtype=bool),
        friction=np.zeros((shapes, shapes, 2)) if friction is None else np.asarray(friction, dtype=np.float64),
    )


def _check(part: SurfacePart, points: int) -> None:
    """Raise `InputError` for a part that is not consistent."""
    n = len(part.support)
    support = np.asarray(part.support)
    where = f"the contact surface of shape {part.shape}"
    if n and (support.min() < 0 or support.max() >= points):
        raise InputError(f"{where}: 'support' names points outside the {points} of the state; give numbers below that")
    if support.ndim > 2 or (support.ndim == 2 and support.shape[1] > 4):
        raise InputError(f"{where}: 'support' has shape {support.shape}; give at most 4 points a vertex")
    if support.ndim == 2 and support.shape[1] > 1 and part.weights is None:
        raise InputError(f"{where}: 'weights' are missing; give one for each column of 'support'")
    if part.weights is not None and not np.allclose(np.asarray(part.weights).reshape(n, -1).sum(axis=1), 1.0):
        raise InputError(f"{where}: 'weights' of a vertex must sum to 1; scale them")
    for name, corners in (("triangles", np.asarray(part.triangles)), ("lines", np.asarray(part.lines))):
        if corners.size and (corners.min() < 0 or corners.max() >= n):
            raise InputError(f"{where}: '{name}' names vertices outside its {n}; give numbers below that")


def find_edges(faces: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unique edges (e, 2), lower vertex first, sorted; and the first two faces at each (e, 2), -1 where there is none.

    Edges of a face from a vertex to itself are left out.
    """
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).reshape(-1, 2)
    owner = np.tile(np.arange(len(faces), dtype=np.int64), 3)
    ends = np.sort(np.concatenate([sides, lines.reshape(-1, 2)]).astype(np.int64), axis=1)
    owner = np.concatenate([owner, np.full(len(lines), -1)])
    real = ends[:, 0] != ends[:, 1]
    ends, owner = ends[real], owner[real]
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    edge_faces = np.full((len(edges), 2), -1, dtype=np.int32)
    number, owner = number.reshape(-1)[owner >= 0], owner[owner >= 0]
    order = np.lexsort((owner, number))
    number, owner = number[order], owner[order]
    start = np.searchsorted(number, number)  # first entry of the same edge
    place = np.arange(len(number)) - start
    for k in range(2):
        edge_faces[number[place == k], k] = owner[place == k]
    return edges.astype(np.int32).reshape(-1, 2), edge_faces


def _distances(
    parts: Sequence[SurfacePart], first: np.ndarray, x: np.ndarray, edges: np.ndarray, fraction: float
) -> np.ndarray:
    """Distance to keep (s,) [m], see the top of this file."""
    length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    medians = [
        np.median(inside)
        for begin, end in zip(first, first[1:], strict=False)
        if (inside := length[(edges[:, 0] >= begin) & (edges[:, 0] < end) & (length > 0.0)]).size
    ]
    ends, both = edges.reshape(-1), np.repeat(length, 2)
    total = np.bincount(ends, both, minlength=len(x))
    count = np.maximum(np.bincount(ends, minlength=len(x)), 1)
    delta = fraction * np.minimum(total / count, min(medians, default=0.0))
    for part, begin, end in zip(parts, first, first[1:], strict=False):
        if part.delta is not None:
            delta[begin:end] = part.delta
    return delta


def closed_shapes(surfaces: Surfaces) -> np.ndarray:
    """(shapes,) bool: those without a border."""
    out = np.ones(int(surfaces.shape.max(initial=-1)) + 1, dtype=bool)
    border = (surfaces.edge_faces < 0).any(axis=1)
    out[surfaces.shape[surfaces.edges[border, 0]]] = False
    return out


def neighbours(vertices: int, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices at the other ends of the edges at each vertex: ``other[start[v]:start[v + 1]]``, both int32."""
    both = np.concatenate([edges, edges[:, ::-1]]).astype(np.int64)
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    start = np.searchsorted(both[:, 0], np.arange(vertices + 1)).astype(np.int32)
    return start, both[:, 1].astype(np.int32)
