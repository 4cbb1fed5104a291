"""A closed triangle surface filled with tetrahedra, by fTetWild (Hu et al. 2020), and remembered on disk."""

import contextlib
import hashlib
import importlib.util
import os
import sys
import tempfile
import types
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.repair import check_surface, repair_tetrahedra

# Lengths relative to the diagonal of the bounding box, where the user gives none.
EDGE_LENGTH = 0.06
# Relative to the edge length. The time goes into keeping to the envelope, and the user's own surface is tied to the
# tetrahedra with weights, so the envelope may be as wide as the elements can follow anyway.
EPSILON = 0.125
# The conformal energy (3 for a regular element) at which fTetWild stops: the library's own 10 asks for a quality
# that takes several times as long and that mass-spring elements do not need.
STOP_ENERGY = 20.0
_FORMAT = 1  # a part of the cache key: raise it when the result for the same input changes


def tetrahedralise(
    vertices: np.ndarray, triangles: np.ndarray, edge_length: float | None = None, epsilon: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Fill a closed surface with tetrahedra of positive volume.

    ``edge_length`` [m] is the size of the elements to aim for (default 6 % of the bounding box's diagonal),
    ``epsilon`` [m] how far the new surface may lie from the old one (default an eighth of the edge length; give less
    where parts are thinner than that). Returns vertices [m] (n, 3) float64 and tetrahedra (m, 4) int32; the surface's
    own vertices are not kept. The result is stored under `cache_folder` and found again by the content: the library
    gives other tetrahedra on every run, even on one thread, so without the stored ones runs differ. Raises InputError for a surface that is not closed, lengths
    that are not positive, and where pytetwild is not installed.
    """
    vertices, triangles, _ = check_surface(vertices, triangles)
    used = np.unique(triangles)
    diagonal = float(np.linalg.norm(np.ptp(vertices[used], axis=0)))
    edge = _length("edge_length", edge_length, EDGE_LENGTH * diagonal)
    envelope = _length("epsilon", epsilon, EPSILON * edge)
    key = hashlib.sha256(repr((_FORMAT, STOP_ENERGY, edge, envelope)).encode())
    key.update(np.ascontiguousarray(vertices).tobytes())
    key.update(np.ascontiguousarray(triangles).tobytes())
    stored = cache_folder() / f"tetrahedra-{key.hexdigest()[:32]}.npz"
    found = _load(stored)
    if found is not None:
        return found
    # In a box of size one: the library keeps absolute tolerances.
    origin = vertices[used].min(axis=0)
    points, cells = _run_library((vertices - origin) / diagonal, triangles, edge / diagonal, envelope / diagonal)
    if not len(cells):
        raise InputError("surface: no tetrahedra fit inside it; give a smaller edge_length or epsilon")
    points, cells, _ = repair_tetrahedra(points * diagonal + origin, cells)
    _store(stored, points, cells)
    return points, cells


def cache_folder() -> Path:
    """Where results are kept: $TURNBUCKLE_CACHE, else $XDG_CACHE_HOME/turnbuckle, else ~/.cache/turnbuckle."""
    own = os.environ.get("TURNBUCKLE_CACHE")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "turnbuckle"


def _length(name: str, value: float | None, default: float) -> float:
    if value is None:
        return default
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"tetrahedralise: {name} is {value}; give a positive length in metres")
    return float(value)


def _run_library(
    vertices: np.ndarray, triangles: np.ndarray, edge: float, epsilon: float
) -> tuple[np.ndarray, np.ndarray]:
    if importlib.util.find_spec("pytetwild") is None:
        raise InputError(
            "tetrahedralise: filling a surface with tetrahedra needs pytetwild; run: pip install 'turnbuckle[tet]'"
        )
    if importlib.util.find_spec("pyvista") is None:
        # The package imports pyvista (half a gigabyte with VTK) only to register an accessor that is not used here.
        sys.modules.setdefault("pytetwild._accessor", types.ModuleType("pytetwild._accessor"))
    try:
        import pytetwild  # optional extra

        with _silence(), tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):  # it leaves a file behind
            points, cells = pytetwild.tetrahedralize(
                np.ascontiguousarray(vertices),
                np.ascontiguousarray(triangles, dtype=np.int32),
                edge_length_abs=edge,
                epsilon=epsilon,
                stop_energy=STOP_ENERGY,
                vtk_ordering=True,
                quiet=True,
            )
    except Exception as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(f"tetrahedralise: fTetWild cannot fill this surface ({reason})") from None
    return np.asarray(points, dtype=np.float64), np.asarray(cells, dtype=np.int32)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """The library prints from C++, past sys.stdout: turn the file descriptor itself away."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _load(path: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """What is stored, or None where there is nothing or nothing whole (it is then made anew)."""
    try:
        with np.load(path, allow_pickle=False) as file:
            points, cells = file["vertices"], file["tetrahedra"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    sound = points.ndim == 2 and cells.ndim == 2 and points.shape[1:] == (3,) and cells.shape[1:] == (4,)
    if not sound or not len(cells) or cells.min() < 0 or cells.max() >= len(points) or not np.isfinite(points).all():
        return None
    return points, cells


def _store(path: Path, points: np.ndarray, cells: np.ndarray) -> None:
    """Write beside and rename, so that no reader sees half a file; a cache that cannot be written is no error."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, vertices=points, tetrahedra=cells)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise
    except OSError:
        return
