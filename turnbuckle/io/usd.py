"""A run as USD, for Houdini, Blender and Omniverse: names of UsdGeom, points as time samples.

A rigid body is an Xform whose transform has time samples, with a still Mesh below; it has the rigid body API of
UsdPhysics, marked kinematic, so that a physics engine plays the recording back. Of other bodies, lines are a
BasisCurves, triangles (the skin, else the boundary of the solid) a Mesh, tetrahedra also a TetMesh of purpose "guide",
which viewers hide until asked. What a skin covers is there, invisible. Time codes are seconds times frames per second.

Binary layers (.usdc, .usd) are saved every few frames: the crate format appends and moves what was saved out of memory, so
memory stays flat, and a kill leaves the frames of the last save (`usd_undo`). A text layer cannot be appended to: .usda is recorded as ``NAME.usda.part.usdc`` and written
out as text at the end.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.geometry.fit import fit_pose
from turnbuckle.io import usd_undo
from turnbuckle.io.recorder import Recorder, check_frame, reason

with contextlib.suppress(ImportError):  # an optional extra: UsdRecorder says what to install
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, Vt

_Pick = Callable[[np.ndarray], np.ndarray]  # positions or velocities of all points -> those of a prim
_UNSAVED = 1 << 26  # bytes of frames kept in memory before they are saved unasked


class UsdRecorder(Recorder):
    """Writes .usdc, .usda, .usd."""

    def __init__(self, path: Path, shapes: list[Shape], info: dict[str, Any]) -> None:
        if "Usd" not in globals():
            raise InputError(f"recording {path}: USD needs usd-core; run: pip install 'turnbuckle[usd]'")
        self._path = path
        self._points: int | None = None
        self._rate = float(info["frames_per_second"])
        self._text = path.suffix.lower() == ".usda"
        self._written = path.with_name(path.name + ".part.usdc") if self._text else path
        self._unsaved = 0
        try:
            self._written.unlink(missing_ok=True)
            usd_undo.forget(self._written)
            path.unlink(missing_ok=True)
            layer = Sdf.Layer.CreateNew(str(self._written), args={"format": "usdc"})
            self._stage: Usd.Stage | None = Usd.Stage.Open(layer)
            self._bodies, self._frames = _define(self._stage, shapes, info)
            layer.Save()
        except Tf.ErrorException as error:
            raise OSError(_reason(error)) from None

    def write(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        x, v = check_frame(self._path, x, v, self._points)
        if self._stage is None:
            raise InputError(f"recording {self._path}: is closed; no frame can be added")
        code = round(time * self._rate, 6)  # whole numbers, where frames come at the rate
        if self._points is None:
            self._points = len(x)
            self._stage.SetStartTimeCode(code)
        self._stage.SetEndTimeCode(code)
        with Sdf.ChangeBlock():
            for prim, pick in self._bodies:
                points, velocities = pick(x).astype(np.float32), pick(v).astype(np.float32)
                prim.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), code)
                prim.GetVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(velocities), code)
                if len(points):
                    ends = np.stack([points.min(axis=0), points.max(axis=0)])
                    prim.GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(ends), code)
                self._unsaved += 2 * points.nbytes
            for frame in self._frames:
                frame.write(x, code)
                self._unsaved += 56
        if self._unsaved > _UNSAVED:
            self.flush()

    def flush(self) -> None:
        if self._stage is None:
            return
        try:
            usd_undo.keep(self._written)
            self._stage.GetRootLayer().Save()
            usd_undo.forget(self._written)
        except Tf.ErrorException as error:
            raise InputError(f"recording {self._path}: cannot be written ({_reason(error)})") from None
        except OSError as error:
            raise InputError(f"recording {self._path}: cannot be written ({reason(error)})") from None
        self._unsaved = 0

    def close(self) -> None:
        if self._stage is None:
            return
        self.flush()
        if self._text:
            try:
                self._stage.GetRootLayer().Export(str(self._path))
            except Tf.ErrorException as error:
                raise InputError(f"recording {self._path}: cannot be written ({_reason(error)})") from None
        self._bodies, self._frames = [], []
        self._stage = None
        if self._text:
            self._written.unlink(missing_ok=True)


class _Frame:
    """The transform of a rigid body, found from its points."""

    def __init__(self, group: UsdGeom.Xform, shape: Shape) -> None:
        self._shape = shape
        self._translate = group.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        self._orient = group.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
        self._last = np.array([0.0, 0.0, 0.0, 1.0])
        body = UsdPhysics.RigidBodyAPI.Apply(group.GetPrim())
        body.CreateKinematicEnabledAttr().Set(True)

    def write(self, x: np.ndarray, code: float) -> None:
        """A sample for the positions ``x`` [m] of all points."""
        assert self._shape.local is not None
        own = x[self._shape.begin : self._shape.end]
        if not np.isfinite(own).all():
            return
        origin, xyzw = fit_pose(self._shape.local, own)
        if xyzw @ self._last < 0.0:  # of the two quaternions of a rotation the one near the last, for interpolation
            xyzw = -xyzw
        self._last = xyzw
        self._translate.Set(Gf.Vec3d(*origin.tolist()), code)
        self._orient.Set(Gf.Quatd(float(xyzw[3]), *xyzw[:3].tolist()), code)


def _define(
    stage: Usd.Stage, shapes: list[Shape], info: dict[str, Any]
) -> tuple[list[tuple[UsdGeom.PointBased, _Pick]], list[_Frame]]:
    """All prims with their topology; of each that changes shape what takes its points out of the state; rigid frames."""
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if info["up_axis"] == "Y" else UsdGeom.Tokens.z)
    stage.SetTimeCodesPerSecond(info["frames_per_second"])
    stage.SetFramesPerSecond(info["frames_per_second"])
    stage.GetRootLayer().comment = "Recorded by Turnbuckle"
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    bodies: list[tuple[UsdGeom.PointBased, _Pick]] = []
    frames: list[_Frame] = []
    taken: set[str] = set()
    for shape in shapes:
        body = f"/World/{_free_name(shape.name, taken)}"
        group = UsdGeom.Xform.Define(stage, body)
        group.GetPrim().SetDisplayName(shape.name)
        if not shape.drawn:
            group.CreateVisibilityAttr().Set(UsdGeom.Tokens.invisible)
        if shape.local is not None:
            frames.append(_Frame(group, shape))
            _still(_mesh(stage, f"{body}/surface", shape.triangles), shape)
            continue
        own = np.arange(shape.begin, shape.end)
        made: list[tuple[UsdGeom.PointBased, _Pick]] = []
        if shape.skin is not None:
            made.append((_mesh(stage, f"{body}/surface", shape.skin.triangles), shape.skin.positions))
        elif len(shape.triangles):
            made.append((_mesh(stage, f"{body}/surface", shape.triangles), _rows(own)))
        if len(shape.lines):
            order, counts = polylines(shape.lines)
            made.append((_curves(stage, f"{body}/lines", counts), _rows(own[order])))
        if len(shape.tetrahedra):
            made.append((_solid(stage, f"{body}/solid", shape), _rows(own)))
        for prim, _ in made:
            if shape.color is not None:
                prim.CreateDisplayColorAttr().Set([Gf.Vec3f(*(float(c) for c in shape.color))])
        bodies.extend(made)
    return bodies, frames


def _still(mesh: UsdGeom.Mesh, shape: Shape) -> None:
    """The surface of a rigid body in its own frame, without markers."""
    used, index = np.unique(shape.triangles, return_inverse=True)
    assert shape.local is not None
    points = shape.local[used].astype(np.float32)
    mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(index.astype(np.int32).ravel()))
    if len(points):
        mesh.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    if shape.color is not None:
        mesh.CreateDisplayColorAttr().Set([Gf.Vec3f(*(float(c) for c in shape.color))])


def _rows(index: np.ndarray) -> _Pick:
    return lambda values: values[index]


def _mesh(stage: Usd.Stage, path: str, triangles: np.ndarray) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr().Set(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(triangles.astype(np.int32).ravel()))
    mesh.CreateDoubleSidedAttr().Set(True)
    return mesh


def _curves(stage: Usd.Stage, path: str, counts: np.ndarray) -> UsdGeom.BasisCurves:
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr().Set(UsdGeom.Tokens.linear)
    curves.CreateCurveVertexCountsAttr().Set(Vt.IntArray.FromNumpy(counts))
    return curves


def polylines(lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments (n, 2) strung into polylines, since curves have no indices: each runs between ends and junctions.

    Returns the points in the order in which they are visited, one polyline after the other, and the number of points
    of each, (curves,) int32.
    """
    at_point: dict[int, list[int]] = {}
    for number, ends in enumerate(lines.tolist()):
        for end in ends:
            at_point.setdefault(end, []).append(number)
    left = set(range(len(lines)))
    order: list[int] = []
    counts: list[int] = []

    def follow(point: int, segment: int) -> None:
        begin = len(order)
        order.append(point)
        while segment in left:
            left.remove(segment)
            a, b = lines[segment].tolist()
            point = b if a == point else a
            order.append(point)
            if len(at_point[point]) == 2:
                segment = next((s for s in at_point[point] if s != segment), segment)
        counts.append(len(order) - begin)

    for point, segments in at_point.items():
        if len(segments) != 2:
            for segment in segments:
                if segment in left:
                    follow(point, segment)
    for segment in range(len(lines)):  # what is left are closed loops
        if segment in left:
            follow(int(lines[segment, 0]), segment)
    return np.array(order, dtype=np.int64), np.array(counts, dtype=np.int32)


def _solid(stage: Usd.Stage, path: str, shape: Shape) -> UsdGeom.TetMesh:
    solid = UsdGeom.TetMesh.Define(stage, path)
    solid.CreatePurposeAttr().Set(UsdGeom.Tokens.guide)
    solid.CreateTetVertexIndicesAttr().Set(Vt.Vec4iArray.FromNumpy(shape.tetrahedra.astype(np.int32)))
    solid.CreateSurfaceFaceVertexIndicesAttr().Set(Vt.Vec3iArray.FromNumpy(shape.triangles.astype(np.int32)))
    return solid


def _free_name(name: str, taken: set[str]) -> str:
    """A name USD allows, that no other body has."""
    base = Tf.MakeValidIdentifier(name or "body")
    free, number = base, 1
    while free in taken:
        number += 1
        free = f"{base}_{number}"
    taken.add(free)
    return free


def _reason(error: Tf.ErrorException) -> str:
    return reason(RuntimeError("; ".join(getattr(e, "commentary", str(e)) for e in error.args) or str(error)))
