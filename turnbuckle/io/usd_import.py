"""USD files as scenes: UsdPhysics rigid bodies, colliders and joints of any program; all else of files we wrote."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.io.imported import Frame, Gathering, Imported
from turnbuckle.io.usd_items import DEFINITION, PART_OF, PREFIX, SCENE, is_unchanged, kept
from turnbuckle.io.usd_joints import JointReader
from turnbuckle.io.usd_shapes import ALONG, part_of, placed

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Tf, Usd, UsdGeom, UsdPhysics

MISSING = "USD needs usd-core; run: pip install 'turnbuckle[usd]'"
# What USD says of a rigid body; of the definition that we kept, the rest stays when another program changed these.
STANDARD_BODY = ("position", "rotation", "scale", "velocity", "angular_velocity", "box", "sphere", "cylinder", "capsule",
                 "mesh", "vertices", "triangles", "parts", "plane", "mass", "density", "inertia", "center", "motion",
                 "trajectory")  # fmt: skip
STANDARD_JOINT = ("local_pos0", "local_pos1", "anchor", "body0", "body1", "enabled", "break_force", "break_torque")


def read_usd(path: str | Path) -> Imported:
    """The scene in a USD file. Raises `InputError`, also where the optional usd-core is missing."""
    path = Path(path)
    if "Usd" not in globals():
        raise InputError(f"{path}: {MISSING}")
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(f"{path}: USD cannot read it ({_short(error)})") from None
    if not stage:
        raise InputError(f"{path}: USD cannot read it")
    return UsdReader(stage, path).read()


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


class UsdReader:
    """Reads a stage; also used while one is written, to know what its standard attributes say."""

    def __init__(self, stage: Usd.Stage, path: Path) -> None:
        self.stage = stage
        meters = float(UsdGeom.GetStageMetersPerUnit(stage))
        self.meters = meters if math.isfinite(meters) and meters > 0.0 else 1.0
        kilograms = float(UsdPhysics.GetStageKilogramsPerUnit(stage))
        self.kilograms = kilograms if math.isfinite(kilograms) and kilograms > 0.0 else 1.0
        self.out = Gathering(path, path.stem)
        self.names: dict[str, str] = {}  # path of a rigid body -> its name
        self.frames: dict[str, Frame] = {}

    def read(self) -> Imported:
        out = self.out
        self.up_axis = "Y" if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.y else "Z"
        prims = list(self.stage.Traverse(Usd.TraverseInstanceProxies()))
        self._scene(prims)
        bodies = [p for p in prims if p.HasAPI(UsdPhysics.RigidBodyAPI)]
        for prim in bodies:
            self.find(prim)
        for prim in prims:
            if prim.HasAPI(UsdPhysics.RigidBodyAPI):
                out.data["bodies"].append(self._kept_body(prim, self.body(prim)))
            elif prim.IsA(UsdGeom.Xform) and kept(prim, DEFINITION) is not None:
                self._soft(prim)
            elif prim.HasAPI(UsdPhysics.CollisionAPI) and self.owner(prim) is None:
                self._obstacle(prim)
        for prim in prims:
            if prim.IsA(UsdPhysics.Joint):
                self._joint(prim)
            elif not prim.IsA(UsdGeom.Xform) and kept(prim, DEFINITION) is not None:
                self._points(prim)
        if not out.data["bodies"]:
            raise InputError(f"{out.path}: holds no rigid body, no collider and nothing of Turnbuckle")
        self._tell(prims)
        return out.finish()

    def _scene(self, prims: list[Usd.Prim]) -> None:
        """Gravity, and of our own files all other fields of the scene."""
        scenes = [p for p in prims if p.IsA(UsdPhysics.Scene)]
        root = self.stage.GetDefaultPrim()
        own = kept(root, SCENE) if root else None
        self.out.data |= {k: v for k, v in (own or {}).items() if k not in ("bodies", "constraints")}
        if self.out.data.get("up_axis", "Z") != self.up_axis:
            self.out.data["up_axis"] = self.up_axis
        if not scenes:
            return
        for extra in scenes[1:]:
            self.out.note(f"physics scene {extra.GetPath()}: there is one scene in a file here, it is left out")
        scene = UsdPhysics.Scene(scenes[0])
        direction, size = scene.GetGravityDirectionAttr().Get(), scene.GetGravityMagnitudeAttr().Get()
        up = np.array([0.0, 1.0, 0.0] if self.up_axis == "Y" else [0.0, 0.0, 1.0])
        way = -up if direction is None or not np.any(direction) else np.array(direction, dtype=float)
        length = float(np.linalg.norm(way))
        if size is not None and 0.0 <= size < math.inf and math.isfinite(length) and length > 0.0:
            gravity = way / length * float(size) * self.meters
            before = np.array((own or {}).get("gravity", -9.81 * up), dtype=float)
            if before.shape != (3,) or np.abs(gravity - before).max() > 1e-5 * (1.0 + np.abs(before).max()):
                self.out.data["gravity"] = gravity

    def find(self, prim: Usd.Prim) -> None:
        """Name and pose of a rigid body."""
        own = (kept(prim, DEFINITION) or {}).get("name")
        label = own if isinstance(own, str) else prim.GetDisplayName() or prim.GetName()
        self.names[str(prim.GetPath())] = self.out.name(label, "bodies", "body")
        self.frames[str(prim.GetPath())] = placed(prim, self.meters)[0]

    def owner(self, prim: Usd.Prim) -> str | None:
        """Path of the nearest rigid body at or above a prim."""
        while prim and not prim.IsPseudoRoot():
            if prim.HasAPI(UsdPhysics.RigidBodyAPI):
                return str(prim.GetPath())
            prim = prim.GetParent()
        return None

    def body(self, prim: Usd.Prim) -> dict[str, Any]:
        """A rigid body as its standard attributes say."""
        path = str(prim.GetPath())
        name, frame = self.names[path], self.frames[path]
        parts: list[dict[str, Any]] = []
        drawn: list[dict[str, Any]] = []
        for below in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()):
            if below.IsA(UsdGeom.Gprim) and self.owner(below) == path:
                collides = below.HasAPI(UsdPhysics.CollisionAPI)
                part = part_of(below, frame, self.meters, self.out, f"body '{name}', {below.GetName()}")
                if part is not None:
                    (parts if collides else drawn).append(part)
        rigid = UsdPhysics.RigidBodyAPI(prim)
        still = rigid.GetKinematicEnabledAttr().Get() or rigid.GetRigidBodyEnabledAttr().Get() is False
        more: dict[str, Any] = {"motion": "immobile"} if still else {}
        turn = Rotation.identity() if not prim.GetParent() else placed(prim.GetParent(), self.meters)[0].turn
        for attribute, field, unit in (
            (rigid.GetVelocityAttr(), "velocity", self.meters),
            (rigid.GetAngularVelocityAttr(), "angular_velocity", math.pi / 180.0),
        ):
            value = attribute.Get()
            if value is not None and np.any(value) and not still:
                more[field] = turn.apply(np.array(value, dtype=float) * unit)
        mass, center, inertia, density = self._mass(prim)
        if density is not None and mass is None and (parts or drawn):
            more["density"] = density
        before = len(self.out.data["bodies"])
        self.out.rigid(name, frame, parts or drawn, mass, center, inertia, **more)
        return self.out.data["bodies"].pop(before)

    def _mass(self, prim: Usd.Prim) -> tuple[float | None, np.ndarray | None, np.ndarray | None, float | None]:
        """Mass [kg], centre [m], inertia [kg m^2], density [kg/m^3]; None where USD leaves it to the shapes."""
        if not prim.HasAPI(UsdPhysics.MassAPI):
            return None, None, None, None
        api = UsdPhysics.MassAPI(prim)
        mass, density = (float(a.Get() or 0.0) for a in (api.GetMassAttr(), api.GetDensityAttr()))
        center, moments, axes = (
            api.GetCenterOfMassAttr().Get(), api.GetDiagonalInertiaAttr().Get(), api.GetPrincipalAxesAttr().Get(),
        )  # fmt: skip
        place = None
        if center is not None and np.isfinite(center).all():
            place = np.array(center, dtype=float) * placed(prim, self.meters)[1] * self.meters
        inertia = None
        if moments is not None and np.all(np.array(moments) > 0.0):
            q = [0.0, 0.0, 0.0, 1.0] if axes is None else [*axes.GetImaginary(), axes.GetReal()]
            turn = Rotation.from_quat(q).as_matrix() if np.linalg.norm(q) > 1e-6 else np.eye(3)
            inertia = turn @ np.diag(np.array(moments, dtype=float)) @ turn.T * self.kilograms * self.meters**2
        found = mass * self.kilograms if mass > 0.0 else None
        return found, place, inertia, density * self.kilograms / self.meters**3 if density > 0.0 else None

    def _kept_body(self, prim: Usd.Prim, standard: dict[str, Any]) -> dict[str, Any]:
        """The body as we wrote it, or as it was changed since."""
        own = kept(prim, DEFINITION)
        if own is None:
            return standard
        if is_unchanged(prim, standard):
            return {**own, "name": standard["name"]}
        self.out.note(
            f"body '{standard['name']}': was changed by another program; its shape, mass and pose are the new ones"
        )
        return {**{k: v for k, v in own.items() if k not in STANDARD_BODY}, **standard}

    def _soft(self, prim: Usd.Prim) -> None:
        """A soft body or an obstacle that we wrote."""
        own = kept(prim, DEFINITION) or {}
        own["name"] = self.out.name(str(own.get("name", prim.GetName())), "bodies", "body")
        self.out.data["bodies"].append(own)

    def _points(self, prim: Usd.Prim) -> None:
        """A constraint of points that we wrote."""
        own = kept(prim, DEFINITION) or {}
        enabled = prim.GetAttribute(f"{PREFIX}attachmentEnabled").Get()
        if enabled is not None and bool(enabled) != own.get("enabled", True):
            own["enabled"] = bool(enabled)
        own["name"] = self.out.name(str(own.get("name", prim.GetName())), "constraints", "constraint")
        self.out.data["constraints"].append(own)

    def _obstacle(self, prim: Usd.Prim) -> None:
        """A collider that belongs to no body."""
        above = prim.GetParent()
        while above and not above.IsPseudoRoot():
            if kept(above, DEFINITION) is not None:
                return  # of a body of ours
            above = above.GetParent()
        name = self.out.name(prim.GetDisplayName() or prim.GetName(), "bodies", "obstacle")
        if prim.GetTypeName() == "Plane":
            frame, scale = placed(prim, self.meters)
            plane = UsdGeom.Plane(prim)
            axis = str(plane.GetAxisAttr().Get())
            factors = np.abs(scale)[{"X": [2, 1], "Y": [0, 2]}.get(axis, [0, 1])] * self.meters
            sides = np.array([float(a.Get() or 2.0) for a in (plane.GetWidthAttr(), plane.GetLengthAttr())]) * factors
            frame = frame * Frame(turn=ALONG.get(axis, ALONG["Z"]))
            self.out.data["bodies"].append({"type": "obstacle", "name": name, "plane": sides, **frame.fields()})
            return
        part = part_of(prim, Frame(), self.meters, self.out, f"collider '{name}'")
        if part is not None:
            self.out.data["bodies"].append({"type": "obstacle", "name": name, **part})

    def ends(self, targets: Any) -> tuple[str | None, Frame] | None:
        """Body and pose that a joint's relation means."""
        if not targets:
            return None, Frame()
        prim = self.stage.GetPrimAtPath(targets[0])
        if not prim:
            return None
        path = self.owner(prim)
        if path is None:  # something that stands still: its place is of the world
            return None, placed(prim, self.meters)[0]
        return self.names[path], self.frames[str(prim.GetPath())] if str(prim.GetPath()) in self.frames else placed(
            prim, self.meters
        )[0]

    def joint(self, prim: Usd.Prim, name: str) -> dict[str, Any] | None:
        """A joint as its standard attributes say."""
        return JointReader(self.out, self.ends, self.meters).read(prim, name)

    def _joint(self, prim: Usd.Prim) -> None:
        own = kept(prim, DEFINITION)
        label = str(own.get("name", prim.GetName())) if own else prim.GetDisplayName() or prim.GetName()
        name = self.out.name(label, "constraints", "joint")
        if (
            own is not None
            and own.get("type") in ("rolling",)
            or (own is not None and prim.GetTypeName() == "PhysicsJoint")
        ):
            quiet = Gathering(self.out.path, "quiet")
            standard = JointReader(quiet, self.ends, self.meters).read(prim, name)
        else:
            standard = self.joint(prim, name)
        if own is not None and is_unchanged(prim, standard or {}):
            self.out.data["constraints"].append({**own, "name": name})
            return
        if standard is None:
            return
        if own is not None:
            self.out.note(
                f"joint '{name}': was changed by another program; its kind, frames and limits are the new ones"
            )
            if own.get("type") == standard["type"]:
                standard = {**{k: v for k, v in own.items() if k not in STANDARD_JOINT}, **standard}
        self.out.data["constraints"].append({**standard, "name": name})

    def _tell(self, prims: list[Usd.Prim]) -> None:
        """All else that simulates."""
        soft, other = [], []
        for prim in prims:
            schemas = prim.GetPrimTypeInfo().GetAppliedAPISchemas()  # also those that this USD does not know
            if (
                any("Deformable" in s or "Cloth" in s or "Particle" in s for s in schemas)
                and kept(prim, DEFINITION) is None
            ):
                soft.append(str(prim.GetPath()))
            kind = prim.GetTypeName()
            foreign = any(word in kind for word in ("Attachment", "Tendon", "Joint", "CollisionGroup"))
            foreign = foreign and not prim.IsA(UsdPhysics.Joint)
            if foreign and kept(prim, DEFINITION) is None and not prim.HasAttribute(PART_OF):
                other.append(f"{prim.GetPath()} ({kind})")
        self.out.note_all("deformable bodies of other programs have no counterpart", soft)
        self.out.note_all("prims that have no counterpart", other)
        friction = [str(p.GetPath()) for p in prims if p.HasAPI(UsdPhysics.MaterialAPI)]
        self.out.note_all("materials of contact are left out; say friction in the scene", friction)
