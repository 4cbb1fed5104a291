"""Which point of the state a person means who clicks or drags: the place on a body, and the points that carry it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnbuckle.data.shape import Shape

NEAR = 0.02  # of the distance from the eye: how far beside a rope a click may be


@dataclass(frozen=True)
class Pick:
    """A place on a body."""

    shape: int
    point: int  # the point of the state that carries most of it
    place: np.ndarray  # (3,) [m]


def vertices_of(shape: Shape, x: np.ndarray) -> np.ndarray:
    """What is drawn of a shape: (n, 3) [m]."""
    return shape.skin.positions(x) if shape.skin is not None else x[shape.begin : shape.end]


def point_of(shape: Shape, vertex: int) -> int:
    """The point of the state that carries most of a drawn vertex."""
    if shape.skin is None:
        return shape.begin + vertex
    return int(shape.skin.points[vertex, np.argmax(np.abs(shape.skin.weights[vertex]))])


def nearest(shapes: Sequence[Shape], number: int, x: np.ndarray, place: np.ndarray) -> Pick:
    """The vertex of one shape nearest to a place [m]."""
    shape = shapes[number]
    found = int(np.argmin(((vertices_of(shape, x) - place) ** 2).sum(axis=1)))
    return Pick(number, point_of(shape, found), np.array(place, dtype=np.float64))


def ray_hit(origin: np.ndarray, direction: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """How far along a ray triangles (n, 3) each lie, inf where it misses, (n,) (Moeller and Trumbore 1997)."""
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = origin - a
        u = np.einsum("ij,ij->i", t, p) / det
        q = np.cross(t, e1)
        v = q @ direction / det
        s = np.einsum("ij,ij->i", e2, q) / det
        return np.where((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (s > 0.0), s, np.inf)


def pick_ray(shapes: Sequence[Shape], x: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> Pick | None:
    """The first body that a ray meets: its surface, or a line that it passes closely."""
    origin, direction = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    best: Pick | None = None
    least = np.inf
    for number, shape in enumerate(shapes):
        if not shape.drawn:
            continue
        v = vertices_of(shape, x)
        triangles = shape.triangles if shape.skin is None else shape.skin.triangles
        if len(triangles):
            s = ray_hit(origin, direction, *(v[triangles[:, k]] for k in range(3)))
            distance = float(s.min())
            place = origin + distance * direction if np.isfinite(distance) else origin
            near = triangles[int(np.argmin(s))]
        elif len(shape.lines):
            ends = np.unique(shape.lines)
            along = (v[ends] - origin) @ direction
            beside = np.linalg.norm(v[ends] - origin - along[:, None] * direction, axis=1)
            which = np.where((along > 0.0) & (beside < NEAR * along), along, np.inf)
            distance = float(which.min())
            near = ends[[int(np.argmin(which))]]
            place = v[near[0]]
        else:
            continue
        if distance < least:
            least = distance
            corner = int(near[np.argmin(((v[near] - place) ** 2).sum(axis=1))])
            best = Pick(number, point_of(shape, corner), place)
    return best
