"""The joints of the field by their names, each a few lines over the general joint (`joint_definitions.py`).

Axes are in body0's frame; body1's axis is the one that lies on it at the start. Limits are measured from the start.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from turnbuckle.scene.base_definition import Definition, problem
from turnbuckle.scene.fields import NonNegative, Number, Positive, Vec3
from turnbuckle.scene.joint_definitions import (
    AngleDef,
    AxialDef,
    BodyPairDef,
    JointDef,
    MotorDef,
    PlanarDef,
    SphereDomainDef,
    TwistDef,
    ordered,
    unit,
)

ROUNDING = 1e-9  # [rad]; pi itself, written with a few digits, is no mistake


def perpendicular(axis: np.ndarray) -> np.ndarray:
    """A unit vector perpendicular to ``axis``."""
    a = axis / np.linalg.norm(axis)
    e = np.zeros(3)
    e[np.argmin(np.abs(a))] = 1.0
    b = e - (e @ a) * a
    return b / np.linalg.norm(b)


class NamedJointDef(BodyPairDef):
    """A joint that becomes a general one once it is known how body1 lies in body0 at the start."""

    @model_validator(mode="after")
    def _check_place(self) -> NamedJointDef:
        if self.anchor is None and (self.local_pos0 is None or self.local_pos1 is None):
            raise problem("give anchor, or both local_pos0 and local_pos1")
        return self

    def general(self, to_body1: Rotation, **parts: Any) -> JointDef:
        """The general joint with the common fields of this one."""
        common = {name: getattr(self, name) for name in BodyPairDef.model_fields if name in self.model_fields_set}
        return JointDef(**common, **parts)

    def as_general(self, to_body1: Rotation) -> JointDef:
        """The general joint. ``to_body1`` turns vectors of body0's frame into body1's at the start."""
        raise NotImplementedError


class BallDef(NamedJointDef):
    """Both points coincide; all rotations are free (a "point to point" constraint, section 3)."""

    type: Literal["ball"] = "ball"

    def as_general(self, to_body1: Rotation) -> JointDef:
        return self.general(to_body1)


class AxisJointDef(NamedJointDef):
    """What joints with an axis share."""

    axis: Vec3 = Field(description="Axis in body0's frame [1].")

    @model_validator(mode="after")
    def _check_axis(self) -> AxisJointDef:
        unit(self.axis, "axis")
        return self

    def _angle(self, to_body1: Rotation, low: float, high: float) -> AngleDef:
        return AngleDef(axis0=self.axis, axis1=to_body1.apply(np.array(self.axis)), min=low, max=high)

    def _twist(self, to_body1: Rotation, low: float | None, high: float | None) -> TwistDef:
        b = perpendicular(self.axis)
        return TwistDef(
            axis0=self.axis,
            axis1=to_body1.apply(np.array(self.axis)),
            vector0=b,
            vector1=to_body1.apply(b),
            min=low,
            max=high,
        )


class TurnLimitsDef(Definition):
    """Limits of a rotation from the start, which lies within half a turn: all that is above limits nothing."""

    lower_limit: Number | None = Field(default=None, description="Least rotation from the start, at least -pi [rad].")
    upper_limit: Number | None = Field(default=None, description="Largest rotation from the start, at most pi [rad].")

    @model_validator(mode="after")
    def _check_limits(self) -> TurnLimitsDef:
        ordered(self.lower_limit, self.upper_limit, ("lower_limit", "upper_limit"))
        for name in ("lower_limit", "upper_limit"):
            limit = getattr(self, name)
            if limit is not None and abs(limit) > math.pi + ROUNDING:
                raise problem(
                    f"a rotation of {limit:g} rad from the start is outside of -pi to pi; give less than half a turn, or no "
                    "limit (angles are in rad)", name,
                )  # fmt: skip
        return self


class PlaceLimitsDef(Definition):
    """Limits of a place along the axis."""

    lower_limit: Number | None = Field(default=None, description="Lowest place along the axis [m].")
    upper_limit: Number | None = Field(default=None, description="Highest place along the axis [m].")

    @model_validator(mode="after")
    def _check_limits(self) -> PlaceLimitsDef:
        ordered(self.lower_limit, self.upper_limit, ("lower_limit", "upper_limit"))
        return self


def _check_motor(motor: MotorDef | None, on: str, kind: str) -> None:
    if motor is not None and motor.on != on:
        raise problem(f"the motor of a {kind} joint drives its {on}, not {motor.on}; write on: {on}", "motor", "on")


class RevoluteDef(TurnLimitsDef, AxisJointDef):
    """Rotation about one axis."""

    type: Literal["revolute"] = "revolute"
    motor: MotorDef | None = Field(default=None, description="Drives the rotation (on: twist) [motor].")

    @model_validator(mode="after")
    def _check_drive(self) -> RevoluteDef:
        _check_motor(self.motor, "twist", "revolute")
        return self

    def as_general(self, to_body1: Rotation) -> JointDef:
        parts: dict[str, Any] = {"angle": self._angle(to_body1, 0.0, 0.0)}
        if self.motor is not None or self.lower_limit is not None or self.upper_limit is not None:
            parts["twist"] = self._twist(to_body1, self.lower_limit, self.upper_limit)
        return self.general(to_body1, motor=self.motor, **parts)


class UniversalDef(NamedJointDef):
    """A cross: an axis of each body, which stay perpendicular."""

    type: Literal["universal"] = "universal"
    axis0: Vec3 = Field(description="Axis in body0's frame [1].")
    axis1: Vec3 = Field(description="Axis in body1's frame, perpendicular to axis0 at the start [1].")

    def as_general(self, to_body1: Rotation) -> JointDef:
        half = 0.5 * np.pi
        return self.general(to_body1, angle=AngleDef(axis0=self.axis0, axis1=self.axis1, min=half, max=half))


class PrismaticDef(PlaceLimitsDef, AxisJointDef):
    """Translation along one axis, no rotation."""

    type: Literal["prismatic"] = "prismatic"
    motor: MotorDef | None = Field(default=None, description="Drives the translation (on: axial) [motor].")

    @model_validator(mode="after")
    def _check_drive(self) -> PrismaticDef:
        _check_motor(self.motor, "axial", "prismatic")
        return self

    def as_general(self, to_body1: Rotation) -> JointDef:
        axial = AxialDef(axis=self.axis, min=self.lower_limit, max=self.upper_limit)
        return self.general(to_body1, axial=axial, motor=self.motor, fixed_rotation=True)


class CylindricalDef(PlaceLimitsDef, AxisJointDef):
    """Translation along one axis and rotation about it."""

    type: Literal["cylindrical"] = "cylindrical"

    def as_general(self, to_body1: Rotation) -> JointDef:
        axial = AxialDef(axis=self.axis, min=self.lower_limit, max=self.upper_limit)
        return self.general(to_body1, axial=axial, angle=self._angle(to_body1, 0.0, 0.0))


class PlanarJointDef(AxisJointDef):
    """Body1 moves in a plane of normal `axis` and turns about it."""

    type: Literal["planar"] = "planar"

    def as_general(self, to_body1: Rotation) -> JointDef:
        return self.general(to_body1, planar=PlanarDef(normal=self.axis), angle=self._angle(to_body1, 0.0, 0.0))


class WeldDef(NamedJointDef):
    """Both bodies move as one."""

    type: Literal["weld"] = "weld"

    def as_general(self, to_body1: Rotation) -> JointDef:
        return self.general(to_body1, fixed_rotation=True)


class DistanceDef(NamedJointDef):
    """Both points stay at a distance: a rod, or with min and max a rope."""

    type: Literal["distance"] = "distance"
    min: NonNegative = Field(default=0.0, description="Least distance [m].")
    max: NonNegative | None = Field(default=None, description="Largest distance [m].")
    stiffness: Positive | None = Field(default=None, description="A spring instead of a strict distance [N/m].")
    damping: NonNegative | None = Field(default=None, description="A damper beside it [N s/m].")

    @model_validator(mode="after")
    def _check_range(self) -> DistanceDef:
        ordered(self.min, self.max)
        return self

    def as_general(self, to_body1: Rotation) -> JointDef:
        return self.general(
            to_body1,
            sphere=SphereDomainDef(min=self.min, max=self.max, stiffness=self.stiffness, damping=self.damping),
        )


class ConeTwistDef(TurnLimitsDef, AxisJointDef):
    """A ball joint of which the axis stays in a cone, with a limited twist: shoulders and hips."""

    type: Literal["cone_twist"] = "cone_twist"
    cone: NonNegative = Field(description="Largest angle of body1's axis to body0's [rad].")

    def as_general(self, to_body1: Rotation) -> JointDef:
        parts: dict[str, Any] = {"angle": self._angle(to_body1, 0.0, self.cone)}
        if self.lower_limit is not None or self.upper_limit is not None:
            parts["twist"] = self._twist(to_body1, self.lower_limit, self.upper_limit)
        return self.general(to_body1, **parts)


class PointToRingDef(AxisJointDef):
    """A point of body1 in a disc or ring of body0 (4.1.2)."""

    type: Literal["point_to_ring"] = "point_to_ring"
    min: NonNegative = Field(default=0.0, description="Inner radius [m].")
    max: NonNegative | None = Field(default=None, description="Outer radius [m].")

    @model_validator(mode="after")
    def _check_range(self) -> PointToRingDef:
        ordered(self.min, self.max)
        return self

    def as_general(self, to_body1: Rotation) -> JointDef:
        return self.general(to_body1, planar=PlanarDef(normal=self.axis, min=self.min, max=self.max))


class RollingDef(NamedJointDef):
    """A wheel of body1 rolls without slip on a plane of body0: centre at `local_pos1`, plane through `local_pos0`."""

    type: Literal["rolling"] = "rolling"
    normal: Vec3 = Field(description="Normal of the plane in body0's frame, towards the wheel [1].")
    radius: Positive = Field(description="Radius of the wheel [m].")
    axis: Vec3 | None = Field(
        default=None, description="Axle of a wheel with an edge, in body1's frame; a ball when left out [1]."
    )

    def as_general(self, to_body1: Rotation) -> JointDef:
        raise problem("a rolling joint has no general form")
