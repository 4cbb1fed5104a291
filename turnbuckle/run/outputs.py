"""The recordings of a run: opened before it starts, fed at the frame rate, closed whole whatever happens."""

import re
import tempfile
import time
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from turnbuckle import io, viewer
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Model
from turnbuckle.data.state import State

FLUSH = 1.0  # seconds of wall time between two flushes at least
FLUSH_PART = 0.05  # of the wall time that flushes may take
SLACK = 1e-6  # of a frame: what the adding up of steps may miss the time of a frame by
SUFFIXES = (*io.SUFFIXES, *viewer.SUFFIXES)
_NUMBERED = re.compile(r"%0?\d*d")  # a picture a frame


class RecordingError(StepError):
    """A recording cannot be written any further."""


class _Recorder(Protocol):
    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None: ...
    def flush(self) -> None: ...
    def close(self) -> None: ...


def _followed(path: Path) -> Path:
    """Where a link points: it is the target that is written, not the link that is replaced."""
    return path.resolve() if path.is_symlink() else path


def check_outputs(out: Sequence[str | PathLike[str]], report: Path | None, checkpoint: Path | None) -> list[Path]:
    """The recordings as paths, if all that is to be written can be. Raises InputError."""
    paths = [_followed(Path(p)) for p in out]
    report, checkpoint = (None if p is None else _followed(p) for p in (report, checkpoint))
    for path in paths:
        if path.suffix.lower() not in SUFFIXES:
            raise InputError(
                f"recording {path}: the suffix '{path.suffix}' is not known; use one of {', '.join(SUFFIXES)}"
            )
    named = [("recording", p) for p in paths] + [("report", report), ("checkpoint", checkpoint)]
    taken: dict[Path, str] = {}
    for what, target in named:
        if target is None:
            continue
        if target.is_dir():
            raise InputError(f"{what} {target}: is a folder; give the name of a file")
        if target.exists() and not target.is_file():
            raise InputError(f"{what} {target}: is a device or the like, not a file; give the name of a file")
        if not target.parent.is_dir():
            raise InputError(f"{what} {target}: there is no folder {target.parent}; make it first")
        try:
            with tempfile.TemporaryFile(dir=target.parent):
                pass
        except OSError as error:
            raise InputError(
                f"{what} {target}: cannot be written ({error.strerror or error}); choose another place"
            ) from None
        place = target.absolute()
        if place in taken:
            raise InputError(f"{what} {target}: is named for the {taken[place]} already; give each file its own name")
        taken[place] = what
    return paths


def fresh_name(path: Path, steps: int) -> Path:
    """Where a resumed run records: ``path``, or a name with the step in it where an earlier recording is in the way."""
    if path.suffix.lower() == ".png" and not _NUMBERED.search(path.name):
        return path  # the last frame alone: a newer one takes its place
    new, number = path, 1
    while _is_taken(new):
        again = f"_{number}" if number > 1 else ""
        new = path.with_name(f"{path.stem}_from_step_{steps}{again}{path.suffix}")
        number += 1
    return new


def _is_taken(path: Path) -> bool:
    """Whether there is a recording, whole or left by a run that was killed, or the first picture of a numbered row."""
    names = [path.name, f"{path.name}.part", f"{path.name}.part.usdc"]
    names.append(_NUMBERED.sub(lambda found: found.group() % 0, path.name, count=1))
    return any(path.with_name(name).exists() for name in names)


class Outputs:
    """All recordings of a run."""

    def __init__(
        self,
        paths: Sequence[Path],
        model: Model,
        frames_per_second: float,
        info: dict[str, Any],
        picture_size: tuple[int, int] = (1280, 720),
    ) -> None:
        """Open them. Raises InputError; those already open are closed then."""
        self.notes: list[str] = []
        self.paths: list[Path] = []
        self._recorders: list[_Recorder] = []
        self._rate = frames_per_second
        self._written: float | None = None
        self._flushed = time.perf_counter()
        self._rest = FLUSH
        self.next_frame = np.inf if not paths else -np.inf  # simulated time from which a frame is due [s]
        try:
            for path in paths:
                shapes, given = list(model.shapes), {"up_axis": model.up_axis, "frames_per_second": frames_per_second}
                recorder: _Recorder
                if path.suffix.lower() in io.SUFFIXES:
                    recorder = io.open_recorder(path, shapes, info=info, **given)
                else:
                    recorder = viewer.open_picture(path, shapes, info=info, size=picture_size, **given)
                self._recorders.append(recorder)
                self.paths.append(path)
                note = getattr(recorder, "note", None)
                if note:
                    self.notes.append(note)
        except BaseException:
            self.close()
            raise

    def write(self, state: State) -> None:
        """A frame of the state as it is. Raises `RecordingError`."""
        at = float(state.time)
        self.next_frame = (np.floor(at * self._rate + SLACK) + 1.0 - SLACK) / self._rate
        if not self._recorders or self._written == at:
            return
        x, v = state.positions(), state.velocities()
        self._all(lambda recorder: recorder.write(at, x, v), f"the run has ended at t = {at:.6g} s")
        self._written = at
        if time.perf_counter() - self._flushed > self._rest:
            self.flush()

    def flush(self) -> None:
        """Put all frames where a kill cannot reach them. Raises `RecordingError`."""
        began = time.perf_counter()
        self._all(lambda recorder: recorder.flush(), "the run has ended")
        self._flushed = time.perf_counter()
        self._rest = max(FLUSH, (self._flushed - began) / FLUSH_PART)

    def _all(self, action: Callable[[_Recorder], None], end: str) -> None:
        """Do something with every recorder, also when one fails. Raises `RecordingError` for the first that does."""
        failed: Exception | None = None
        for recorder in self._recorders:
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # a scene that flies apart leaves float32 first
                    action(recorder)
            except (OSError, InputError) as error:
                failed = failed or error
        if failed is not None:
            raise RecordingError(f"{failed}; {end}") from failed

    def close(self) -> list[str]:
        """Finish every file, also when another cannot be; what went wrong, a sentence each."""
        problems = []
        for recorder in self._recorders:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    recorder.close()
            except (OSError, InputError) as error:
                problems.append(str(error))
        self._recorders = []
        return problems
