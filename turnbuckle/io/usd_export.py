"""A scene as USD: UsdPhysics bodies and joints, attachments in the words proposed for UsdPhysics, and a way back.

Other programs read the standard attributes; `turnbuckle:` attributes beside them keep what USD has no word for, so that
reading the file gives the same scene again (`usd_items.py`).
"""

from __future__ import annotations

import contextlib
import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.shape import Shape
from turnbuckle.data.state import State
from turnbuckle.io.imported import Frame
from turnbuckle.io.usd import polylines
from turnbuckle.io.usd_import import MISSING, UsdReader
from turnbuckle.io.usd_items import DEFINITION, SCENE, keep, seal
from turnbuckle.io.usd_joint_writer import write_joint
from turnbuckle.io.usd_point_writer import Written, write_point_constraint
from turnbuckle.io.usd_shapes import set_pose, write_mesh, write_part
from turnbuckle.scene.definitions import ObstacleDef, RigidDef, SceneDef
from turnbuckle.scene.joint_definitions import BodyPairDef
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.validation import given_data
from turnbuckle.scene.yaml_file import move_meshes, refuse_callables

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, Vt

SUFFIXES = (".usd", ".usda", ".usdc")
SHOWN = 6  # names in a note
_NOTE = re.compile(r"(\w+) ('.*?'): (.*)")


def export_scene(scene: Scene, path: str | os.PathLike[str]) -> list[str]:
    """Write ``scene`` as it starts; returns a sentence for each thing that only Turnbuckle will understand.

    Raises `InputError` for Python callables, another suffix, a place that cannot be written, and where usd-core is missing.
    """
    path = Path(path)
    if "Usd" not in globals():
        raise InputError(f"{path}: {MISSING}")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: name the file to write {', '.join(SUFFIXES)}")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path}: there is no folder {str(path.parent)!r}")
    refuse_callables(scene.definition)
    model, state = scene.build()
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        beside.unlink(missing_ok=True)
        stage = Usd.Stage.CreateNew(str(beside))
        notes = _Writer(stage, scene, path, model, state).write()
        stage.GetRootLayer().Save()
        del stage
        os.replace(beside, path)
    except Tf.ErrorException as error:
        raise InputError(f"{path}: cannot be written ({' '.join(str(error).split())[:200]})") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
    return _gathered(notes)


def _gathered(notes: list[str]) -> list[str]:
    """Notes that say the same of several things, as one with all their names."""
    names: dict[tuple[str, str], list[str]] = {}
    for note in notes:
        found = _NOTE.fullmatch(note)
        names.setdefault((found[1], found[3]) if found else ("", note), []).append(found[2] if found else "")
    told = []
    for (kind, text), all_names in names.items():
        more = f" and {len(all_names) - SHOWN} more" if len(all_names) > SHOWN else ""
        told.append(f"{kind} {', '.join(all_names[:SHOWN])}{more}: {text}" if kind else text)
    return told


