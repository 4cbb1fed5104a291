"""What is seen as a file: a picture, a film, a recording, a web page that needs nothing else."""

import io as streams
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from PIL import Image

from turnbuckle import io
from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.live.frame import Frame
from turnbuckle.live.served_page import standing_alone
from turnbuckle.live.server import serve
from turnbuckle.live.stage import Stage
from turnbuckle.viewer import open_picture
from turnbuckle.viewer.browser_camera import hold_camera, picture_from

T = TypeVar("T")
LARGEST = 200e6  # bytes of vertices in a web page, before they are packed; frames are left out beyond
# Films are made one after the other.
_drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="turnbuckle pictures")
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Look:
    """Where a person looks from."""

    eye: np.ndarray  # (3,) [m]
    target: np.ndarray  # (3,) [m]
    size: tuple[int, int]  # of the picture, in pixels


@dataclass(frozen=True)
class Take:
    """A row of frames to export."""

    shapes: list[Shape]
    up_axis: str
    size: float  # of the scene [m]
    frames_per_second: float
    times: Sequence[float]  # [s]
    x: Callable[[int], np.ndarray]  # frame -> (points, 3) [m]
    v: Callable[[int], np.ndarray]
    info: dict[str, Any]

    def __len__(self) -> int:
        return len(self.times)


def picture(take: Take, frame: int, look: Look) -> bytes:
    """A PNG of one frame."""

    def draw() -> bytes:
        out = streams.BytesIO()
        pixels = picture_from(take.shapes, take.x(frame), take.up_axis, look.size, look.eye, look.target)
        Image.fromarray(pixels).save(out, "PNG")
        return out.getvalue()

    return _drawing.submit(draw).result()


def film(take: Take, suffix: str, look: Look, progress: Progress | None = None) -> bytes:
    """A film, ``suffix`` ".gif" or ".mp4". Raises `InputError` where there are no frames, or ffmpeg is missing."""
    if len(take) < 2:
        raise InputError("a film needs frames: record some first")

    def draw() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"film{suffix}"
            recorder = open_picture(
                path, take.shapes, up_axis=take.up_axis, frames_per_second=take.frames_per_second, size=look.size
            )
            hold_camera(recorder, take.up_axis, look.eye, look.target)
            with recorder:
                for k in range(len(take)):
                    recorder.write(float(take.times[k]), take.x(k), take.v(k))
                    if progress is not None:
                        progress((k + 1) / len(take))
            return path.read_bytes()

    return _drawing.submit(draw).result()


def recording(take: Take) -> bytes:
    """A .npz that `turnbuckle view` plays. Raises `InputError` where there are no frames."""
    if not len(take):
        raise InputError("a recording needs frames: record some first")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.npz"
        out = io.open_recorder(
            path, take.shapes, up_axis=take.up_axis, frames_per_second=take.frames_per_second, info=take.info
        )
        with out:
            for k in range(len(take)):
                out.write(float(take.times[k]), take.x(k), take.v(k))
        return path.read_bytes()


def web_page(take: Take, look: Look | None = None, progress: Progress | None = None) -> str:
    """HTML that shows the frames, turned with the mouse, without a server; a still where there is one frame."""
    served = serve(label=str(take.info.get("scene", "")))
    try:
        stage = Stage(served.viser, take.shapes, take.x(0), take.up_axis, take.size)
        if look is not None:
            served.viser.initial_camera.position = look.eye
            served.viser.initial_camera.look_at = look.target
        moving = sum(12 * body.count for body in stage.bodies if not body.rigid and not body.shape.still)
        every = max(int(np.ceil(moving * len(take) / LARGEST)), 1)
        serializer = served.viser.get_scene_serializer()
        last = float(take.times[0])
        for k in range(0, len(take), every):
            serializer.insert_sleep(max(float(take.times[k]) - last, 0.0))
            last = float(take.times[k])
            stage.show(Frame(take.x(k)))
            if progress is not None:
                progress((k + 1) / len(take))
        if len(take) > 1:
            serializer.insert_sleep(1.0 / take.frames_per_second)
        return standing_alone(str(serializer.as_html()))
    finally:
        served.stop()
