"""Recorders of pictures and films, with the same methods as those of the data formats.

.png is the last frame (``name_%04d.png`` keeps them all), .gif and .mp4 are films.
"""

import os
import re
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from PIL import Image

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.viewer.gif import GifWriter
from turnbuckle.viewer.render import Renderer

SUFFIXES = (".png", ".gif", ".mp4")
_PATTERN = re.compile(r"%0?\d*d")


class _Film(Protocol):
    def add(self, picture: np.ndarray) -> None: ...
    def flush(self) -> None: ...
    def close(self) -> None: ...


class PictureRecorder:
    """Renders frames as a run goes. Memory does not grow; after a kill, what was flushed can be seen."""

    def __init__(self, path: Path, renderer: Renderer, film: _Film, title: bool, only_last: bool) -> None:
        self.renderer = renderer
        self._path, self._film, self._title = path, film, title
        self._only_last = only_last
        self._waiting: tuple[float, np.ndarray] | None = None  # the frame not drawn yet
        self._open = True

    @property
    def note(self) -> str | None:
        """A sentence for the user if pictures are drawn the simpler way, with what to install."""
        return self.renderer.note

    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        """Add a frame: time [s], positions ``x`` [m] and velocities ``v`` [m/s] (not drawn), (points, 3)."""
        if not self._open:
            raise InputError(f"picture {self._path}: is closed; no frame can be added")
        self._waiting = (float(time), np.array(x, dtype=np.float64))
        if not self._only_last:
            self._draw()

    def flush(self) -> None:
        """Put everything on the disk."""
        if self._open:
            self._draw()
            self._guard(self._film.flush)

    def close(self) -> None:
        """Finish the file; may be called again."""
        if self._open:
            try:
                self._draw()
            finally:
                self._open = False
                self._guard(self._film.close)

    def _draw(self) -> None:
        if self._waiting is None:
            return
        time, x = self._waiting
        self._waiting = None
        picture = self.renderer.frame(x, title=f"{time:.3f} s" if self._title else None, alone=self._only_last)
        self._guard(lambda: self._film.add(picture))

    def _guard(self, action: Any) -> None:
        try:
            action()
        except OSError as error:
            raise InputError(f"picture {self._path}: cannot be written ({error.strerror or error})") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_picture(
    path: str | Path,
    shapes: list[Shape],
    *,
    up_axis: str,
    frames_per_second: float,
    info: dict[str, Any] | None = None,
    size: tuple[int, int] = (1280, 720),
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    title: bool = True,
    engine: str = "auto",
) -> PictureRecorder:
    """Start a picture or film of the bodies ``shapes``; the suffix of ``path`` (one of `SUFFIXES`) chooses.

    ``title`` writes the time into the picture; `info` is taken for likeness with the other recorders and not used; the
    rest as for `Renderer`. A file already there is replaced. Raises InputError, before anything has run, for an
    unknown suffix, a folder that does not exist, a place that cannot be written to, or where .mp4 needs imageio-ffmpeg.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"picture {path}: the suffix '{path.suffix}' is not known; use one of {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise InputError(f"picture {path}: there is no folder {path.parent}; make it first")
    if path.is_dir():
        raise InputError(f"picture {path}: is a folder; give the name of a file")
    if not (np.isfinite(frames_per_second) and frames_per_second > 0):
        raise InputError(f"picture {path}: frames_per_second is {frames_per_second}; give a positive number")
    if suffix == ".mp4":  # the encoding halves the colours' resolution, which needs even sizes
        size = (int(size[0]) // 2 * 2, int(size[1]) // 2 * 2)
    try:
        film: _Film
        if suffix == ".mp4":
            film = _Mp4(path, size, frames_per_second)
        elif suffix == ".gif":
            film = _Gif(path, size, frames_per_second)
        else:
            film = _Pngs(path)
    except OSError as error:
        raise InputError(
            f"picture {path}: cannot be written ({error.strerror or error}); choose another place"
        ) from None
    only_last = suffix == ".png" and not _PATTERN.search(path.name)
    try:
        return PictureRecorder(path, Renderer(shapes, up_axis, size, bounds, engine), film, title, only_last)
    except InputError:
        film.close()
        raise


class _Pngs:
    """One file over and over, or one each if the name has a number's pattern. Written beside and renamed."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._numbered = bool(_PATTERN.search(path.name))
        self._count = 0
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(13, "the folder is not writable")

    def add(self, picture: np.ndarray) -> None:
        name = self._path.name
        if self._numbered:
            name = _PATTERN.sub(lambda found: found.group() % self._count, name, count=1)
        beside = self._path.with_name(f".{name}.tmp")
        Image.fromarray(picture).save(beside, "PNG")
        os.replace(beside, self._path.with_name(name))
        self._count += 1

    def flush(self) -> None:
        pass

    def close(self) -> None:
        pass


class _Gif:
    def __init__(self, path: Path, size: tuple[int, int], frames_per_second: float) -> None:
        self._file = path.open("wb")  # closed in close()
        self._writer = GifWriter(self._file, size, frames_per_second)
        self._file.flush()

    def add(self, picture: np.ndarray) -> None:
        self._writer.write(picture)

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


class _Mp4:
    """ffmpeg, which imageio-ffmpeg brings along, fed through a pipe; in fragments, each playable once written.

    If this process is killed, the pipe ends and ffmpeg finishes the film by itself.
    """

    def __init__(self, path: Path, size: tuple[int, int], frames_per_second: float) -> None:
        try:
            import imageio_ffmpeg  # optional extra

            program = imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise InputError(
                f"picture {path}: .mp4 needs imageio-ffmpeg; run: pip install 'turnbuckle[film]' (or write a .gif)"
            ) from None
        path.open("wb").close()  # whether it can be written shows now
        command = [program, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        command += ["-s", f"{size[0]}x{size[1]}", "-r", f"{frames_per_second:.6f}", "-i", "-"]
        command += ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-preset", "veryfast"]
        command += ["-g", f"{max(1, round(frames_per_second))}", "-threads", "2"]
        command += ["-movflags", "+frag_keyframe+empty_moov+default_base_moof", "-f", "mp4", str(path.absolute())]
        self._path = path
        self._program = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
        )

    def add(self, picture: np.ndarray) -> None:
        assert self._program.stdin is not None
        try:
            self._program.stdin.write(np.ascontiguousarray(picture).tobytes())
        except BrokenPipeError:
            self._fail()

    def flush(self) -> None:
        assert self._program.stdin is not None
        try:
            self._program.stdin.flush()
        except BrokenPipeError:
            self._fail()

    def close(self) -> None:
        assert self._program.stdin is not None and self._program.stderr is not None
        if self._program.stdin.closed:
            return
        try:
            self._program.stdin.close()
        except BrokenPipeError:
            pass
        words = self._program.stderr.read()
        self._program.stderr.close()
        if self._program.wait():
            raise InputError(f"picture {self._path}: ffmpeg failed ({_last_line(words)})")

    def _fail(self) -> None:
        assert self._program.stderr is not None
        raise InputError(f"picture {self._path}: ffmpeg failed ({_last_line(self._program.stderr.read())})")


def _last_line(words: bytes) -> str:
    lines = words.decode(errors="replace").strip().splitlines()
    return lines[-1][:160] if lines else "no message"
