"""One picture of the bodies of a scene: by Polyscope where it works, else drawn with Pillow."""

from types import ModuleType

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.viewer import headless
from turnbuckle.viewer.backdrop import backdrop
from turnbuckle.viewer.camera import Framing
from turnbuckle.viewer.drawing import draw
from turnbuckle.viewer.geometry import SceneGeometry

ENGINES = ("auto", "polyscope", "pillow")


class Renderer:
    """Draws frames of the bodies ``shapes``. Several may be used side by side.

    ``size`` is (width, height) in pixels. ``bounds``, if given, are two corners [m] of a box that the camera keeps in
    view; otherwise it follows the motion, opening as far as it must. ``engine`` "auto" takes Polyscope if it starts;
    `note` says why it did not. Raises InputError for a wrong argument, or if the engine asked for cannot start.
    """

    def __init__(
        self,
        shapes: list[Shape],
        up_axis: str,
        size: tuple[int, int] = (1280, 720),
        bounds: tuple[np.ndarray, np.ndarray] | None = None,
        engine: str = "auto",
    ) -> None:
        if up_axis not in ("Y", "Z"):
            raise InputError(f"picture: up_axis is '{up_axis}'; use 'Y' or 'Z'")
        if not (len(size) == 2 and all(16 <= s <= 16384 for s in size)):
            raise InputError(f"picture: the size is {size}; give width and height from 16 to 16384 pixels")
        if engine not in ENGINES:
            raise InputError(f"picture: the engine '{engine}' is not known; use one of {', '.join(ENGINES)}")
        if bounds is not None and not np.isfinite(np.asarray(bounds, dtype=float)).all():
            raise InputError("picture: the bounds are not finite")
        self.size = (int(size[0]), int(size[1]))
        self.note: str | None = None  # what is missing for the better engine
        self._shapes, self._up_axis = shapes, up_axis
        self._geometry: SceneGeometry | None = None  # made of the first frame
        self._bounds = bounds
        self._framing = Framing(up_axis, self.size, bounds)
        self._polyscope: ModuleType | None = None
        self._view: headless.HeadlessView | None = None
        if engine != "pillow":
            started = headless.start()
            if not isinstance(started, str):
                self._polyscope = started
            elif engine == "polyscope":
                raise InputError(f"picture: {started}")
            else:
                self.note = started

    @property
    def engine(self) -> str:
        """What draws: "polyscope" or "pillow"."""
        return "pillow" if self._polyscope is None else "polyscope"

    def frame(self, x: np.ndarray, title: str | None = None, *, alone: bool = False) -> np.ndarray:
        """The picture (height, width, 3) uint8 of the positions ``x`` [m] of all points of the state, (points, 3).

        ``alone``: a picture by itself, not one of a film: the camera shows what there is now, wherever it was before.
        """
        x = np.asarray(x, dtype=np.float64)
        if self._geometry is None:
            self._geometry = SceneGeometry(self._shapes, x, self._up_axis)
            if self._polyscope is not None:
                self._view = headless.HeadlessView(self._polyscope, self._geometry, self._up_axis)
        framing = Framing(self._up_axis, self.size, self._bounds) if alone else self._framing
        camera = framing.follow(self._geometry.everything(x))
        behind = backdrop(self._geometry, x, camera, self.size)
        if self._view is not None:
            picture = self._view.draw(x, camera, behind)
        else:
            picture = draw(self._geometry, x, camera, behind)
        return picture if title is None else _titled(picture, title)


def _titled(picture: np.ndarray, title: str) -> np.ndarray:
    image = Image.fromarray(picture)
    height = max(12, picture.shape[0] // 34)
    ImageDraw.Draw(image).text((height, height * 0.8), title, fill=(70, 78, 92), font=ImageFont.load_default(height))
    return np.asarray(image)
