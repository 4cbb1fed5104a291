"""Joints of UsdPhysics as ours. Each says what its standard attributes mean; what has no counterpart is noted.

A USD joint has a frame in each body and its limits count from where both agree; ours count from the start, so the angle
of the start is taken off. Degrees here and nowhere else.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.io.imported import Frame, Gathering

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Usd, UsdPhysics

AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}
ALIGNED = 1e-5  # [rad], float32 quaternions
LARGE = 1e30  # limits beyond are none


class JointReader:
    """Reads joints between bodies whose poses are known."""

    def __init__(self, out: Gathering, bodies: Callable[[Any], tuple[str | None, Frame] | None], meters: float) -> None:
        """``bodies``: the targets of `body0` or `body1` -> name (None: the world) and pose; None where it is no body."""
        self.out, self.bodies, self.meters = out, bodies, meters

    def read(self, prim: Usd.Prim, name: str) -> dict[str, Any] | None:
        """The joint as a dict of our fields, `type` with it; None, with a note, where there is no counterpart."""
        joint = UsdPhysics.Joint(prim)
        ends = []
        for which, relation in (("body0", joint.GetBody0Rel()), ("body1", joint.GetBody1Rel())):
            found = self.bodies(relation.GetTargets())
            if found is None:
                self.out.note(f"joint '{name}': its {which} is no rigid body, and it is left out")
                return None
            ends.append(found)
        local = [
            self._frame(joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
            self._frame(joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
        ]
        self.flipped = ends[1][0] is None  # our second body is never the world
        if self.flipped:
            ends.reverse()
            local.reverse()
        (body0, pose0), (body1, pose1) = ends
        if body1 is None or body0 == body1:
            self.out.note(f"joint '{name}': joins no two bodies, and is left out")
            return None
        world = [pose0 * local[0], pose1 * local[1]]
        self.local, self.relative = local, world[0].turn.inv() * world[1].turn
        fields = self._kind(prim, name)
        if fields is None:
            return None
        common: dict[str, Any] = {"local_pos0": local[0].x, "local_pos1": local[1].x, "body1": body1}
        if body0 is not None:
            common["body0"] = body0
        if joint.GetJointEnabledAttr().Get() is False:
            common["enabled"] = False
        for attribute, field in (
            (joint.GetBreakForceAttr(), "break_force"),
            (joint.GetBreakTorqueAttr(), "break_torque"),
        ):
            value = attribute.Get()
            if value is not None and 0.0 < value < LARGE:
                common[field] = float(value)
        return {**fields, **common}

    def _frame(self, position: Usd.Attribute, rotation: Usd.Attribute) -> Frame:
        x, q = position.Get(), rotation.Get()
        turn = Rotation.identity()
        if q is not None and (norm := math.hypot(q.GetReal(), *q.GetImaginary())) > 1e-9 and math.isfinite(norm):
            turn = Rotation.from_quat([*q.GetImaginary(), q.GetReal()])
        place = np.zeros(3) if x is None else np.array(x, dtype=float) * self.meters
        return Frame(place, turn)

    def _kind(self, prim: Usd.Prim, name: str) -> dict[str, Any] | None:
        kind = prim.GetTypeName()
        if kind == "PhysicsRevoluteJoint":
            joint = UsdPhysics.RevoluteJoint(prim)
            low, high = self._range(joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get(), math.pi / 180)
            return self._turning(name, AXES[self._axis(joint)], low, high, self._motor(prim, "angular", name))
        if kind == "PhysicsPrismaticJoint":
            joint = UsdPhysics.PrismaticJoint(prim)
            low, high = self._range(joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get(), self.meters)
            self._straight(name)
            fields = {"type": "prismatic", "axis": self._in0(AXES[self._axis(joint)])}
            return {**fields, **self.out.limits(name, low, high, False), **self._motor(prim, "linear", name)}
        if kind == "PhysicsSphericalJoint":
            return self._ball(prim, name)
        if kind == "PhysicsFixedJoint":
            self._straight(name)
            return {"type": "weld"}
        if kind == "PhysicsDistanceJoint":
            joint = UsdPhysics.DistanceJoint(prim)
            low, high = joint.GetMinDistanceAttr().Get(), joint.GetMaxDistanceAttr().Get()
            fields = {"type": "distance"}
            fields |= {} if low is None or low < 0 else {"min": low * self.meters}
            return fields | ({} if high is None or high < 0 else {"max": high * self.meters})
        if kind == "PhysicsJoint":
            return self._any(prim, name)
        self.out.note(f"joint '{name}': a joint of type {kind} has no counterpart")
        return None

    def _axis(self, joint: Any) -> str:
        axis = str(joint.GetAxisAttr().Get())
        return axis if axis in AXES else "X"

    def _in0(self, axis: np.ndarray) -> np.ndarray:
        """An axis of the joint in body0's frame."""
        return self.local[0].turn.apply(axis)

    def _range(self, low: float | None, high: float | None, unit: float) -> tuple[float | None, float | None]:
        """Limits in our units; the other way round where the bodies are."""
        ends = [None if v is None or not abs(v) < LARGE else v * unit for v in (low, high)]
        if self.flipped:
            ends = [None if v is None else -v for v in reversed(ends)]
        return ends[0], ends[1]

    def _straight(self, name: str) -> None:
        """Say so where a rotation that is to vanish does not."""
        off = float(self.relative.magnitude())
        if off > ALIGNED:
            self.out.note(f"joint '{name}': keeps the rotation of the start, {off:.3g} rad from the file's")

    def _turning(
        self, name: str, axis: np.ndarray, low: float | None, high: float | None, motor: dict[str, Any]
    ) -> dict[str, Any]:
        """A revolute joint; the general one, where the axes do not lie on each other at the start."""
        there = self.relative.apply(axis)
        across = np.cross(axis, there)
        if np.linalg.norm(across) > ALIGNED or axis @ there < 0.0:
            side = np.roll(axis, 1)
            angle = {"axis0": self._in0(axis), "axis1": self.local[1].turn.apply(axis), "min": 0.0, "max": 0.0}
            fields: dict[str, Any] = {"type": "joint", "angle": angle}
            limits = self.out.limits(name, low, high, True)
            if limits or motor:
                fields["twist"] = {
                    "vector0": self._in0(side), "vector1": self.local[1].turn.apply(side),
                    **{k.partition("_")[0].replace("lower", "min").replace("upper", "max"): v for k, v in limits.items()},
                }  # fmt: skip
            return {**fields, **motor}
        q = self.relative.as_quat()
        start = 2.0 * math.atan2(float(q[:3] @ axis), float(q[3]))
        start = (start + math.pi) % (2.0 * math.pi) - math.pi
        if abs(start) < 1e-6:
            start = 0.0
        low, high = (None if v is None else v - start for v in (low, high))
        return {"type": "revolute", "axis": self._in0(axis), **self.out.limits(name, low, high, True), **motor}

    def _ball(self, prim: Usd.Prim, name: str) -> dict[str, Any]:
        joint = UsdPhysics.SphericalJoint(prim)
        cones = [joint.GetConeAngle0LimitAttr().Get(), joint.GetConeAngle1LimitAttr().Get()]
        given = [c for c in cones if c is not None and 0.0 <= c < 180.0]
        if not given:
            return {"type": "ball"}
        if len(given) < 2 or abs(given[0] - given[1]) > 1e-4:
            self.out.note(f"joint '{name}': a cone with two angles has no counterpart; the larger is taken")
        if self.relative.magnitude() > ALIGNED:
            self.out.note(f"joint '{name}': its cone is measured from the start")
        return {"type": "cone_twist", "axis": self._in0(AXES[self._axis(joint)]), "cone": math.radians(max(given))}

    def _any(self, prim: Usd.Prim, name: str) -> dict[str, Any] | None:
        """A joint of six degrees of freedom, each locked, limited or free."""
        locked: set[str] = set()
        limits: dict[str, tuple[float | None, float | None]] = {}
        for freedom in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
            api = UsdPhysics.LimitAPI.Get(prim, freedom)
            if not api or not prim.HasAPI(UsdPhysics.LimitAPI, freedom):
                continue
            low, high = api.GetLowAttr().Get(), api.GetHighAttr().Get()
            if low is not None and high is not None and low > high:
                locked.add(freedom)
            elif any(v is not None and abs(v) < LARGE for v in (low, high)):
                unit = math.pi / 180 if freedom.startswith("rot") else self.meters
                limits[freedom] = self._range(low, high, unit)
        moves = [a for a in "XYZ" if f"trans{a}" not in locked]
        turns = [a for a in "XYZ" if f"rot{a}" not in locked]
        told: set[str] = set()
        found: dict[str, Any] | None = None
        if not moves and not turns:
            self._straight(name)
            found = {"type": "weld"}
        elif not moves and len(turns) == 1:
            low, high = limits.get(f"rot{turns[0]}", (None, None))
            told = {f"rot{turns[0]}"}
            found = self._turning(name, AXES[turns[0]], low, high, self._motor(prim, f"rot{turns[0]}", name))
        elif not moves and len(turns) == 2:
            axes = {"axis0": self._in0(AXES[turns[0]]), "axis1": self.local[1].turn.apply(AXES[turns[1]])}
            found = {"type": "universal", **axes}
        elif not moves:
            found = {"type": "ball"}
        elif len(moves) == 1 and turns in ([], moves):
            low, high = limits.get(f"trans{moves[0]}", (None, None))
            told = {f"trans{moves[0]}"}
            kind = "cylindrical" if turns else "prismatic"
            found = {"type": kind, "axis": self._in0(AXES[moves[0]]), **self.out.limits(name, low, high, False)}
            if not turns:
                self._straight(name)
                found |= self._motor(prim, f"trans{moves[0]}", name)
        elif len(moves) == 2 and turns == [a for a in "XYZ" if a not in moves]:
            found = {"type": "planar", "axis": self._in0(AXES[turns[0]])}
        elif len(moves) == 3 and not turns:
            found = {"type": "joint", "fixed_rotation": True}
        if found is None:
            free = ", ".join([f"trans{a}" for a in moves] + [f"rot{a}" for a in turns])
            self.out.note(f"joint '{name}': a joint with {free} free has no counterpart, and is left out")
            return None
        self.out.note_all(f"joint '{name}': limits that have no counterpart", sorted(set(limits) - told))
        return found

    def _motor(self, prim: Usd.Prim, freedom: str, name: str) -> dict[str, Any]:
        """`motor` from a drive: at a speed where it has no stiffness, else at a place."""
        if not prim.HasAPI(UsdPhysics.DriveAPI, freedom):
            return {}
        drive = UsdPhysics.DriveAPI.Get(prim, freedom)
        angular = freedom == "angular" or freedom.startswith("rot")
        unit = (math.pi / 180 if angular else self.meters) * (-1.0 if self.flipped else 1.0)
        stiffness, damping = (float(a.Get() or 0.0) for a in (drive.GetStiffnessAttr(), drive.GetDampingAttr()))
        motor: dict[str, Any] = {"on": "twist" if angular else "axial"}
        if stiffness > 0.0:
            motor["target_position"] = float(drive.GetTargetPositionAttr().Get() or 0.0) * unit
            if damping > 0.0:
                motor["time_constant"] = 2.0 * damping / stiffness if damping < LARGE else 0.05
        elif damping > 0.0:
            motor["target_velocity"] = float(drive.GetTargetVelocityAttr().Get() or 0.0) * unit
        else:
            return {}
        most = drive.GetMaxForceAttr().Get()
        if most is not None and 0.0 < most < LARGE:
            motor["max_force"] = float(most)
        if stiffness > 0.0 or str(drive.GetTypeAttr().Get()) != "acceleration":
            self.out.note(f"joint '{name}': its drive became a motor without stiffness and damping of its own")
        return {"motor": motor}