class _Writer:
    def __init__(self, stage: Usd.Stage, scene: Scene, path: Path, model: Model, state: State) -> None:
        self.stage, self.definition, self.model, self.state = stage, scene.definition, model, state
        self.data = {"schema_version": 1, **given_data(scene.definition)}
        move_meshes(self.data, scene.folder, path.parent)
        self.notes: list[str] = []
        self.paths: dict[str, str] = {}  # body -> its prim
        self.points: dict[str, str] = {}  # body -> the prim whose points are the body's own
        self.vertices: dict[str, np.ndarray] = {}  # body -> of each of its points the vertex of that prim
        self.frames: dict[str, Frame] = {}
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
        self.reader = UsdReader(stage, path)

    def write(self) -> list[str]:
        d: SceneDef = self.definition
        stage = self.stage
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if d.up_axis == "Y" else UsdGeom.Tokens.z)
        stage.GetRootLayer().comment = "Written by Turnbuckle"
        world = UsdGeom.Xform.Define(stage, "/World").GetPrim()
        stage.SetDefaultPrim(world)
        keep(world, SCENE, {k: v for k, v in self.data.items() if k not in ("bodies", "constraints")})
        gravity = d.gravity_vector()
        size = float(np.linalg.norm(gravity))
        physics = UsdPhysics.Scene.Define(stage, "/World/physics")
        physics.CreateGravityMagnitudeAttr(size)
        physics.CreateGravityDirectionAttr(Gf.Vec3f(*(gravity / size if size else np.zeros(3)).tolist()))
        x = self.state.positions()
        for body, data in zip(d.bodies, self.data.get("bodies", []), strict=True):
            shape = self.model.shape(body.name)
            path = self._free("/World", body.name)
            self.paths[body.name] = path
            prim = UsdGeom.Xform.Define(stage, path).GetPrim()
            prim.SetDisplayName(body.name)
            keep(prim, DEFINITION, data)
            if isinstance(body, RigidDef):
                self._rigid(prim, body, shape)
            else:
                self._soft(prim, body, shape, x)
        for body in d.bodies:
            if isinstance(body, RigidDef):
                self.reader.find(stage.GetPrimAtPath(self.paths[body.name]))
        for body in d.bodies:
            if isinstance(body, RigidDef):
                prim = stage.GetPrimAtPath(self.paths[body.name])
                seal(prim, self.reader.body(prim))
        UsdGeom.Scope.Define(stage, "/World/constraints")
        for constraint, data in zip(d.constraints, self.data.get("constraints", []), strict=True):
            path = self._free("/World/constraints", constraint.name)
            if isinstance(constraint, BodyPairDef):
                prim = write_joint(self.stage, path, constraint, self.paths, self.frames, self.notes)
                keep(prim, DEFINITION, data)
                seal(prim, self.reader.joint(prim, constraint.name) or {})
            else:
                places = Written(self.paths, self.frames, self.points, self.vertices)
                prim = write_point_constraint(self.stage, path, constraint, self.model, self.state, places, self.notes)
                keep(prim, DEFINITION, data)
            prim.SetDisplayName(constraint.name)
        for kind in ("forces", "skins"):
            self.notes += [f"{kind[:-1]} '{item.name}': has no counterpart in USD" for item in getattr(d, kind)]
        return self.notes

    def _free(self, above: str, name: str) -> str:
        base = f"{above}/{Tf.MakeValidIdentifier(name or 'item')}"
        path, number = base, 1
        while self.stage.GetPrimAtPath(path):
            number += 1
            path = f"{base}_{number}"
        return path

    def _rigid(self, prim: Usd.Prim, d: RigidDef, shape: Shape) -> None:
        """Pose, mass, velocities and shapes of a rigid body."""
        bodies = self.model.rigid
        number = bodies.names.index(d.name)
        frame = Frame(np.array(d.position), Rotation.from_rotvec(np.array(d.rotation)))
        self.frames[d.name] = frame
        set_pose(prim, frame)
        rigid, mass = UsdPhysics.RigidBodyAPI.Apply(prim), UsdPhysics.MassAPI.Apply(prim)
        if d.motion != "dynamic":
            rigid.CreateKinematicEnabledAttr(True)
        if d.motion == "trajectory":
            self.notes.append(f"body '{d.name}': stands still for other programs, its trajectory has no counterpart")
        if np.any(d.velocity):
            rigid.CreateVelocityAttr(Gf.Vec3f(*np.array(d.velocity).tolist()))
        if np.any(d.angular_velocity):
            rigid.CreateAngularVelocityAttr(Gf.Vec3f(*np.degrees(d.angular_velocity).tolist()))
        inertial = Rotation.from_quat(bodies.frame_q[number]).inv()  # from the principal axes to the body's
        mass.CreateMassAttr(float(bodies.mass[number]))
        mass.CreateCenterOfMassAttr(Gf.Vec3f(*(-inertial.apply(bodies.frame_x[number])).tolist()))
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*bodies.inertia[number].tolist()))
        x, y, z, w = inertial.as_quat().tolist()
        mass.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))
        if d.linear_damping or d.angular_damping:
            self.notes.append(f"body '{d.name}': its damping has no counterpart in UsdPhysics")
        parts = given_data(d).get("parts") or [
            {k: v for k, v in given_data(d).items() if k not in ("position", "rotation")}
        ]
        simple = all(any(part.get(k) is not None for k in ("box", "sphere", "cylinder", "capsule")) for part in parts)
        if simple and d.scale == 1.0:
            for i, part in enumerate(parts):
                write_part(self.stage, f"{prim.GetPath()}/shape_{i}", part, None)
            return
        used, index = np.unique(shape.triangles, return_inverse=True)
        assert shape.local is not None
        # The points of the recording are in the inertial frame, moved by it into the body's own.
        local = self._own_points(number, shape)[used]
        write_part(self.stage, f"{prim.GetPath()}/shape_0", {}, (local, index.reshape(-1, 3)))

    def _own_points(self, number: int, shape: Shape) -> np.ndarray:
        """Points of a rigid body in its own frame at the start."""
        frame = self.frames[self.model.rigid.names[number]].inverse()
        return frame.x + frame.turn.apply(np.array(self.state.positions()[shape.begin : shape.end]))

    def _soft(self, prim: Usd.Prim, d: Any, shape: Shape, x: np.ndarray) -> None:
        """A body that deforms, or an obstacle: its geometry at the start, in the world."""
        path, own = str(prim.GetPath()), x[shape.begin : shape.end]
        self.points[d.name] = f"{path}/surface" if len(shape.triangles) else f"{path}/lines"
        self.vertices[d.name] = np.arange(len(own))
        if len(shape.tetrahedra):
            solid = UsdGeom.TetMesh.Define(self.stage, f"{path}/solid")
            solid.CreatePurposeAttr(UsdGeom.Tokens.guide)
            solid.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(own.astype(np.float32)))
            solid.CreateTetVertexIndicesAttr(Vt.Vec4iArray.FromNumpy(shape.tetrahedra.astype(np.int32)))
            solid.CreateSurfaceFaceVertexIndicesAttr(Vt.Vec3iArray.FromNumpy(shape.triangles.astype(np.int32)))
            self.points[d.name] = f"{path}/solid"
        if len(shape.triangles):
            mesh = UsdGeom.Mesh.Define(self.stage, f"{path}/surface")
            write_mesh(mesh, own, shape.triangles)
            mesh.CreateDoubleSidedAttr(True)
            if shape.color is not None:
                mesh.CreateDisplayColorAttr([Gf.Vec3f(*(float(c) for c in shape.color))])
            if isinstance(d, ObstacleDef):
                UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
        if len(shape.lines):
            order, counts = polylines(shape.lines)
            curves = UsdGeom.BasisCurves.Define(self.stage, f"{path}/lines")
            curves.CreateTypeAttr(UsdGeom.Tokens.linear)
            curves.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
            curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(own[order].astype(np.float32)))
            if self.points[d.name] == f"{path}/lines":  # junctions are there several times: the first counts
                self.vertices[d.name][order[::-1]] = np.arange(len(order))[::-1]
        if not isinstance(d, ObstacleDef):
            prim.CreateAttribute("turnbuckle:kind", Sdf.ValueTypeNames.Token, custom=True).Set(d.type)
            self.notes.append(f"body '{d.name}': other programs see its geometry; its material is kept for Turnbuckle")
        if not math.isfinite(float(own.sum())):
            raise InputError(f"body '{d.name}': has a point that is not finite")
