"""A run as NumPy arrays: ``np.load(path)`` gives ``time``, ``x``, ``v``, the topology and ``info`` (JSON).

A zip has its table at the end, so half a zip is no zip. While the run goes, frames are appended to ``NAME.npz.part``
(a header, then frames of one size: a torn last frame shows in the length); closing streams them into the .npz and
removes the .part. `read_npz` reads either, so a killed run loses nothing that was flushed.
"""

import io
import os
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io.recorder import Recorder, check_frame, reason
from turnbuckle.io.topology import pack, unpack

_MAGIC = b"TURNBUCKLEPART01"
_LENGTH = struct.Struct("<Q")
# What NumPy, zipfile and JSON raise for a file whose bytes were lost or changed.
BROKEN_FILE = (
    OSError, ValueError, KeyError, EOFError, TypeError, IndexError, AttributeError, NotImplementedError, RuntimeError,
    OverflowError, MemoryError, SyntaxError, tokenize.TokenError, struct.error, zlib.error, zipfile.BadZipFile,
)  # fmt: skip


class NpzRecorder(Recorder):
    """Writes .npz by way of .npz.part."""

    def __init__(self, path: Path, shapes: list[Shape], info: dict[str, Any]) -> None:
        self._path = path
        self._part = part_path(path)
        self._points: int | None = None
        arrays, text = pack(shapes, info)
        header = io.BytesIO()
        np.savez(header, info=np.array(text), **arrays)
        self._file: BinaryIO | None = open(self._part, "wb")  # closed in close()
        self._file.write(_MAGIC + _LENGTH.pack(header.tell()) + header.getvalue())
        self._file.flush()
        path.unlink(missing_ok=True)  # the run that is to come replaces it; a kill must not leave two

    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        x, v = check_frame(self._path, x, v, self._points)
        file = self._open()
        try:
            if self._points is None:
                file.write(_LENGTH.pack(len(x)))
                self._points = len(x)
            file.write(struct.pack("<d", time) + x.tobytes() + v.tobytes())
        except OSError as error:
            raise InputError(f"recording {self._path}: cannot be written ({reason(error)})") from None

    def flush(self) -> None:
        if self._file is not None:
            try:
                self._file.flush()
            except OSError as error:
                raise InputError(f"recording {self._path}: cannot be written ({reason(error)})") from None

    def close(self) -> None:
        if self._file is None:
            return
        self.flush()
        self._file.close()
        self._file = None
        try:
            _assemble(self._part, self._path)
        except OSError as error:
            raise InputError(
                f"recording {self._path}: cannot be written ({reason(error)}); the frames are safe in {self._part}"
            ) from None
        self._part.unlink()

    def _open(self) -> BinaryIO:
        if self._file is None:
            raise InputError(f"recording {self._path}: is closed; no frame can be added")
        return self._file


def part_path(path: Path) -> Path:
    """Where the frames of an unfinished .npz are."""
    return path.with_name(path.name + ".part")


def read_npz(path: str | Path) -> tuple[list[Shape], dict[str, Any], np.ndarray, np.ndarray, np.ndarray]:
    """Shapes, info, time [s] (frames,), x [m] and v [m/s] (frames, points, 3) of a finished or a killed recording.

    x and v are mapped from the file, not loaded. ``path`` may name the .npz or its .part. Raises InputError when it is
    no recording.
    """
    path = Path(path)
    part = path if path.suffix == ".part" else part_path(path)
    try:
        if part.exists():
            return _read_part(part)
        with zipfile.ZipFile(path) as archive, np.load(path, allow_pickle=False) as file:
            shapes, info = unpack(file, str(file["info"]))
            x, v = (_mapped(path, archive, name) for name in ("x", "v"))
            return shapes, info, file["time"], x, v
    except FileNotFoundError:
        raise InputError(f"recording {path}: there is no such file") from None
    except BROKEN_FILE as error:
        raise InputError(f"recording {path}: is no recording of Turnbuckle, or not whole ({reason(error)})") from None


def _read_part(part: Path) -> tuple[list[Shape], dict[str, Any], np.ndarray, np.ndarray, np.ndarray]:
    with part.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("another kind of file")
        (length,) = _LENGTH.unpack(file.read(_LENGTH.size))
        header = file.read(length)
        if len(header) < length:
            raise ValueError("it ends within its header")
        with np.load(io.BytesIO(header), allow_pickle=False) as arrays:
            shapes, info = unpack(arrays, str(arrays["info"]))
        count = file.read(_LENGTH.size)
        begin = file.tell()
    points = _LENGTH.unpack(count)[0] if len(count) == _LENGTH.size else 0
    layout = np.dtype([("time", "<f8"), ("x", "<f8", (points, 3)), ("v", "<f8", (points, 3))])
    frames = (part.stat().st_size - begin) // layout.itemsize if points else 0
    if not frames:
        return shapes, info, np.zeros(0), np.zeros((0, points, 3)), np.zeros((0, points, 3))
    rows = np.memmap(part, dtype=layout, mode="r", offset=begin, shape=(frames,))
    return shapes, info, np.array(rows["time"]), rows["x"], rows["v"]


def _assemble(part: Path, path: Path) -> None:
    """Stream the frames of the .part into a zip of .npy members, beside the target, and rename it."""
    _, _, time, x, v = _read_part(part)
    with part.open("rb") as file:
        file.seek(len(_MAGIC))
        header = io.BytesIO(file.read(_LENGTH.unpack(file.read(_LENGTH.size))[0]))
    beside = path.with_name(path.name + ".tmp")
    with zipfile.ZipFile(beside, "w", zipfile.ZIP_STORED) as archive:
        with zipfile.ZipFile(header) as topology:
            for name in topology.namelist():
                archive.writestr(name, topology.read(name))
        for name, rows in (("time", time), ("x", x), ("v", v)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array_header_2_0(member, {"descr": "<f8", "fortran_order": False, "shape": rows.shape})
                for row in rows:
                    member.write(np.ascontiguousarray(row).tobytes())
    os.replace(beside, path)


def _mapped(path: Path, archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """A member of the zip as an array over the file itself; loaded where it is compressed or empty."""
    entry = archive.getinfo(f"{name}.npy")
    with archive.open(entry) as member:
        version = npy.read_magic(member)
        shape, fortran, dtype = (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(member)
        header = member.tell()
        if entry.compress_type != zipfile.ZIP_STORED or fortran or 0 in shape:
            return np.frombuffer(member.read(), dtype=dtype).reshape(shape, order="F" if fortran else "C")
    with path.open("rb") as file:  # the member's own header has name and extra field of its own lengths
        file.seek(entry.header_offset + 26)
        name_length, extra_length = struct.unpack("<HH", file.read(4))
    offset = entry.header_offset + 30 + name_length + extra_length + header
    return np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape)
