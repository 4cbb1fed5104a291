"""Bodies on the page: one node a body; of rigid ones only the pose is sent, of others the vertices."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from turnbuckle.data.shape import Shape
from turnbuckle.geometry.fit import fit_pose
from turnbuckle.live.picking import vertices_of
from turnbuckle.live.tubes import tube_faces, tube_vertices
from turnbuckle.viewer.geometry import PALETTE, split_creases

TUBE = 0.0025  # of the scene's size: radius of a line
FAR = 1e6  # of the scene's size: what has flown further is not drawn
STILL = 1e-7  # of the scene's size: what has moved by less is not sent again


class Body:
    """One shape as a node of the page."""

    def __init__(self, scene: Any, number: int, shape: Shape, x: np.ndarray, size: float) -> None:
        self.number, self.shape, self._size = number, shape, size
        self.rigid = shape.local is not None and shape.skin is None
        color = PALETTE[number % len(PALETTE)] if shape.color is None else np.asarray(shape.color, dtype=np.float64)
        self._lines = shape.lines if shape.skin is None and not len(shape.triangles) else np.zeros((0, 2), np.int32)
        own = vertices_of(shape, x)
        if len(self._lines):
            faces = tube_faces(len(self._lines))
        else:
            triangles = shape.triangles if shape.skin is None else shape.skin.triangles
            faces, self._used = split_creases(own, triangles)
        vertices = shape.local[self._used] if self.rigid and not len(self._lines) else self._vertices(x)
        self.rigid = self.rigid and not len(self._lines)
        self._shown = np.array(vertices, dtype=np.float32)
        self.count = len(vertices)
        self._pose = (np.full(3, np.nan), np.zeros(4))
        self.node = scene.add_mesh_simple(
            f"/bodies/{shape.name}", vertices=self._shown, faces=faces.astype(np.uint32),
            color=tuple(int(round(255 * c)) for c in color), side="double", flat_shading=False,
        )  # fmt: skip
        if self.rigid:
            self.update(x)

    def _vertices(self, x: np.ndarray) -> np.ndarray:
        own = vertices_of(self.shape, x)
        if len(self._lines):
            return tube_vertices(own[self._lines[:, 0]], own[self._lines[:, 1]], TUBE * self._size)
        return own[self._used]

    def update(self, x: np.ndarray) -> None:
        """Show it where the points ``x`` (points, 3) [m] are; where it was, if they are no numbers any more."""
        if not np.abs(x[self.shape.begin : self.shape.end]).max(initial=0.0) < FAR * self._size:
            return
        if self.rigid:
            assert self.shape.local is not None
            own = x[self.shape.begin : self.shape.end]
            place, turn_xyzw = fit_pose(self.shape.local, own)
            old_place, old_turn = self._pose
            if not np.abs(place - old_place).max() < STILL * self._size or np.abs(turn_xyzw - old_turn).max() > 1e-6:
                self._pose = (place, turn_xyzw)
                self.node.position = place
                self.node.wxyz = turn_xyzw[[3, 0, 1, 2]]
            return
        vertices = self._vertices(x).astype(np.float32)
        if np.abs(vertices - self._shown).max(initial=0.0) > STILL * self._size:
            self._shown = vertices
            self.node.vertices = vertices


def drawn_bodies(
    scene: Any, shapes: Sequence[Shape], x: np.ndarray, size: float, without: Collection[int] = ()
) -> list[Body]:
    """Nodes for all shapes that are drawn, but for those of the numbers ``without``."""
    out = []
    for number, shape in enumerate(shapes):
        something = len(shape.triangles) or len(shape.lines) or shape.skin is not None
        if shape.drawn and something and number not in without:
            out.append(Body(scene, number, shape, x, size))
    return out
