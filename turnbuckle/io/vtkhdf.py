"""A run as VTKHDF, which ParaView and VTK open as an animated unstructured grid, and the exact state beside it.

``/VTKHDF`` is what a person looks at (float32): the points, after them the vertices of all skins; lines, triangles and
tetrahedra, with the number of the body on each cell. The topology is written once, and every step points at it.
``/state`` is what a program reads (float64): time, x, v, topology, info.

Kill-proof: room for many frames is laid out ahead, so that adding a frame moves no table of the file. Its numbers are
written into their place and then, last and in one piece, the attribute ``NSteps`` says that they count. Only while
room is doubled (some ten times in a run of ten thousand frames, about a millisecond each) may a kill hurt the file;
where that is too much, record .npz too, which has no such moment.

HDF5 does not survive a write that the disk refuses, so room is asked of the disk first (`_reserve`): a disk that is full
ends the recording with all its frames.
"""

import errno
import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io.npz import BROKEN_FILE
from turnbuckle.io.recorder import Recorder, check_frame, reason
from turnbuckle.io.topology import pack, unpack

_FIRST_ROOM = 32  # frames
_LARGEST_GROWTH = 1 << 29  # bytes laid out ahead at most
_TABLES = 1 << 16  # bytes that headers and tables of the file take beside its numbers
_VTK_LINE, _VTK_TRIANGLE, _VTK_TETRA = 3, 5, 10


