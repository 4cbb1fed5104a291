"""Joints as the user writes them (Displacement, sections 3 and 4).

`body0` carries the domain (axis, ring, curve, surface, sphere), `body1` the point that stays in it; without a `body0` the
domain is fixed in the world. The paper's section 4 has the roles the other way round (P1 of S1 in a domain of S2), its
grammar has them as here (`axial u1`): see docs. All vectors are in the frame of the body that their number names.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic.json_schema import SkipJsonSchema

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.body_definitions import MESH, _check_indices
from turnbuckle.scene.constraint_definitions import ConstraintBase, RampDef
from turnbuckle.scene.fields import Flag, MeshPath, Name, NonNegative, Number, Positions, Positive, Triangles, Vec3

PERPENDICULAR = 1e-6  # [rad], how far from perpendicular a twist vector may be to its axis before it is refused


def unit(value: np.ndarray, *at: str) -> None:
    """Refuse a direction of no length."""
    if not np.linalg.norm(value) > 1e-12:
        raise problem("a direction must not be zero", *at)


class SoftDef(Definition):
    """What makes a domain preferential instead of strict: a spring and damper outside of it (section 6)."""

    stiffness: Positive | None = Field(default=None, description="Spring outside the domain [N/m or N m/rad].")
    damping: NonNegative | None = Field(default=None, description="Damper outside the domain [N s/m or N m s/rad].")

    @property
    def soft(self) -> bool:
        """Whether the domain is preferential."""
        return self.stiffness is not None or self.damping is not None


def ordered(low: float | None, high: float | None, names: tuple[str, str] = ("min", "max")) -> None:
    """Refuse a range that is empty."""
    if low is not None and high is not None and low > high:
        raise problem(f"{names[0]} {low:g} is above {names[1]} {high:g}", names[1])


class AxialDef(SoftDef):
    """The point of body1 on a segment of body0 through `local_pos0` (4.1.1). With stiffness only min and max are soft."""

    axis: Vec3 = Field(description="Direction in body0 [1].")
    min: Number | None = Field(default=None, description="Lowest place along the axis, unlimited when left out [m].")
    max: Number | None = Field(default=None, description="Highest place along the axis, unlimited when left out [m].")

    @model_validator(mode="after")
    def _check(self) -> AxialDef:
        unit(self.axis, "axis")
        ordered(self.min, self.max)
        return self


class PlanarDef(SoftDef):
    """The point of body1 in a plane of body0 through `local_pos0`, in a ring or disc about it (4.1.2)."""

    normal: Vec3 = Field(description="Normal of the plane in body0 [1].")
    min: NonNegative = Field(default=0.0, description="Inner radius [m].")
    max: NonNegative | None = Field(default=None, description="Outer radius, unlimited when left out [m].")

    @model_validator(mode="after")
    def _check(self) -> PlanarDef:
        unit(self.normal, "normal")
        ordered(self.min, self.max)
        return self


class SphereDomainDef(SoftDef):
    """The point of body1 at a distance from `local_pos0` between min and max (4.1.3); min = max is a rod."""

    min: NonNegative = Field(default=0.0, description="Least distance [m].")
    max: NonNegative | None = Field(default=None, description="Largest distance, unlimited when left out [m].")

    @model_validator(mode="after")
    def _check(self) -> SphereDomainDef:
        ordered(self.min, self.max)
        return self


class CurveDef(Definition):
    """The point of body1 on a curve of body0 (4.1.3)."""

    points: Positions = Field(description="Points of the curve in body0's frame, shape (k, 3) [m].")
    interpolation: Literal["polyline", "spline"] = Field(default="polyline", description="Straight, or cubic [text].")
    closed: Flag = Field(default=False, description="Whether the last point joins the first [true or false].")

    @model_validator(mode="after")
    def _check(self) -> CurveDef:
        if len(self.points) < (3 if self.closed else 2):
            raise problem(f"needs at least {3 if self.closed else 2} points", "points")
        if (np.linalg.norm(np.diff(self.points, axis=0), axis=1) == 0.0).any():
            raise problem("two points after each other are the same", "points")
        return self


class SurfaceDef(Definition):
    """The point of body1 on a triangle surface of body0 (4.1.3)."""

    mesh: MeshPath | None = MESH
    vertices: Positions | None = Field(default=None, description="Points in body0's frame, shape (n, 3) [m].")
    triangles: Triangles | None = Field(default=None, description="Triangles of them, shape (m, 3) [indices].")

    @model_validator(mode="after")
    def _check(self) -> SurfaceDef:
        exactly_one(self, [("mesh",), ("vertices", "triangles")])
        if self.vertices is not None:
            _check_indices(self.triangles, len(self.vertices), "triangles")
        return self


class AngleDef(SoftDef):
    """The angle between a direction of each body (4.2.1): a cone, a difference of cones, or with min = max its surface."""

    axis0: Vec3 = Field(description="Direction in body0 [1].")
    axis1: Vec3 = Field(description="Direction in body1 [1].")
    min: Number = Field(default=0.0, ge=0.0, description="Least angle [rad].")
    max: Number | None = Field(default=None, ge=0.0, description="Largest angle; pi or more limits nothing [rad].")

    @model_validator(mode="after")
    def _check(self) -> AngleDef:
        unit(self.axis0, "axis0")
        unit(self.axis1, "axis1")
        ordered(self.min, self.max)
        if self.min > math.pi:
            raise problem("no angle between two directions is above pi", "min")
        return self


class TwistDef(SoftDef):
    """The rotation about the common axis that takes `vector0` to `vector1` (4.2.2), by swing and twist."""

    axis0: Vec3 | None = Field(default=None, description="Axis in body0, that of `angle` when left out [1].")
    axis1: Vec3 | None = Field(default=None, description="Axis in body1, that of `angle` when left out [1].")
    vector0: Vec3 = Field(description="Direction in body0, perpendicular to its axis [1].")
    vector1: Vec3 = Field(description="Direction in body1, perpendicular to its axis [1].")
    min: Number | None = Field(default=None, description="Least twist, in [-pi, pi], unlimited when left out [rad].")
    max: Number | None = Field(default=None, description="Largest twist, in [-pi, pi], unlimited when left out [rad].")

    @model_validator(mode="after")
    def _check(self) -> TwistDef:
        unit(self.vector0, "vector0")
        unit(self.vector1, "vector1")
        ordered(self.min, self.max)
        return self


class MotorDef(Definition):
    """Drives the free place along `axial` or the free rotation `twist` of its joint, with a bounded force."""

    on: Literal["axial", "twist"] = Field(description="Which free axis [text].")
    target_velocity: Number | None = Field(default=None, description="Wanted rate [m/s or rad/s].")
    target_position: Number | None = Field(default=None, description="Wanted place or angle [m or rad].")
    max_force: Positive | None = Field(default=None, description="Largest force or torque, unlimited [N or N m].")
    time_constant: Positive = Field(default=0.05, description="A target position is approached within this [s].")

    @model_validator(mode="after")
    def _check(self) -> MotorDef:
        exactly_one(self, [("target_velocity",), ("target_position",)])
        return self


class BodyPairDef(ConstraintBase):
    """What all joints share: two bodies (or one and the world) and where they meet."""

    body0: Name | None = Field(default=None, description="Body with the domain, the world when left out [text].")
    body1: Name = Field(description="Body with the point [text].")
    local_pos0: Vec3 | None = Field(default=None, description="The joint's place in body0's frame [m].")
    local_pos1: Vec3 | None = Field(default=None, description="The joint's place in body1's frame [m].")
    anchor: Vec3 | None = Field(default=None, description="In place of both: the place in the world at the start [m].")
    ramp: SkipJsonSchema[RampDef | None] = Field(default=None, description="Not for joints, see assemble [steps].")
    break_torque: Positive | None = Field(default=None, description="Switched off for good above this torque [N m].")
    restitution: NonNegative = Field(default=0.0, le=1.0, description="Part of the speed kept at a limit [1].")
    mu: Positive | None = Field(
        default=None, lt=1.0, description="Part of a correction that body1 takes, displacement solver (3.1.4) [1]."
    )
    alpha: Positive | None = Field(
        default=None, description="Speed of convergence of this pair, displacement solver (3.1.2); the scene's [1]."
    )

    @model_validator(mode="after")
    def _check_pair(self) -> BodyPairDef:
        if self.body0 == self.body1:
            raise problem(f"joins {self.body1!r} with itself", "body1")
        if self.anchor is not None and (self.local_pos0 is not None or self.local_pos1 is not None):
            raise problem("give anchor, or local_pos0 and local_pos1", "anchor")
        if self.ramp is not None:
            raise problem("joints have no ramp; bring the bodies together with assemble", "ramp")
        return self

    def as_joint(self) -> JointDef:
        """The general joint that this one stands for."""
        raise NotImplementedError


class JointDef(BodyPairDef):
    """The general joint: at most one domain of translation, an angle and a twist, in any combination.

    A place (`local_pos0` and `local_pos1`, or `anchor`) without a domain holds both points together: the paper's hinge.
    A domain without places takes the origins of both frames.
    """

    type: Literal["joint"] = "joint"
    axial: AxialDef | None = Field(default=None, description="Point on a segment [domain].")
    planar: PlanarDef | None = Field(default=None, description="Point in a ring or disc [domain].")
    curve: CurveDef | None = Field(default=None, description="Point on a curve [domain].")
    surface: SurfaceDef | None = Field(default=None, description="Point on a surface [domain].")
    sphere: SphereDomainDef | None = Field(default=None, description="Point in a sphere or shell [domain].")
    domain: SkipJsonSchema[Callable[..., Any] | None] = Field(
        default=None, description="Python only: p (3,) in body0's frame [m] -> nearest permissible point (3,) [m]."
    )
    angle: AngleDef | None = Field(default=None, description="Limits of the angle between two directions [rad].")
    twist: TwistDef | None = Field(default=None, description="Limits of the twist about an axis [rad].")
    fixed_rotation: Flag = Field(
        default=False, description="Keeps the relative orientation of the start [true or false]."
    )
    motor: MotorDef | None = Field(default=None, description="Drives a free axis [motor].")

    @model_validator(mode="after")
    def _check(self) -> JointDef:
        domains = self.given(("axial", "planar", "curve", "surface", "sphere", "domain"))
        if len(domains) > 1:
            raise problem(f"give one domain, not {domains[0]} and {domains[1]} together", domains[1])
        if not domains and self.has_no_place and not self.given(("angle", "twist", "fixed_rotation")):
            raise problem("constrains nothing; give places, a domain, angle, twist or fixed_rotation")
        if self.fixed_rotation and self.given(("angle", "twist")):
            raise problem("fixed_rotation leaves nothing to angle and twist", "fixed_rotation")
        if self.twist is not None:
            for axis, vector in (("axis0", "vector0"), ("axis1", "vector1")):
                a = getattr(self.twist, axis)
                if a is None and self.angle is None:
                    raise problem(f"needs {axis}, for there is no angle to take it from", "twist", axis)
                a = a if a is not None else getattr(self.angle, axis)
                unit(a, "twist", axis)
                b = getattr(self.twist, vector)
                if abs(a @ b) > PERPENDICULAR * np.linalg.norm(a) * np.linalg.norm(b):
                    raise problem("must be perpendicular to its axis", "twist", vector)
        if self.motor is not None and getattr(self, self.motor.on) is None:
            raise problem(f"there is no {self.motor.on} for it to drive", "motor", "on")
        return self

    @property
    def has_no_place(self) -> bool:
        """Whether no place is given."""
        return self.local_pos0 is None and self.local_pos1 is None and self.anchor is None

    def as_joint(self) -> JointDef:
        """Itself."""
        return self
