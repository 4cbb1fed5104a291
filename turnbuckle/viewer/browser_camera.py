"""Pictures and films from where a person looks in the browser: a camera that stays, in place of one that follows."""

import numpy as np

from turnbuckle.data.shape import Shape
from turnbuckle.viewer.camera import Camera, Framing, upwards
from turnbuckle.viewer.pictures import PictureRecorder
from turnbuckle.viewer.render import Renderer


class HeldFraming(Framing):
    """Always the same eye; the box around the scene, for ground and light, is that of the first frame."""

    def __init__(self, up_axis: str, size: tuple[int, int], eye: np.ndarray, target: np.ndarray) -> None:
        super().__init__(up_axis, size, None)
        self._eye, self._target = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
        self._camera: Camera | None = None

    def follow(self, points: np.ndarray) -> Camera:
        """The camera, whatever the points [m], (n, 3)."""
        if self._camera is None:
            seen = points[np.isfinite(points).all(axis=1)]
            seen = seen if len(seen) else np.array([-np.ones(3), np.ones(3)])
            up = upwards(self._up_axis)
            self._camera = Camera(self._eye, self._target, up, seen.min(axis=0), seen.max(axis=0))
        return self._camera


def hold_camera(recorder: PictureRecorder | Renderer, up_axis: str, eye: np.ndarray, target: np.ndarray) -> None:
    """Let a renderer, or a recorder of films, look from ``eye`` to ``target`` [m]."""
    renderer = recorder.renderer if isinstance(recorder, PictureRecorder) else recorder
    renderer._framing = HeldFraming(up_axis, renderer.size, eye, target)


def picture_from(
    shapes: list[Shape], x: np.ndarray, up_axis: str, size: tuple[int, int], eye: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """A picture (height, width, 3) uint8 of the bodies at ``x`` (points, 3) [m], seen from ``eye``."""
    renderer = Renderer(shapes, up_axis, size)
    hold_camera(renderer, up_axis, eye, target)
    return renderer.frame(x)
