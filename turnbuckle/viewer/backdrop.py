"""What stands behind the bodies: a soft ground and their shadow on it, straight below."""

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from turnbuckle.viewer.camera import Camera
from turnbuckle.viewer.geometry import SceneGeometry

_FAR, _NEAR = np.array([247.0, 249.0, 252.0]), np.array([222.0, 226.0, 233.0])
_SHADOW_COLOR, _SHADOW = (64, 72, 90), 0.34


def backdrop(geometry: SceneGeometry, x: np.ndarray, camera: Camera, size: tuple[int, int]) -> Image.Image:
    """The picture without the bodies. The ground is the scene's, else the bottom of the camera's box."""
    blend = np.linspace(0, 1, size[1])[:, None, None] ** 1.5
    rows = np.repeat((1 - blend) * _FAR + blend * _NEAR, size[0], axis=1)
    image = Image.fromarray(np.round(rows).astype(np.uint8))
    axis = int(np.argmax(camera.up))
    small = (max(size[0] // 3, 1), max(size[1] // 3, 1))
    mask = Image.new("L", small, 0)
    pen = ImageDraw.Draw(mask)
    for kind in ("surface", "lines"):
        fallen = geometry.vertices(kind, x)
        fallen[:, axis] = camera.low[axis] if geometry.ground is None else geometry.ground
        pixels, depth = camera.project(fallen, small)
        sound = np.isfinite(pixels).all(axis=1) & (depth > 1e-3 * camera.diagonal)
        cells = getattr(geometry, kind).cells
        for outline in pixels[cells[sound[cells].all(axis=1)]].tolist():
            corners = [tuple(p) for p in outline]
            if len(corners) == 3:
                pen.polygon(corners, fill=255, outline=255)
            else:
                pen.line(corners, fill=200, width=2)
    mask = mask.filter(ImageFilter.GaussianBlur(small[1] / 70)).resize(size, Image.Resampling.BILINEAR)
    image.paste(_SHADOW_COLOR, (0, 0, *size), mask.point(lambda value: int(value * _SHADOW)))
    return image
