"""Joints as UsdPhysics joints, with the frames that say the same."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.io.imported import Frame
from turnbuckle.scene.joint_definitions import BodyPairDef, JointDef, MotorDef
from turnbuckle.scene.named_joints import perpendicular

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Gf, Usd, UsdPhysics

# Of a joint with six degrees of freedom, those that are locked; the axis is x.
LOCKED = {
    "cylindrical": ("transY", "transZ", "rotY", "rotZ"),
    "planar": ("transX", "rotY", "rotZ"),
    "universal": ("transX", "transY", "transZ", "rotX"),
}
TYPES = {
    "revolute": "RevoluteJoint", "prismatic": "PrismaticJoint", "ball": "SphericalJoint", "cone_twist": "SphericalJoint",
    "weld": "FixedJoint", "distance": "DistanceJoint",
}  # fmt: skip


def write_joint(
    stage: Usd.Stage,
    path: str,
    d: BodyPairDef,
    bodies: Mapping[str, str],
    frames: Mapping[str, Frame],
    notes: list[str],
) -> Usd.Prim:
    """Define the joint ``d``; ``bodies``: prims, ``frames``: poses at the start, both by name."""
    kind = d.type  # type: ignore[attr-defined]
    joint = getattr(UsdPhysics, TYPES.get(kind, "Joint")).Define(stage, path)
    frame0, frame1 = Frame() if d.body0 is None else frames[d.body0], frames[d.body1]
    to_body1 = frame1.turn.inv() * frame0.turn
    if d.anchor is not None:
        anchor = Frame(np.array(d.anchor))
        place0, place1 = (frame0.inverse() * anchor).x, (frame1.inverse() * anchor).x
    else:
        place0, place1 = (np.zeros(3) if p is None else np.array(p) for p in (d.local_pos0, d.local_pos1))
    axis = getattr(d, "axis", None)
    turn0 = _frame_of(np.array(axis)) if axis is not None else Rotation.identity()
    turn1 = to_body1 * turn0
    if kind == "universal":
        turn0, turn1 = _cross(np.array(d.axis0), np.array(d.axis1), to_body1)  # type: ignore[attr-defined]
    if d.body0 is not None:
        joint.CreateBody0Rel().SetTargets([bodies[d.body0]])
    joint.CreateBody1Rel().SetTargets([bodies[d.body1]])
    for place, turn, position, rotation in (
        (place0, turn0, joint.CreateLocalPos0Attr, joint.CreateLocalRot0Attr),
        (place1, turn1, joint.CreateLocalPos1Attr, joint.CreateLocalRot1Attr),
    ):
        position(Gf.Vec3f(*place.tolist()))
        x, y, z, w = turn.as_quat().tolist()
        rotation(Gf.Quatf(w, x, y, z))
    joint.CreateJointEnabledAttr(bool(d.enabled))
    if d.break_force is not None:
        joint.CreateBreakForceAttr(float(d.break_force))
    if d.break_torque is not None:
        joint.CreateBreakTorqueAttr(float(d.break_torque))
    prim = joint.GetPrim()
    _kind(joint, prim, kind, d, notes)
    return prim


def _frame_of(axis: np.ndarray) -> Rotation:
    """A rotation that takes x onto an axis."""
    a = axis / np.linalg.norm(axis)
    b = perpendicular(a)
    return Rotation.from_matrix(np.stack([a, b, np.cross(a, b)], axis=1))


def _cross(axis0: np.ndarray, axis1: np.ndarray, to_body1: Rotation) -> tuple[Rotation, Rotation]:
    """Frames of a universal joint: y along the first axis, z along the second."""
    y = axis0 / np.linalg.norm(axis0)
    z = to_body1.inv().apply(axis1 / np.linalg.norm(axis1))
    x = np.cross(y, z)
    x /= np.linalg.norm(x)
    turn0 = Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=1))
    return turn0, to_body1 * turn0


def _kind(joint: Any, prim: Usd.Prim, kind: str, d: Any, notes: list[str]) -> None:
    """What each kind says beyond its frames."""
    if kind in ("revolute", "prismatic"):
        unit = 180.0 / math.pi if kind == "revolute" else 1.0
        joint.CreateAxisAttr("X")
        if d.lower_limit is not None:
            joint.CreateLowerLimitAttr(float(d.lower_limit) * unit)
        if d.upper_limit is not None:
            joint.CreateUpperLimitAttr(float(d.upper_limit) * unit)
        if d.motor is not None:
            _drive(prim, "angular" if kind == "revolute" else "linear", d.motor, unit)
    elif kind == "cone_twist":
        joint.CreateAxisAttr("X")
        joint.CreateConeAngle0LimitAttr(math.degrees(d.cone))
        joint.CreateConeAngle1LimitAttr(math.degrees(d.cone))
        if d.lower_limit is not None or d.upper_limit is not None:
            notes.append(f"joint '{d.name}': its limits of twist have no counterpart in UsdPhysics")
    elif kind == "distance":
        joint.CreateMinDistanceAttr(float(d.min))
        joint.CreateMaxDistanceAttr(-1.0 if d.max is None else float(d.max))
        if d.stiffness is not None or d.damping is not None:
            notes.append(f"joint '{d.name}': other programs see a rod where it is a spring")
    elif kind in LOCKED:
        for freedom in LOCKED[kind]:
            limit = UsdPhysics.LimitAPI.Apply(prim, freedom)
            limit.CreateLowAttr(1.0)  # low above high is locked
            limit.CreateHighAttr(-1.0)
        if kind == "cylindrical" and (d.lower_limit is not None or d.upper_limit is not None):
            limit = UsdPhysics.LimitAPI.Apply(prim, "transX")
            limit.CreateLowAttr(-math.inf if d.lower_limit is None else float(d.lower_limit))
            limit.CreateHighAttr(math.inf if d.upper_limit is None else float(d.upper_limit))
    elif kind not in TYPES:
        if kind == "joint" and _holds_point(d):
            for freedom in ("transX", "transY", "transZ", *(("rotX", "rotY", "rotZ") if d.fixed_rotation else ())):
                limit = UsdPhysics.LimitAPI.Apply(prim, freedom)
                limit.CreateLowAttr(1.0)
                limit.CreateHighAttr(-1.0)
            if d.angle is None and d.twist is None:
                return
        notes.append(
            f"joint '{d.name}': UsdPhysics has no joint of its kind ({kind}); other programs leave parts of it free"
        )


def _holds_point(d: JointDef) -> bool:
    """Whether a general joint keeps two points together."""
    return not d.has_no_place and not d.given(("axial", "planar", "curve", "surface", "sphere", "domain"))


def _drive(prim: Usd.Prim, freedom: str, motor: MotorDef, unit: float) -> None:
    """A motor as a drive of accelerations, critically damped within its time constant."""
    drive = UsdPhysics.DriveAPI.Apply(prim, freedom)
    drive.CreateTypeAttr("acceleration")
    tau = float(motor.time_constant)
    if motor.target_position is not None:
        drive.CreateTargetPositionAttr(float(motor.target_position) * unit)
        drive.CreateStiffnessAttr(1.0 / tau**2)
        drive.CreateDampingAttr(2.0 / tau)
    else:
        assert motor.target_velocity is not None
        drive.CreateTargetVelocityAttr(float(motor.target_velocity) * unit)
        drive.CreateDampingAttr(1.0 / tau)
    if motor.max_force is not None:
        drive.CreateMaxForceAttr(float(motor.max_force))
