"""Where the camera stands: so that a box of the scene fills the picture, seen from the front, the side and above."""

from dataclasses import dataclass

import numpy as np

FIELD_OF_VIEW = np.radians(32.0)  # vertical
_SIDE, _ABOVE = np.radians(28.0), np.radians(16.0)
_MARGIN = 1.12


@dataclass(frozen=True)
class Camera:
    """A perspective camera. The box it frames comes along, for the ground, the light and the depth."""

    eye: np.ndarray  # [m], (3,)
    target: np.ndarray  # [m], (3,)
    up: np.ndarray  # unit vector, (3,)
    low: np.ndarray  # [m], (3,), corner of the box
    high: np.ndarray  # [m], (3,)

    @property
    def diagonal(self) -> float:
        """Of the box [m]."""
        return float(np.linalg.norm(self.high - self.low))

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vectors to the right, up in the picture, and away from the eye."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        return right, np.cross(right, forward), forward

    def project(self, points: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, 2), x to the right and y down from the upper left corner, and depth [m] (n,) along the view."""
        right, up, forward = self.axes()
        offset = points - self.eye
        depth = offset @ forward
        scale = size[1] / (2 * np.tan(FIELD_OF_VIEW / 2)) / np.maximum(depth, 1e-3 * self.diagonal)
        pixels = np.stack([size[0] / 2 + scale * (offset @ right), size[1] / 2 - scale * (offset @ up)], axis=1)
        return pixels, depth


def upwards(up_axis: str) -> np.ndarray:
    """The unit vector of "Y" or "Z"."""
    return np.array([0.0, 1.0, 0.0]) if up_axis == "Y" else np.array([0.0, 0.0, 1.0])


def frame_box(low: np.ndarray, high: np.ndarray, up_axis: str, size: tuple[int, int]) -> Camera:
    """The camera that has all corners of the box [m] in a picture of ``size`` (width, height), as large as fits."""
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    thinnest = max(1e-3 * float((high - low).max()), 1e-6)
    low, high = np.minimum(low, high - thinnest), np.maximum(high, low + thinnest)
    up = upwards(up_axis)
    # "Front" looks along +y with z up, along -z with y up, so that x runs to the right either way.
    front = np.array([0.0, 0.0, 1.0]) if up_axis == "Y" else np.array([0.0, -1.0, 0.0])
    side = np.cross(up, front)
    towards_eye = np.cos(_ABOVE) * (np.cos(_SIDE) * front + np.sin(_SIDE) * side) + np.sin(_ABOVE) * up
    corners = np.array([[(low, high)[b >> k & 1][k] for k in range(3)] for b in range(8)])
    right, above, forward = Camera(towards_eye, np.zeros(3), up, low, high).axes()
    r, a, f = corners @ right, corners @ above, corners @ forward
    # A corner is in the picture of an eye at (er, ea, ef) if |a - ea| <= tangent (f - ef), and likewise for r. Each
    # inequality has two sides; both hold at once for ef up to a limit.
    tangent = np.tan(FIELD_OF_VIEW / 2) / _MARGIN
    wide = tangent * size[0] / size[1]
    top, bottom = (a - tangent * f).max(), (-a - tangent * f).max()
    east, west = (r - wide * f).max(), (-r - wide * f).max()
    ef = min(-(top + bottom) / (2 * tangent), -(east + west) / (2 * wide))
    eye = _middle(r, f - ef) * right + _middle(a, f - ef) * above + ef * forward
    return Camera(eye, eye + (f.mean() - ef) * forward, up, low, high)


def _middle(sideways: np.ndarray, depth: np.ndarray) -> float:
    """The place of the eye from which the outermost corners to both sides are seen under the same angle."""
    low, high = float(sideways.min()), float(sideways.max())
    for _ in range(50):
        middle = (low + high) / 2
        slope = (sideways - middle) / depth
        low, high = (middle, high) if slope.max() + slope.min() > 0 else (low, middle)
    return (low + high) / 2


class Framing:
    """A camera for motion not known ahead: it opens gently as bodies move on, and never closes in again.

    The first frame is given room around it, since a scene at rest is about to move; none below, where the ground is: what
    stands there shall not float above its shadow.
    """

    def __init__(self, up_axis: str, size: tuple[int, int], bounds: tuple[np.ndarray, np.ndarray] | None) -> None:
        self._up_axis, self._size = up_axis, size
        self._fixed = bounds is not None
        self._seen = None if bounds is None else np.array(bounds, dtype=np.float64)
        self._shown = None if bounds is None else np.array(bounds, dtype=np.float64)

    def follow(self, points: np.ndarray) -> Camera:
        """The camera for a frame with these points [m], (n, 3)."""
        points = points[np.isfinite(points).all(axis=1)]
        if not self._fixed and len(points):
            box = np.stack([points.min(axis=0), points.max(axis=0)])
            if self._seen is None or self._shown is None:
                room = 0.06 * np.linalg.norm(box[1] - box[0])
                below = room * (1.0 - upwards(self._up_axis))
                self._seen = self._shown = box + np.stack([-below, np.full(3, room)])
            else:
                self._seen = np.stack([np.minimum(self._seen[0], box[0]), np.maximum(self._seen[1], box[1])])
                self._shown = self._shown + 0.2 * (self._seen - self._shown)
        if self._shown is None:
            return frame_box(-np.ones(3), np.ones(3), self._up_axis, self._size)
        return frame_box(self._shown[0], self._shown[1], self._up_axis, self._size)
