"""What every recorder can do, and the checks they share."""

import os
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from turnbuckle.data.errors import InputError


class Recorder(ABC):
    """Takes the frames of a run one by one. Use it in a ``with`` statement or call `close`.

    Memory does not grow with the number of frames, and after a kill everything up to the last `flush` can be read.
    """

    @abstractmethod
    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        """Add a frame: time [s], positions ``x`` [m] and velocities ``v`` [m/s] of all points, (points, 3).

        Raises InputError when the arrays change their shape between frames or the disk refuses.
        """

    @abstractmethod
    def flush(self) -> None:
        """Put all frames written so far where a kill cannot reach them."""

    @abstractmethod
    def close(self) -> None:
        """Finish the file; may be called again."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def check_target(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """The path, if a file of a known suffix can be put there. Raises InputError otherwise."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"recording {path}: the suffix '{path.suffix}' is not known; use one of {', '.join(suffixes)}")
    if not path.parent.is_dir():
        raise InputError(f"recording {path}: there is no folder {path.parent}; make it first")
    if path.is_dir():
        raise InputError(f"recording {path}: is a folder; give the name of a file")
    return path


def check_frame(path: Path, x: np.ndarray, v: np.ndarray, points: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Both arrays as contiguous float64 of shape (points, 3). Raises InputError for another shape."""
    x, v = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(v, dtype=np.float64)
    wanted = (len(x) if points is None else points, 3)
    if x.shape != wanted or v.shape != wanted:
        raise InputError(f"recording {path}: a frame has x of shape {x.shape} and v of {v.shape}; {wanted} is needed")
    return x, v


def reason(error: BaseException) -> str:
    """The library's words for what went wrong, on one line."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)  # HDF5 makes a page of it
    return " ".join(str(error).split())[:160] or type(error).__name__
