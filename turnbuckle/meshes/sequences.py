"""Sequences of meshes of one topology: an animated character, read from an .npz or a folder of OBJ files."""

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.read import SurfaceMesh, read_mesh

FRAME_RATE = 25.0  # [1/s] where neither the file nor the user says


@dataclass(frozen=True)
class MeshSequence:
    """Vertices at some times; between them they go straight, before and after they stay."""

    vertices: np.ndarray  # (k, n, 3) float64 [m]
    triangles: np.ndarray  # (m, 3) int32
    times: np.ndarray  # (k,) increasing [s]

    def at(self, t: float) -> np.ndarray:
        """Vertices (n, 3) [m] at time ``t`` [s]."""
        k = int(np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 1))
        if k == len(self.times) - 1 or t <= self.times[0]:
            return self.vertices[k].copy()
        part = (t - self.times[k]) / (self.times[k + 1] - self.times[k])
        return (1.0 - part) * self.vertices[k] + part * self.vertices[k + 1]


def frame_times(count: int, times: np.ndarray | None, frame_rate: float | None) -> np.ndarray:
    """Times (count,) [s] of frames: as given, or evenly from 0. Raises InputError where the counts differ."""
    if times is None:
        return np.arange(count) / (FRAME_RATE if frame_rate is None else frame_rate)
    if len(times) != count:
        raise InputError(f"there are {len(times)} times for {count} frames; give one for each")
    return np.asarray(times, dtype=np.float64)


def read_sequence(path: str | Path, times: np.ndarray | None = None, frame_rate: float | None = None) -> MeshSequence:
    """Read an .npz (``verts`` (k, n, 3), ``faces`` (m, 3), and ``dt`` or ``times``) or a folder of OBJ files.

    ``times`` (k,) [s] or ``frame_rate`` [1/s] go before what the file says. Files are taken in the order of the numbers
    in their names. Raises InputError that names the file: missing, damaged, or of another topology than the first.
    """
    path = Path(path)
    if path.is_dir():
        vertices, triangles, own = *_folder(path), None
    elif path.is_file():
        vertices, triangles, own = _npz(path)
    else:
        raise InputError(f"sequence {path}: there is no such file or folder")
    if times is None and frame_rate is None and own is not None:
        if own.ndim == 0:
            own = float(own) * np.arange(len(vertices))
        if own.shape != (len(vertices),) or not np.isfinite(own).all() or (np.diff(own) <= 0.0).any():
            raise InputError(f"sequence {path}: its dt or times do not fit its {len(vertices)} frames; give times")
        times = own
    try:
        return MeshSequence(vertices, triangles, frame_times(len(vertices), times, frame_rate))
    except InputError as error:
        raise InputError(f"sequence {path}: {error}") from None


def _npz(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {
                name: file[name] for name in ("verts", "vertices", "faces", "triangles", "dt", "times") if name in file
            }
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"sequence {path}: cannot be read as .npz ({str(error)[:80]}); is it whole?") from None
    vertices = found.get("verts", found.get("vertices"))
    triangles = found.get("faces", found.get("triangles"))
    if vertices is None or triangles is None:
        raise InputError(f"sequence {path}: needs arrays 'verts' (frames, n, 3) and 'faces' (m, 3)")
    if vertices.ndim == 2:
        vertices = vertices[None]
    if vertices.ndim != 3 or vertices.shape[2] != 3 or not len(vertices) or vertices.dtype.kind not in "fiu":
        raise InputError(f"sequence {path}: 'verts' has shape {vertices.shape}; give (frames, n, 3) numbers")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu" or not len(triangles):
        raise InputError(f"sequence {path}: 'faces' has shape {triangles.shape}; give (m, 3) whole numbers")
    if triangles.min() < 0 or triangles.max() >= vertices.shape[1]:
        raise InputError(f"sequence {path}: 'faces' names vertex {triangles.max()} of {vertices.shape[1]}")
    bad = ~np.isfinite(vertices).all(axis=(1, 2))
    if bad.any():
        raise InputError(f"sequence {path}: frame {int(np.argmax(bad))} is not finite; repair it")
    own = found.get("times", found.get("dt"))
    own = None if own is None else np.asarray(own, dtype=np.float64)
    return vertices.astype(np.float64), triangles.astype(np.int32), own


def _folder(path: Path) -> tuple[np.ndarray, np.ndarray]:
    files = sorted((f for f in path.iterdir() if f.suffix.lower() == ".obj"), key=_numbers)
    if not files:
        raise InputError(f"sequence {path}: the folder holds no OBJ files")
    first: SurfaceMesh | None = None
    frames = []
    for file in files:
        mesh = read_mesh(file)
        if not isinstance(mesh, SurfaceMesh):
            raise InputError(f"sequence {path}: {file.name} has no triangles")
        if first is None:
            first = mesh
        elif len(mesh.vertices) != len(first.vertices) or not np.array_equal(mesh.triangles, first.triangles):
            raise InputError(
                f"sequence {path}: {file.name} has another topology than {files[0].name} ({len(mesh.vertices)} vertices "
                f"and {len(mesh.triangles)} triangles, there {len(first.vertices)} and {len(first.triangles)}); export "
                "all frames of one mesh"
            )
        frames.append(mesh.vertices)
    assert first is not None
    return np.stack(frames), first.triangles


def _numbers(file: Path) -> tuple[tuple[int, str], ...]:
    """frame_9 comes before frame_10."""
    return tuple((int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.stem))