class VtkHdfRecorder(Recorder):
    """Writes .vtkhdf."""

    def __init__(self, path: Path, shapes: list[Shape], info: dict[str, Any]) -> None:
        self._path = path
        self._shapes = shapes
        self._points: int | None = None
        self._frames = 0
        self._room = 0
        self._series: dict[str, tuple[h5py.Dataset, int]] = {}  # what grows: by name, with its rows a frame
        arrays, text = pack(shapes, info)
        _ask_for(path, sum(array.nbytes for array in arrays.values()) + len(text) + _TABLES)
        self._file: h5py.File | None = h5py.File(path, "w", rdcc_nbytes=0)
        state = self._file.create_group("state")
        state.attrs["info"] = text
        topology = state.create_group("topology")
        for name, array in arrays.items():
            topology.create_dataset(name, data=array)
        self._file.flush()

    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        x, v = check_frame(self._path, x, v, self._points)
        if self._file is None:
            raise InputError(f"recording {self._path}: is closed; no frame can be added")
        try:
            if self._points is None:
                self._lay_out(len(x))
            if self._frames == self._room:
                self._grow()
            at = self._frames
            frame = {"Points": self._with_skins(x), "PointData/velocity": self._with_skins(v)}
            frame |= {"Values": time, "time": time, "x": x, "v": v}
            for name, values in frame.items():
                series, rows = self._series[name]
                series[at * rows : (at + 1) * rows] = values
            self._frames += 1
        except (OSError, RuntimeError) as error:
            raise InputError(f"recording {self._path}: cannot be written ({reason(error)})") from None

    def flush(self) -> None:
        if self._file is None or self._points is None:
            return
        try:
            self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self._frames))
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"recording {self._path}: cannot be written ({reason(error)})") from None

    def close(self) -> None:
        if self._file is None:
            return
        self.flush()
        for series, rows in self._series.values():  # give back the room that was not used
            series.resize(self._frames * rows, axis=0)
        self._series = {}
        self._file.close()
        self._file = None

    def _with_skins(self, values: np.ndarray) -> np.ndarray:
        """Values of all points, and after them of all skin vertices: a skin carries velocities as it does positions."""
        skins = [shape.skin.positions(values) for shape in self._shapes if shape.skin is not None]
        return np.concatenate([values, *skins]).astype(np.float32)

    def _lay_out(self, points: int) -> None:
        """All groups and the constant topology, for states of so many points."""
        assert self._file is not None
        cells, kinds, bodies, self._drawn = _cells(self._shapes, points)
        self._reserve(sum(rows.nbytes for rows in cells) * 2 + 32 * len(kinds))
        grid = self._file.create_group("VTKHDF")
        grid.attrs["Version"] = np.array([2, 2], dtype=np.int64)
        grid.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", len("UnstructuredGrid")))
        sizes = np.concatenate([np.zeros(0), *(np.full(len(rows), rows.shape[1]) for rows in cells)])
        connectivity = np.concatenate([np.zeros(0, np.int64), *(rows.ravel() for rows in cells)])
        grid["NumberOfPoints"] = np.array([self._drawn], dtype=np.int64)
        grid["NumberOfCells"] = np.array([len(kinds)], dtype=np.int64)
        grid["NumberOfConnectivityIds"] = np.array([len(connectivity)], dtype=np.int64)
        grid["Connectivity"] = connectivity
        grid["Offsets"] = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        grid["Types"] = kinds
        grid["CellData/body"] = bodies
        self._add(grid, "Points", self._drawn, (3,), np.float32)
        self._add(grid, "PointData/velocity", self._drawn, (3,), np.float32)
        steps = grid.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(0)
        self._add(steps, "Values", 1, (), np.float64)
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets", "PointDataOffsets/velocity"):
            self._add(steps, name, 1, (), np.int64)
        self._add(steps, "CellDataOffsets/body", 1, (), np.int64)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            self._add(steps, name, 1, (1,), np.int64)
        state = self._file["state"]
        self._add(state, "time", 1, (), np.float64)
        self._add(state, "x", 1, (points, 3), np.float64)
        self._add(state, "v", 1, (points, 3), np.float64)
        self._points = points

    def _add(self, group: h5py.Group, name: str, rows: int, item: tuple[int, ...], dtype: type) -> None:
        """A dataset of ``rows`` rows a frame, that can grow."""
        size = int(np.prod(item, dtype=np.int64)) * np.dtype(dtype).itemsize
        chunk = rows if rows * size >= 4096 else max(1, 4096 // size)
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        properties.set_chunk((max(chunk, 1), *item))
        space = h5py.h5s.create_simple((0, *item), (h5py.h5s.UNLIMITED, *item))
        links = h5py.h5p.create(h5py.h5p.LINK_CREATE)
        links.set_create_intermediate_group(True)
        made = h5py.h5d.create(group.id, name.encode(), h5py.h5t.py_create(np.dtype(dtype)), space, properties, links)
        self._series[name] = (h5py.Dataset(made), rows)

    def _grow(self) -> None:
        """Lay out room for more frames, with all that is known of them ahead."""
        assert self._file is not None
        frame = sum(np.prod(s.shape[1:], dtype=np.int64) * s.dtype.itemsize * rows for s, rows in self._series.values())
        room = max(_FIRST_ROOM, 2 * self._room)
        room = min(room, self._room + max(_FIRST_ROOM, int(_LARGEST_GROWTH // max(int(frame), 1))))
        self._reserve(int(frame) * (room - self._room))
        for series, rows in self._series.values():
            series.resize(room * rows, axis=0)
        first = np.arange(self._room, room, dtype=np.int64) * self._drawn  # point of each frame
        for name, ahead in {
            "PartOffsets": 0 * first,
            "NumberOfParts": 0 * first + 1,
            "PointOffsets": first,
            "PointDataOffsets/velocity": first,
            "CellDataOffsets/body": 0 * first,
            "CellOffsets": 0 * first[:, None],
            "ConnectivityIdOffsets": 0 * first[:, None],
        }.items():
            self._series[name][0][self._room : room] = ahead
        self._file.flush()
        self._room = room

    def _reserve(self, size: int) -> None:
        """Have the disk promise so many bytes more, and what tables take. Raises OSError while the file is still whole."""
        assert self._file is not None
        self._file.flush()
        _ask_for(self._path, os.path.getsize(self._path) + size + _TABLES)


def _ask_for(path: Path, size: int) -> None:
    """Make room on the disk for a file of ``size`` bytes, where the system can. Raises OSError."""
    if not hasattr(os, "posix_fallocate"):
        return
    with open(path, "ab") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.EOPNOTSUPP):  # a file system that makes no promises
                return
            raise


def _cells(shapes: list[Shape], points: int) -> tuple[list[np.ndarray], np.ndarray, np.ndarray, int]:
    """Cells of all bodies over the points and skin vertices (one array for each body and kind), the kind and the body
    of each cell, and how many points are drawn. A solid's boundary is not repeated: its tetrahedra have it.
    """
    cells: list[np.ndarray] = []
    kinds: list[np.ndarray] = [np.zeros(0, np.uint8)]
    bodies: list[np.ndarray] = [np.zeros(0, np.int32)]
    drawn = points
    for number, shape in enumerate(shapes):
        if not shape.drawn:
            drawn += 0 if shape.skin is None else len(shape.skin.points)  # its points stay, and are in no cell
            continue
        parts = [(_VTK_LINE, shape.lines + shape.begin), (_VTK_TETRA, shape.tetrahedra + shape.begin)]
        if shape.skin is not None:
            parts.append((_VTK_TRIANGLE, shape.skin.triangles + drawn))
            drawn += len(shape.skin.points)
        elif not len(shape.tetrahedra):
            parts.append((_VTK_TRIANGLE, shape.triangles + shape.begin))
        for kind, rows in parts:
            cells.append(rows)
            kinds.append(np.full(len(rows), kind, dtype=np.uint8))
            bodies.append(np.full(len(rows), number, dtype=np.int32))
    return cells, np.concatenate(kinds), np.concatenate(bodies), drawn


def read_vtkhdf(
    path: str | Path,
) -> tuple[list[Shape], dict[str, Any], np.ndarray, Callable[[str, int], np.ndarray]]:
    """Shapes, info, times [s] (frames,), and a function (``"x"`` or ``"v"``, frame) -> (points, 3) float64.

    Reads finished and killed recordings. Raises InputError when the file is none.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"recording {path}: there is no such file")
    try:
        with h5py.File(path, "r") as file:
            state = file["state"]
            arrays = {name: dataset[()] for name, dataset in state["topology"].items()}
            shapes, info = unpack(arrays, state.attrs["info"])
            frames = int(file["VTKHDF/Steps"].attrs["NSteps"]) if "VTKHDF" in file else 0
            times = state["time"][:frames] if frames else np.zeros(0)
    except BROKEN_FILE as error:
        raise InputError(f"recording {path}: is no recording of Turnbuckle, or not whole ({reason(error)})") from None
    return shapes, info, times, functools.partial(_fetch, path, frames)


def _fetch(path: Path, frames: int, name: str, frame: int) -> np.ndarray:
    try:
        with h5py.File(path, "r") as file:
            return file["state"][name][range(frames)[frame]]
    except IndexError:
        raise
    except BROKEN_FILE as error:
        raise InputError(f"recording {path}: frame {frame} cannot be read ({reason(error)})") from None
