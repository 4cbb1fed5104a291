"""A USD file as a recording: its meshes and curves, frame by frame. Ours, or that of another program.

What is drawn counts: meshes and linear curves of the default purpose. A mesh whose points do not change, under transforms
that do, is a rigid body. USD keeps float32, and of a rigid body no velocities: those are differences of places.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.geometry.fit import fit_pose
from turnbuckle.io import usd_undo

with contextlib.suppress(ImportError):  # an optional extra: `read_usd_recording` says what to install
    from pxr import Tf, Usd, UsdGeom

OWN = ("surface", "lines", "solid")  # names that our recorder gives the prims of a body
SAVED = 0.3  # [s] without a change: nobody is saving a file
LOOKS = 16  # frames at which a body is looked at to know that it stands still
RIGID = 1e-5  # of the size of a body: what it may deviate from a rigid motion


class _Drawn:
    """A mesh or curve, and where its points are at a time code."""

    def __init__(self, prim: Usd.Prim, scale: float) -> None:
        self.prim, self._scale = prim, scale
        self._points = UsdGeom.PointBased(prim).GetPointsAttr()
        self._velocities = UsdGeom.PointBased(prim).GetVelocitiesAttr()
        self.deforms = self._points.GetNumTimeSamples() > 1
        self.count = len(self._points.Get(Usd.TimeCode.EarliestTime()) or [])

    def codes(self) -> set[float]:
        """Time codes at which it, or what it hangs on, has samples."""
        found = set(self._points.GetTimeSamples())
        prim = self.prim
        while prim and not prim.IsPseudoRoot():
            if prim.IsA(UsdGeom.Xformable):
                found |= set(UsdGeom.Xformable(prim).GetTimeSamples())
            prim = prim.GetParent()
        return found

    def at(self, code: float) -> np.ndarray:
        """World positions [m], (count, 3)."""
        points = np.array(self._points.Get(code), dtype=np.float64).reshape(-1, 3)
        if len(points) != self.count:
            raise InputError(f"{self.prim.GetPath()}: has another number of points at time code {code:g}")
        return self._scale * (points @ self._matrix(code)[:3, :3] + self._matrix(code)[3, :3])

    def speeds(self, code: float) -> np.ndarray | None:
        """World velocities [m/s], where the file has them."""
        values = self._velocities.Get(code) if self.deforms and self._velocities.HasValue() else None
        if values is None or len(values) != self.count:
            return None
        return self._scale * (np.array(values, dtype=np.float64).reshape(-1, 3) @ self._matrix(code)[:3, :3])

    def _matrix(self, code: float) -> np.ndarray:
        return np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(self.prim))

    def shape(self, name: str, begin: int, codes: list[float]) -> Shape:
        """Its topology over points from ``begin`` on."""
        end = begin + self.count
        more: dict[str, Any] = {"color": self._color(), "drawn": self._visible()}
        if self.prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(self.prim)
            counts, indices = mesh.GetFaceVertexCountsAttr().Get(), mesh.GetFaceVertexIndicesAttr().Get()
            more["triangles"] = _fans(np.array(counts or [], np.int64), np.array(indices or [], np.int64))
            triangles = more["triangles"]
            if len(triangles) and not 0 <= triangles.min() <= triangles.max() < self.count:
                raise InputError(f"{self.prim.GetPath()}: a face has a corner that is no point")
        else:
            counts = np.array(UsdGeom.Curves(self.prim).GetCurveVertexCountsAttr().Get() or [], np.int64)
            ends = np.cumsum(counts)
            if len(ends) and ends[-1] > self.count:
                raise InputError(f"{self.prim.GetPath()}: its curves have more points than there are")
            inner = np.ones(int(ends[-1]) if len(ends) else 0, dtype=bool)
            inner[ends - 1] = False  # no segment from one curve to the next
            first = np.flatnonzero(inner)
            more["lines"] = np.stack([first, first + 1], axis=1).astype(np.int32)
        start = self.at(codes[0])
        if not self.deforms and self._is_rigid(start, codes):
            more["local"] = start
        looks = codes[:: max(len(codes) // LOOKS, 1)] + codes[-1:]
        least = 1e-7 * max(float(np.abs(start).max(initial=0.0)), 1.0)
        more["still"] = all(np.abs(self.at(code) - start).max(initial=0.0) <= least for code in looks)
        return Shape(name, begin, end, **more)

    def _is_rigid(self, start: np.ndarray, codes: list[float]) -> bool:
        size = float(np.ptp(start, axis=0).max(initial=0.0))
        if not self.count or size == 0.0:
            return False
        from_start = self.at(codes[-1])
        place, turn = fit_pose(start, from_start)
        return float(np.abs(_moved(start, place, turn) - from_start).max()) <= RIGID * size

    def _color(self) -> tuple[float, float, float] | None:
        values = UsdGeom.Gprim(self.prim).GetDisplayColorAttr().Get()
        return tuple(float(c) for c in values[0]) if values is not None and len(values) == 1 else None

    def _visible(self) -> bool:
        return bool(UsdGeom.Imageable(self.prim).ComputeVisibility() != UsdGeom.Tokens.invisible)


def read_usd_recording(path: Path) -> tuple[list[Shape], dict[str, Any], np.ndarray, Any]:
    """Shapes, info, times [s] (frames,), and fetch("x" or "v", frame) -> (points, 3). Raises `InputError`."""
    if "Usd" not in globals():
        raise InputError(f"recording {path}: USD needs usd-core; run: pip install 'turnbuckle[usd]'")
    if not path.is_file():
        raise InputError(f"recording {path}: there is no such file")
    try:
        stage = _opened(path)
        if stage is None:
            usd_undo.put_back(path, SAVED)
            stage = _opened(path)
    except OSError as error:
        raise InputError(f"recording {path}: a save was cut off, and cannot be undone ({error.strerror})") from None
    if stage is None:
        raise InputError(f"recording {path}: is no USD file, or not whole")
    try:
        return _read(stage, path)
    except InputError as error:
        raise InputError(f"recording {path}: {error}") from None
    except (Tf.ErrorException, RuntimeError, ValueError, IndexError, TypeError) as error:
        raise InputError(f"recording {path}: cannot be read ({' '.join(str(error).split())[:120]})") from None


def _opened(path: Path) -> Usd.Stage | None:
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        return None


def _read(stage: Usd.Stage, path: Path) -> tuple[list[Shape], dict[str, Any], np.ndarray, Any]:
    scale = float(UsdGeom.GetStageMetersPerUnit(stage))
    found = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh) or prim.IsA(UsdGeom.BasisCurves):
            if UsdGeom.Imageable(prim).ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render):
                found.append(_Drawn(prim, scale))
    if not any(one.count for one in found):
        raise InputError("holds no mesh and no curves to show")
    codes = sorted(set().union(*(one.codes() for one in found))) or [0.0]
    shapes: list[Shape] = []
    taken: set[str] = set()
    for one in found:
        begin = shapes[-1].end if shapes else 0
        shapes.append(one.shape(_name(one.prim, taken), begin, codes))
    rate = float(stage.GetTimeCodesPerSecond()) or 24.0
    times = np.array(codes) / rate

    def fetch(what: str, frame: int, _open: Any = stage) -> np.ndarray:  # prims live no longer than their stage
        code = codes[frame]
        if what == "x":
            return np.concatenate([one.at(code) for one in found])
        before, after = max(frame - 1, 0), min(frame + 1, len(codes) - 1)
        span = times[after] - times[before]
        speeds = []
        for one in found:
            own = one.speeds(code)
            if own is None:
                own = (one.at(codes[after]) - one.at(codes[before])) / span if span > 0.0 else np.zeros((one.count, 3))
            speeds.append(own)
        return np.concatenate(speeds)

    up = "Y" if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y else "Z"
    info = {"up_axis": up, "frames_per_second": float(stage.GetFramesPerSecond()) or rate, "scene": path.stem}
    return shapes, info, times, fetch


def _name(prim: Usd.Prim, taken: set[str]) -> str:
    """The body's name, where the prim is one of ours; else its own. No two are the same."""
    body = prim.GetParent() if prim.GetName() in OWN and not prim.GetParent().IsPseudoRoot() else prim
    base = body.GetDisplayName() or body.GetName()
    name, number = base, 1
    while name in taken:
        number += 1
        name = f"{base}_{number}"
    taken.add(name)
    return name


def _fans(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Faces of any number of corners as triangles (n, 3), each from its first corner."""
    if counts.sum() != len(indices) or (counts < 0).any():
        raise InputError("the faces of a mesh do not fit its corners")
    begin = np.cumsum(counts) - counts
    inner = np.maximum(counts - 2, 0)  # triangles of each face
    face = np.repeat(np.arange(len(counts)), inner)
    step = np.arange(len(face)) - np.repeat(np.cumsum(inner) - inner, inner)
    corner = begin[face]
    return np.stack([indices[corner], indices[corner + step + 1], indices[corner + step + 2]], axis=1).astype(np.int32)


def _moved(points: np.ndarray, place: np.ndarray, turn_xyzw: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(turn_xyzw).apply(points) + place
