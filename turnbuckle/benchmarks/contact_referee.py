"""Who counts intersections, of ours and of others: ipc-toolkit says whether, our exact count of edges through faces says how many.

Shared by our side and the peers', so that all are judged alike.
"""

import importlib.util
from typing import Any

import numpy as np

from turnbuckle.contact.intersections import Intersections
from turnbuckle.data.contact import Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model


class Referee:
    """Judges positions of the surface vertices of one scene. Raises InputError where ipctk is missing."""

    def __init__(self, surfaces: Surfaces) -> None:
        if importlib.util.find_spec("ipctk") is None:
            raise InputError("the benchmarks of contact need a referee that is not installed; pip install ipctk")
        import ipctk

        self._has_intersections = ipctk.has_intersections
        self._count = Intersections(surfaces, "cpu")
        self._order, self._mesh = _mesh(ipctk, surfaces)
        self.judged = 0
        self.crossing = 0  # positions that intersect
        self.most_edges = 0  # edges through faces at worst

    def judge(self, vertices: np.ndarray) -> bool:
        """Whether surfaces that should keep apart cross, at ``vertices`` (s, 3) [m]; counted."""
        crosses = bool(self._has_intersections(self._mesh, vertices[self._order]))
        self.judged += 1
        if crosses:
            self.crossing += 1
            self.most_edges = max(self.most_edges, len(self._count.find(vertices)))
        return crosses


def _mesh(ipctk: Any, surfaces: Surfaces) -> tuple[np.ndarray, Any]:
    """The order of vertices, and ipctk's mesh in it, that allows what the scene allows.

    Bodies that do not touch themselves go last and count as one; of two that pass each other, neither counts itself.
    """
    shape, collides = surfaces.shape, surfaces.collides
    shapes = np.unique(shape)
    still = [s for s in shapes if not collides[s, s] and not any(collides[s, t] for t in shapes if not collides[t, t])]
    order = np.argsort(np.isin(shape, still), kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    rest = np.zeros((len(order), 3))
    mesh = ipctk.CollisionMesh(rest, number[surfaces.edges], number[surfaces.faces])
    allowed = ipctk.make_static_obstacle_filter(int((~np.isin(shape, still)).sum()))
    for i in shapes:
        for j in shapes[shapes > i]:
            if not collides[i, j] and not (i in still and j in still):
                patches = np.arange(len(order), dtype=np.int32) + 1
                patches[np.isin(shape[order], [i, j])] = 0
                allowed = allowed & ipctk.make_vertex_patches_filter(patches)
    mesh.can_collide = allowed
    return order, mesh


def solid_surfaces(model: Model) -> Surfaces:
    """The scene's surfaces with those of its solids replaced by the boundary of their tetrahedra.

    What a library sees that knows tetrahedra only.
    """
    old, corners = model.surfaces, model.corotational.corners
    assert old is not None
    sides = corners[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    boundary = sides[np.sort(first[count == 1])]
    points = np.unique(boundary)
    of_point = np.full(model.points, -1)
    for k, shape in enumerate(model.shapes):
        of_point[shape.begin : shape.end] = k
    kept = ~np.isin(old.shape, np.unique(of_point[points]))
    number = np.cumsum(kept) - 1
    faces = number[old.faces[kept[old.faces].all(axis=1)]]
    renumbered = np.full(model.points, -1)
    renumbered[points] = kept.sum() + np.arange(len(points))
    faces = np.concatenate([faces, renumbered[boundary]]).astype(np.int32)
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0).astype(np.int32)
    own = np.zeros((len(points), 4))
    own[:, 0] = 1.0
    return Surfaces(
        support=np.concatenate([old.support[kept], np.repeat(points[:, None], 4, axis=1)]).astype(np.int32),
        weights=np.concatenate([old.weights[kept], own]),
        faces=faces,
        edges=edges,
        edge_faces=np.full((len(edges), 2), -1, np.int32),
        shape=np.concatenate([old.shape[kept], of_point[points]]).astype(np.int32),
        delta=np.concatenate([old.delta[kept], np.full(len(points), old.delta.mean())]),
        collides=old.collides,
        friction=old.friction,
    )
