"""Pictures by Polyscope in a window that is not there (EGL).

Polyscope is one per process: it is started once, when the first picture is asked for, and shows the bodies of one
renderer at a time. Its context belongs to the thread that started it, so that all its work is done in a thread of its own,
whoever asks: a run, a notebook, the page in the browser.
"""

import atexit
import contextlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType
from typing import Any

import numpy as np
from PIL import Image

from turnbuckle.viewer.camera import FIELD_OF_VIEW, Camera
from turnbuckle.viewer.geometry import SceneGeometry

_TONE = 1.6  # the "clay" material pales colours; this power brings them back

_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="turnbuckle pictures")
_started: dict[str, Any] = {}  # "polyscope": the module, or "missing": why there is none
_shown: list["HeadlessView"] = []  # the view whose bodies Polyscope holds


def start() -> ModuleType | str:
    """Polyscope, started; or a sentence that says what is missing."""
    return _thread.submit(_start_once).result()


def _start_once() -> ModuleType | str:
    if not _started:
        try:
            with _no_farewell():
                import polyscope  # only when a picture is asked for

                _start(polyscope)
            _started["polyscope"] = polyscope
        except Exception as error:  # whatever it is, the simulation goes on and the picture is drawn another way
            _started["missing"] = _advice(error)
    return _started.get("polyscope", _started.get("missing"))


@contextlib.contextmanager
def _no_farewell() -> Iterator[None]:
    """If the body fails, take back what it registered for the end of the process.

    Polyscope registers its shutdown before it has started, and that shutdown complains if it never did.
    """
    taken: list[Callable[..., Any]] = []
    register = atexit.register

    def note(action: Callable[..., Any], *arguments: Any, **named: Any) -> Callable[..., Any]:
        taken.append(action)
        return register(action, *arguments, **named)

    atexit.register = note  # type: ignore[assignment]
    try:
        yield
    except BaseException:
        for action in taken:
            atexit.unregister(action)
        raise
    finally:
        atexit.register = register


def _start(polyscope: ModuleType) -> None:
    polyscope.set_verbosity(0)
    polyscope.set_use_prefs_file(False)
    polyscope.set_errors_throw_exceptions(True)
    polyscope.set_allow_headless_backends(True)
    polyscope.set_autocenter_structures(False)
    polyscope.set_autoscale_structures(False)
    polyscope.init("openGL3_egl")
    polyscope.set_automatically_compute_scene_extents(False)
    polyscope.set_ground_plane_mode("none")  # its shadows take a second a frame where the processor draws
    polyscope.set_view_projection_mode("perspective")
    polyscope.set_SSAA_factor(2)


def _advice(error: Exception) -> str:
    reason = " ".join(str(error).split())[:120] or type(error).__name__
    if isinstance(error, ModuleNotFoundError):
        return "polyscope is not installed (pip install polyscope); pictures are drawn with Pillow"
    return (
        f"Polyscope cannot open a headless window ({reason}); install EGL for it (Debian, Ubuntu: "
        "apt install libegl1 libgl1-mesa-dri libx11-6); pictures are drawn with Pillow"
    )


class HeadlessView:
    """The bodies of one renderer in Polyscope."""

    def __init__(self, polyscope: ModuleType, geometry: SceneGeometry, up_axis: str) -> None:
        self._polyscope = polyscope
        self._geometry = geometry
        self._up_axis = up_axis
        self._structures: dict[str, Any] = {}

    def draw(self, x: np.ndarray, camera: Camera, backdrop: Image.Image) -> np.ndarray:
        """A picture (height, width, 3) uint8 of all bodies at ``x`` [m] (points, 3) before the backdrop."""
        return _thread.submit(self._draw, x, camera, backdrop).result()

    def _draw(self, x: np.ndarray, camera: Camera, backdrop: Image.Image) -> np.ndarray:
        polyscope, size = self._polyscope, backdrop.size
        if not _shown or _shown[0] is not self:
            self._register(x)
            self._draw(x, camera, backdrop)  # the first picture still has traces of the view before it: not taken
        polyscope.set_window_size(*size)
        for kind, structure in self._structures.items():
            vertices = self._geometry.vertices(kind, x)
            if kind == "lines":
                structure.update_node_positions(vertices)
                structure.set_radius(0.0025 * camera.diagonal, relative=False)
            else:
                structure.update_vertex_positions(vertices)
        polyscope.set_length_scale(camera.diagonal)
        polyscope.set_bounding_box(camera.low, camera.high)
        intrinsics = polyscope.CameraIntrinsics(
            fov_vertical_deg=float(np.degrees(FIELD_OF_VIEW)), aspect=size[0] / size[1]
        )
        extrinsics = polyscope.CameraExtrinsics(root=camera.eye, look_dir=camera.target - camera.eye, up_dir=camera.up)
        polyscope.set_view_camera_parameters(polyscope.CameraParameters(intrinsics, extrinsics))
        drawn = polyscope.screenshot_to_buffer(transparent_bg=True)
        image = backdrop.convert("RGBA")
        image.alpha_composite(Image.fromarray(np.ascontiguousarray(drawn)))
        return np.asarray(image.convert("RGB"))

    def _register(self, x: np.ndarray) -> None:
        polyscope, geometry = self._polyscope, self._geometry
        polyscope.remove_all_structures()
        polyscope.set_up_dir("y_up" if self._up_axis == "Y" else "z_up")
        self._structures = {}
        if len(geometry.surface.cells):
            mesh = polyscope.register_surface_mesh(
                "surface", geometry.vertices("surface", x), geometry.surface.cells, smooth_shade=True, material="clay"
            )
            mesh.set_back_face_policy("identical")
            mesh.add_color_quantity("body", geometry.surface.colors**_TONE, defined_on="faces", enabled=True)
            self._structures["surface"] = mesh
        if len(geometry.lines.cells):
            curves = polyscope.register_curve_network(
                "lines", geometry.vertices("lines", x), geometry.lines.cells, material="clay"
            )
            curves.add_color_quantity("body", geometry.lines.colors**_TONE, defined_on="edges", enabled=True)
            self._structures["lines"] = curves
        _shown[:] = [self]
