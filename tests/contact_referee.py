"""Intersections of the surfaces of a scene as an independent library (ipctk) sees them."""

import numpy as np
import pytest

from turnbuckle.data.contact import Surfaces

ipctk = pytest.importorskip("ipctk")


def intersects(surfaces: Surfaces, x: np.ndarray) -> bool:
    """Whether surfaces that should keep apart cross, for positions ``x`` (points, 3) [m] of the points of the state.

    Bodies that do not touch themselves go last and count as one; of two that pass each other, neither counts itself.
    """
    vertices, shape, collides = surfaces.positions(x), surfaces.shape, surfaces.collides
    shapes = np.unique(shape)
    still = [s for s in shapes if not collides[s, s] and not any(collides[s, t] for t in shapes if not collides[t, t])]
    order = np.argsort(np.isin(shape, still), kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    faces, edges = number[surfaces.faces], number[surfaces.edges]
    mesh = ipctk.CollisionMesh(vertices[order], edges, faces)
    allowed = ipctk.make_static_obstacle_filter(int((~np.isin(shape, still)).sum()))
    for i in shapes:
        for j in shapes[shapes > i]:
            if not collides[i, j] and not (i in still and j in still):
                patches = np.arange(len(vertices), dtype=np.int32) + 1
                patches[np.isin(shape[order], [i, j])] = 0
                allowed = allowed & ipctk.make_vertex_patches_filter(patches)
    mesh.can_collide = allowed
    return bool(ipctk.has_intersections(mesh, vertices[order]))
