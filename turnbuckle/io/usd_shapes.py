"""Solid shapes of UsdGeom below a rigid body, as parts of ours, and back."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.io.imported import Frame, Gathering, ellipsoid

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Gf, Usd, UsdGeom, UsdPhysics, Vt

ALONG = {
    "X": Rotation.from_euler("y", 90, degrees=True),
    "Y": Rotation.from_euler("x", -90, degrees=True),
    "Z": Rotation.identity(),
}  # fmt: skip  turns z, which our cylinders lie along, onto the axis
FLAT = 1e-6  # relative: axes that are not perpendicular by more are sheared


def placed(prim: Usd.Prim, meters: float) -> tuple[Frame, np.ndarray]:
    """Pose of a prim in the world [m], and the factors on its own coordinates, (3,), after that on units."""
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()), dtype=float)
    axes, x = matrix[:3, :3], matrix[3, :3] * meters
    scale = np.linalg.norm(axes, axis=1)
    turn = axes / np.maximum(scale, 1e-300)[:, None]
    if np.linalg.det(turn) < 0.0:  # mirrored
        turn, scale = turn * [[-1.0], [1.0], [1.0]], scale * [-1.0, 1.0, 1.0]
    if not np.isfinite(turn).all() or abs(np.linalg.det(turn)) < 1e-6:
        return Frame(x), np.ones(3)
    return Frame(x, Rotation.from_matrix(turn.T)), scale


def part_of(prim: Usd.Prim, body: Frame, meters: float, out: Gathering, label: str) -> dict[str, Any] | None:
    """A shape as a part of a body at ``body``; None with a note where there is no counterpart."""
    frame, scale = placed(prim, meters)
    size = np.abs(scale) * meters
    kind = prim.GetTypeName()
    at = body.inverse() * frame
    shape: dict[str, Any]
    if kind == "Cube":
        shape = {"box": float(UsdGeom.Cube(prim).GetSizeAttr().Get()) * size}
    elif kind == "Sphere":
        radius = float(UsdGeom.Sphere(prim).GetRadiusAttr().Get())
        round_ = np.ptp(size) <= FLAT * size.max()
        shape = {"sphere": radius * float(size[0])} if round_ else ellipsoid(radius * size)
    elif kind in ("Cylinder", "Capsule"):
        geometry = (UsdGeom.Cylinder if kind == "Cylinder" else UsdGeom.Capsule)(prim)
        axis = str(geometry.GetAxisAttr().Get())
        along = "XYZ".index(axis)
        across = np.delete(size, along)
        if np.ptp(across) > FLAT * size.max() or (kind == "Capsule" and np.ptp(size) > FLAT * size.max()):
            out.note(f"{label}: a {kind.lower()} that is scaled unevenly has no counterpart")
            return None
        sizes = float(geometry.GetRadiusAttr().Get()) * across[0], float(geometry.GetHeightAttr().Get()) * size[along]
        shape = {kind.lower(): {"radius": float(sizes[0]), "length": float(sizes[1])}}
        at = at * Frame(turn=ALONG[axis])
    elif kind == "Mesh":
        mesh = UsdGeom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get() or [], dtype=float).reshape(-1, 3) * scale * meters
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], dtype=int)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], dtype=int)
        if not len(counts) or counts.sum() != len(corners) or counts.min() < 3 or corners.max() >= len(points):
            out.note(f"{label}: its mesh has no faces that fit its points")
            return None
        triangles = fans(counts, corners)
        left_handed = str(mesh.GetOrientationAttr().Get()) == "leftHanded"
        shape = {"vertices": points, "triangles": triangles[:, ::-1] if left_handed != (scale[0] < 0.0) else triangles}
    else:
        out.note(f"{label}: a shape of type {kind or 'none'} has no counterpart")
        return None
    return {**shape, **at.fields()}


def fans(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Polygons as triangles (m, 3), each a fan about its first corner."""
    begin = np.cumsum(counts) - counts
    which = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(which)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    first = begin[which]
    return np.stack([corners[first], corners[first + 1 + step], corners[first + 2 + step]], axis=1).astype(np.int32)


def set_pose(prim: Usd.Prim, frame: Frame) -> None:
    """Translation and orientation of a prim."""
    form = UsdGeom.Xformable(prim)
    form.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*frame.x.tolist()))
    x, y, z, w = frame.turn.as_quat().tolist()
    form.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))


def write_part(
    stage: Usd.Stage, path: str, part: dict[str, Any], surface: tuple[np.ndarray, np.ndarray] | None
) -> None:
    """A part as a prim that collides. ``surface``: vertices and triangles, of what is none of the simple shapes."""
    frame = Frame(
        np.array(part.get("position", np.zeros(3))), Rotation.from_rotvec(np.array(part.get("rotation", np.zeros(3))))
    )
    if part.get("box") is not None:
        prim = UsdGeom.Cube.Define(stage, path)
        prim.CreateSizeAttr(1.0)
        set_pose(prim.GetPrim(), frame)
        prim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, part["box"])))
        prim.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
    elif part.get("sphere") is not None:
        prim = UsdGeom.Sphere.Define(stage, path)
        prim.CreateRadiusAttr(float(part["sphere"]))
        set_pose(prim.GetPrim(), frame)
    elif part.get("cylinder") is not None or part.get("capsule") is not None:
        kind, sizes = (
            ("cylinder", part["cylinder"]) if part.get("cylinder") is not None else ("capsule", part["capsule"])
        )
        prim = (UsdGeom.Cylinder if kind == "cylinder" else UsdGeom.Capsule).Define(stage, path)
        prim.CreateRadiusAttr(float(sizes["radius"]))
        prim.CreateHeightAttr(float(sizes["length"]))
        prim.CreateAxisAttr("Z")
        set_pose(prim.GetPrim(), frame)
    else:
        assert surface is not None
        prim = UsdGeom.Mesh.Define(stage, path)
        write_mesh(prim, *surface)
        set_pose(prim.GetPrim(), frame)
        UsdPhysics.MeshCollisionAPI.Apply(prim.GetPrim()).CreateApproximationAttr("none")
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())


def write_mesh(mesh: UsdGeom.Mesh, points: np.ndarray, triangles: np.ndarray) -> None:
    """Points and triangles of a mesh."""
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(triangles, dtype=np.int32).ravel()))
    if len(points):
        ends = np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float32)
        mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(ends))
