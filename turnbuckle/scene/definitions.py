"""The definition of a scene: validated data, a unit on every field, all that a scene file can say.

The parts are in `body_definitions.py` and `constraint_definitions.py`; import everything from here.
A definition is constant; arrays in it are read-only. Lengths [m], masses [kg], times [s], angles [rad].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.body_definitions import (
    BodyBase,
    BoxDef,
    ClothDef,
    CylinderDef,
    NetDef,
    RopeDef,
    SheetDef,
    SolidDef,
)
from turnbuckle.scene.constraint_definitions import (
    AttachDef,
    AttachToDef,
    CoincidentDef,
    ConstraintBase,
    KeyframesDef,
    NailDef,
    NailGoal,
    PointRef,
    PointsDef,
    PointsList,
    PointsToPointDef,
    RampDef,
    SlideDef,
    SlideOnDef,
    VelocityDef,
)
from turnbuckle.scene.contact_definitions import ContactDef, ContactField, FrictionDef, contact_problems
from turnbuckle.scene.expression import compile_expression
from turnbuckle.scene.fields import Count, Name, NonNegative, Positive, Text, Vec3
from turnbuckle.scene.joint_definitions import (
    AngleDef,
    AxialDef,
    BodyPairDef,
    CurveDef,
    JointDef,
    MotorDef,
    PlanarDef,
    SphereDomainDef,
    SurfaceDef,
    TwistDef,
)
from turnbuckle.scene.joint_problems import joint_problems
from turnbuckle.scene.named_joints import (
    BallDef,
    ConeTwistDef,
    CylindricalDef,
    DistanceDef,
    NamedJointDef,
    PlanarJointDef,
    PointToRingDef,
    PrismaticDef,
    RevoluteDef,
    RollingDef,
    UniversalDef,
    WeldDef,
)
from turnbuckle.scene.obstacle_definitions import ObstacleDef
from turnbuckle.scene.rigid_definitions import PartDef, RigidDef, RoundDef, TrajectoryDef
from turnbuckle.scene.skin_definitions import CoatingDef, SectionDef, SkinDef
from turnbuckle.scene.suggestion import did_you_mean

__all__ = [
    "AngleDef", "AttachDef", "AttachToDef", "AxialDef", "BallDef", "BodyBase", "BodyDef", "BodyPairDef", "BoxDef",
    "ClothDef", "CoatingDef", "CoincidentDef", "ConeTwistDef", "ConstraintBase", "ConstraintDef", "ContactDef", "CurveDef",
    "CylinderDef", "CylindricalDef", "DisplacementDef", "DistanceDef", "ForceDef", "FrictionDef", "INTEGRATORS", "JointDef", "JOINTS",
    "KeyframesDef", "MotorDef", "NailDef", "NamedJointDef", "NetDef", "ObstacleDef", "PartDef", "PlanarDef", "PlanarJointDef",
    "PointRef", "PointsDef", "PointsToPointDef", "PointToRingDef", "PrismaticDef", "PullDef", "RampDef", "RevoluteDef", "RigidDef",
    "RollingDef", "RopeDef", "RoundDef", "SceneDef", "SectionDef", "SheetDef", "SkinDef", "SlideDef", "SlideOnDef",
    "SolidDef", "SphereDomainDef", "SurfaceDef", "TrajectoryDef", "TwistDef", "UniversalDef", "VelocityDef", "WeldDef",
]  # fmt: skip

Integrator = Literal[
    "explicit_euler", "euler_cromer", "midpoint", "rk2", "verlet", "velocity_verlet", "beeman", "implicit_euler",
    "rk4", "newmark",
]  # fmt: skip
INTEGRATORS: tuple[str, ...] = Integrator.__args__  # type: ignore[attr-defined]
FORCE_VARIABLES = ("x", "y", "z", "vx", "vy", "vz", "t", "m")
Located = tuple[tuple[str | int, ...], str]


def _type_of(value: Any) -> str | None:
    kind = value.get("type") if isinstance(value, dict) else getattr(value, "type", None)
    return f"<{kind}>" if isinstance(kind, str) else None


JOINTS: dict[str, type[BodyPairDef]] = {
    "joint": JointDef,
    "ball": BallDef,
    "revolute": RevoluteDef,
    "universal": UniversalDef,
    "prismatic": PrismaticDef,
    "cylindrical": CylindricalDef,
    "planar": PlanarJointDef,
    "weld": WeldDef,
    "distance": DistanceDef,
    "cone_twist": ConeTwistDef,
    "point_to_ring": PointToRingDef,
    "rolling": RollingDef,
}

BodyDef = Annotated[
    Annotated[RopeDef, Tag("<rope>")]
    | Annotated[NetDef, Tag("<net>")]
    | Annotated[ClothDef, Tag("<cloth>")]
    | Annotated[SolidDef, Tag("<solid>")]
    | Annotated[RigidDef, Tag("<rigid>")]
    | Annotated[CoatingDef, Tag("<coating>")]
    | Annotated[ObstacleDef, Tag("<obstacle>")],
    Discriminator(_type_of),
]
ConstraintDef = Annotated[
    Annotated[NailDef, Tag("<nail>")]
    | Annotated[PointsToPointDef, Tag("<points_to_point>")]
    | Annotated[AttachDef, Tag("<attach>")]
    | Annotated[SlideDef, Tag("<slide>")]
    | Annotated[VelocityDef, Tag("<velocity>")]
    | Annotated[JointDef, Tag("<joint>")]
    | Annotated[BallDef, Tag("<ball>")]
    | Annotated[RevoluteDef, Tag("<revolute>")]
    | Annotated[UniversalDef, Tag("<universal>")]
    | Annotated[PrismaticDef, Tag("<prismatic>")]
    | Annotated[CylindricalDef, Tag("<cylindrical>")]
    | Annotated[PlanarJointDef, Tag("<planar>")]
    | Annotated[WeldDef, Tag("<weld>")]
    | Annotated[DistanceDef, Tag("<distance>")]
    | Annotated[ConeTwistDef, Tag("<cone_twist>")]
    | Annotated[PointToRingDef, Tag("<point_to_ring>")]
    | Annotated[RollingDef, Tag("<rolling>")],
    Discriminator(_type_of),
]


def _component(value: Any) -> Any:
    """A number stands for itself in an expression; a text is checked."""
    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise problem(f"expected a finite number, got {value}")
        return repr(value.item() if isinstance(value, np.number) else value)
    if isinstance(value, str):
        compile_expression(value, FORCE_VARIABLES)
    return value


Component = Annotated[Text, BeforeValidator(_component, json_schema_input_type=str | float)]


class PullDef(Definition):
    """Springs from points to where they should be: nails that give. Each has the frequency, whatever its mass."""

    points: PointsList = Field(description="The points [selection].")
    goal: NailGoal = Field(
        default=None, description="Where they are pulled to, (3,) or (n, 3), or keyframes; where they start [m]."
    )
    frequency: Positive = Field(description="Stiffness m w^2 on a point of mass m; at most 1 rad a step [rad/s].")
    damping: NonNegative = Field(default=0.5, description="Damping ratio, 1 critical [1].")

    @model_validator(mode="after")
    def _check(self) -> PullDef:
        if isinstance(self.goal, KeyframesDef) and self.goal.velocities is not None:
            raise problem("a pull takes positions or offsets", "goal", "velocities")
        return self


class ForceDef(Definition):
    """A force field, the force [N] on each point of a body or of all bodies."""

    name: Name = Field(default="force", description="Name, unique among named forces [text].")
    body: Name | None = Field(default=None, description="Name of the body it acts on, all when left out [text].")
    expression: Annotated[list[Component], Field(min_length=3, max_length=3)] | None = Field(
        default=None,
        description="Force on a point along x, y, z, in x y z [m], vx vy vz [m/s], t [s], m [kg] [N].",
    )
    callable: SkipJsonSchema[Callable[..., Any] | None] = Field(
        default=None, description="Python only: f(x (n, 3), v (n, 3), t, mass (n,)) -> force (n, 3) [N]."
    )
    at: Vec3 | None = Field(
        default=None, description="Rigid bodies: where the force acts, in the body's frame; its centre of mass [m]."
    )
    torque: Annotated[list[Component], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="Rigid bodies: torque in world axes, in the same variables [N m]."
    )

    pull: PullDef | None = Field(default=None, description="Springs that pull points to places [springs].")

    @model_validator(mode="after")
    def _check(self) -> ForceDef:
        if self.pull is not None:
            exactly_one(self, [("pull",), ("expression",), ("callable",), ("torque",), ("at",), ("body",)])
            return self
        if not self.given(("expression", "callable", "torque")):
            raise problem("gives no force; give an expression, a callable or a pull, or for rigid bodies a torque")
        if self.given(("expression", "callable")):  # a torque may stand alone
            exactly_one(self, [("expression",), ("callable",)], ("torque",))
        return self


class DisplacementDef(Definition):
    """Options of the `displacement` solver (Displacement, 2.2 and 3)."""

    scheme: Literal[1, 2] = Field(default=2, description="Scheme one (3.1.2) or two (3.1.3) [1].")
    alpha: Positive | None = Field(
        default=None,
        description="Factor on m1 m2 / (m1 + m2), 1 as printed; found for each gap when left out (slender bodies) [1].",
    )
    weights: Literal["max", "sum"] = Field(
        default="max", description="1/max(n_i, n_j), or the plain sum, which may diverge (3.2) [text]."
    )
    tolerance: Positive = Field(default=1e-6, description="Stop when all corrections are smaller [m or rad].")
    max_iterations: Count = Field(default=200, description="Limit on iterations a step [1].")
    on_limit: Literal["continue", "stop"] = Field(
        default="continue", description="What to do when the limit is reached: warn and go on, or fail [text]."
    )
    speeds: Literal["logarithm", "paper"] = Field(
        default="logarithm", description="Angular speeds by the logarithm, or step 3 as printed [text]."
    )
    mobility: Literal["physical", "user_parameter"] = Field(
        default="physical", description="By mass and inertia, or by mu and the ability to rotate (3.1.4) [text]."
    )


class SceneDef(Definition):
    """A whole scene."""

    schema_version: Literal[1] = Field(default=1, description="Version of this format [1].")
    name: Name = Field(default="scene", description="Name of the scene [text].")
    up_axis: Literal["Z", "Y"] = Field(default="Z", description="Axis that points up [text].")
    gravity: Vec3 | None = Field(default=None, description="Gravity; 9.81 down when left out [m/s^2].")
    dt: Positive = Field(default=1e-3, description="Time step [s].")
    duration: NonNegative = Field(default=1.0, description="Simulated time [s].")
    integrator: Integrator = Field(
        default="verlet",
        description="Scheme, one for the whole scene; with contact implicit_euler if none is given [text].",
    )
    response: Literal["exact", "paper"] = Field(
        default="exact", description="Exact in position and velocity, or the letter of the paper [text]."
    )
    conflicts: Literal["error", "solve"] = Field(
        default="error", description="What to do when two constraints share a point [text]."
    )
    solver: Literal["equality", "displacement"] = Field(
        default="equality", description="How joints are met: exactly and directly, or the 1994 iteration [text]."
    )
    displacement: DisplacementDef = Field(
        default_factory=DisplacementDef, description="Options of the displacement solver [options]."
    )
    rigid_motion: Literal["rotor", "paper"] = Field(
        default="rotor", description="Motion of rigid bodies: exact free rotation, or (1)-(4) as printed [text]."
    )
    max_rotation: Positive = Field(
        default=0.5, description="A step that turns a body by more goes back and is halved [rad]."
    )
    frames_per_second: Positive = Field(default=60.0, description="Frames written to recordings [1/s].")
    bodies: list[BodyDef] = Field(default_factory=list, description="The bodies [list].")
    forces: list[ForceDef] = Field(default_factory=list, description="Force fields [list].")
    constraints: list[ConstraintDef] = Field(default_factory=list, description="The constraints [list].")
    skins: list[SkinDef] = Field(default_factory=list, description="Surfaces over chains of bodies [list].")
    contact: ContactField = Field(
        default=None, description="Contact between bodies: true, or its options; none when left out [options]."
    )
    frictions: list[FrictionDef] = Field(default_factory=list, description="Friction of pairs of materials [list].")

    def gravity_vector(self) -> np.ndarray:
        """Gravity [m/s^2], shape (3,): as given, or 9.81 m/s^2 down."""
        if self.gravity is not None:
            return self.gravity
        return np.array([0.0, 0.0, -9.81] if self.up_axis == "Z" else [0.0, -9.81, 0.0])

    @model_validator(mode="after")
    def _check_names(self) -> SceneDef:
        if self.contact is not None and "integrator" not in self.model_fields_set:
            self.fill("integrator", "implicit_euler")
        problems = list(name_problems(self))
        if problems:
            raise PydanticCustomError("turnbuckle_many", "{text}", {"text": problems[0][1], "problems": problems})
        return self


def name_problems(scene: SceneDef) -> Iterator[Located]:
    """Names used twice and bodies that do not exist, each with its place."""
    for kind in ("bodies", "forces", "constraints", "skins"):
        seen: dict[str, int] = {}
        for i, item in enumerate(getattr(scene, kind)):
            if kind == "forces" and "name" not in item.model_fields_set:
                continue
            if item.name in seen:
                yield (kind, i, "name"), f"{item.name!r} is already the name of {kind}[{seen[item.name]}]"
            seen.setdefault(item.name, i)
    bodies = dict.fromkeys(body.name for body in scene.bodies)  # in order, quick to look up
    materials = dict.fromkeys(body.friction for body in scene.bodies if body.friction is not None)
    yield from contact_problems(scene.contact, scene.frictions, bodies, materials)
    for i, skin in enumerate(scene.skins):
        if skin.name in bodies:
            yield ("skins", i, "name"), f"{skin.name!r} is already the name of a body"
    yield from joint_problems(scene.bodies, scene.constraints)
    for kind in ("bodies", "forces", "constraints", "skins"):
        for i, item in enumerate(getattr(scene, kind)):
            for at, message in reference_problems(item, bodies):
                yield (kind, i, *at), message


def reference_problems(item: Any, known: Collection[str]) -> Iterator[Located]:
    """Bodies named anywhere inside an item of a scene that the scene does not have, each with its place."""
    stack: list[tuple[tuple[str | int, ...], Any]] = [((), item)]
    while stack:
        at, value = stack.pop()
        if isinstance(value, Definition):
            for field in type(value).model_fields:
                inner = getattr(value, field)
                if field in ("body", "body0", "body1", "around") and isinstance(inner, str):
                    if inner not in known:
                        yield (*at, field), f"there is no body {inner!r}{did_you_mean(inner, known)}"
                elif field == "bodies":
                    for k, name in enumerate(inner):
                        if name not in known:
                            yield (*at, field, k), f"there is no body {name!r}{did_you_mean(name, known)}"
                elif isinstance(inner, (Definition, list)):
                    stack.append(((*at, field), inner))
        elif isinstance(value, list):
            stack.extend(((*at, k), inner) for k, inner in enumerate(value) if isinstance(inner, (Definition, list)))
