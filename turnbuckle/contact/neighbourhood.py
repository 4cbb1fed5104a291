"""What is around the edges and vertices of surfaces, on the device."""

import numpy as np
import warp as wp

from turnbuckle.contact.surface import neighbours
from turnbuckle.data.contact import Surfaces


@wp.struct
class Neighbourhood:
    """What is around edges and vertices."""

    edges: wp.array(dtype=wp.int32)  # (2 e,)
    opposite: wp.array(dtype=wp.int32)  # (2 e,) third vertices of the faces at each edge, -1 where there is none
    faces: wp.array(dtype=wp.int32)  # (3 f,)
    face_edges: wp.array(dtype=wp.int32)  # (3 f,) the edge from each corner to the next, -1 where there is none
    start: wp.array(dtype=wp.int32)  # (s + 1,) into `other`
    other: wp.array(dtype=wp.int32)  # vertices at the other ends of a vertex' edges
    sheet: wp.array(dtype=wp.uint8)  # (s,) 1: the vertex has faces


def make_neighbourhood(surfaces: Surfaces, device: str) -> Neighbourhood:
    """What is around edges and vertices, on the device."""
    edges, faces = surfaces.edges.astype(np.int64), surfaces.faces.astype(np.int64)
    n = surfaces.vertices
    at = surfaces.edge_faces
    sums = faces.sum(axis=1) if len(faces) else np.zeros(1, dtype=np.int64)
    opposite = np.where(at >= 0, sums[at] - edges.sum(axis=1, keepdims=True), -1)
    code = edges[:, 0] * n + edges[:, 1]
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    asked = (sides[..., 0] * n + sides[..., 1]).reshape(-1)
    place = np.minimum(np.searchsorted(code, asked), max(len(code) - 1, 0))
    face_edges = np.where(code[place] == asked, place, -1) if len(code) else np.full(len(asked), -1)
    start, other = neighbours(n, surfaces.edges)
    sheet = np.zeros(n, dtype=np.uint8)
    sheet[faces] = 1
    near = Neighbourhood()
    for name, value in (
        ("edges", edges),
        ("opposite", opposite),
        ("faces", faces),
        ("face_edges", face_edges),
        ("start", start),
        ("other", other),
    ):
        setattr(near, name, wp.array(value.reshape(-1).astype(np.int32), dtype=wp.int32, device=device))
    near.sheet = wp.array(sheet, dtype=wp.uint8, device=device)
    return near
