"""Constraints as the user writes them (Local, section 4), and the selection of points they act on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator
from pydantic.json_schema import SkipJsonSchema

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.expression import compile_expression
from turnbuckle.scene.fields import (
    Bounds,
    Count,
    Elements,
    Flag,
    Fraction,
    Index,
    Indices,
    KeyPositions,
    Line,
    Lines,
    Name,
    NonNegative,
    Number,
    PositionOrPositions,
    Positive,
    Text,
    Times,
    Triangle,
    Triangles,
    Weights,
)


def _check_where(text: str) -> str:
    compile_expression(text, ("x", "y", "z"))
    return text


Where = Annotated[Text, BeforeValidator(lambda text: _check_where(text) if isinstance(text, str) else text)]


class PointsDef(Definition):
    """Some points of one body, chosen by where they are at the start (world coordinates)."""

    body: Name = Field(description="Name of the body [text].")
    indices: Indices | None = Field(default=None, description="Numbers of the points [indices].")
    index: Index | None = Field(default=None, description="Number of one point [index].")
    nearest: PositionOrPositions | None = Field(default=None, description="The point nearest to each place [m].")
    box: Bounds | None = Field(default=None, description="Lowest and highest corner of a box [m].")
    where: Where | None = Field(default=None, description="Expression in x, y, z [m], such as 'z > 0.9'.")
    side: Literal["+x", "-x", "+y", "-y", "+z", "-z"] | None = Field(
        default=None, description="Points at this side of the body's bounding box [axis]."
    )
    thickness: Fraction = Field(default=0.02, description="Depth of the side as a fraction of the extent [1].")
    all: Flag = Field(default=False, description="Every point of the body [true or false].")

    @model_validator(mode="after")
    def _check(self) -> PointsDef:
        ways = ("indices", "index", "nearest", "box", "where", "side", "all")
        exactly_one(self, [(way,) for way in ways])
        if "thickness" in self.model_fields_set and self.side is None:
            raise problem("thickness goes with side only", "thickness")
        if self.box is not None and (self.box[0] > self.box[1]).any():
            raise problem("the first corner must not be above the second", "box")
        return self


def _as_list(value: Any) -> Any:
    """One selection is a list of one."""
    return [value] if isinstance(value, (dict, PointsDef)) else value


PointsList = Annotated[
    list[PointsDef],
    BeforeValidator(_as_list, json_schema_input_type=PointsDef | list[PointsDef]),
    Field(min_length=1),
]


class PointRef(Definition):
    """One point of one body."""

    body: Name = Field(description="Name of the body [text].")
    index: Index = Field(description="Number of the point [index].")


class RampDef(Definition):
    """Gradual activation (Local, section 4.5)."""

    steps: Count = Field(description="Steps until the constraint is fully active [1].")
    mode: Literal["closing", "paper"] = Field(
        default="closing", description="Closing fraction 1/(n-j+1), or the paper's factor j/n [text]."
    )
    max_speed: Positive | None = Field(default=None, description="Largest speed of a ramped point [m/s].")


class KeyframesDef(Definition):
    """A goal that moves: values at times, held before the first and after the last."""

    times: Times = Field(description="Times, increasing, shape (k,) [s].")
    positions: KeyPositions | None = Field(default=None, description="Places, shape (k, 3) or (k, n, 3) [m].")
    offsets: KeyPositions | None = Field(default=None, description="Displacements from the start, (k, 3) [m].")
    velocities: KeyPositions | None = Field(default=None, description="Velocities, (k, 3) or (k, n, 3) [m/s].")
    interpolation: Literal["linear", "smooth"] = Field(
        default="linear", description="Straight, or with zero speed at each key (cubic smoothstep) [text]."
    )

    @model_validator(mode="after")
    def _check(self) -> KeyframesDef:
        way = exactly_one(self, [("positions",), ("offsets",), ("velocities",)])
        if (np.diff(self.times) <= 0).any():
            raise problem("times must increase", "times")
        values = getattr(self, way)
        if len(values) != len(self.times):
            raise problem(f"has {len(values)} keys, but times has {len(self.times)}", way)
        if way == "offsets" and values.ndim != 2:
            raise problem(f"expected an array of shape (k, 3), got one of shape {values.shape}", "offsets")
        return self


def _goal_kind(value: Any) -> str:
    if value is None:
        return "<none>"
    if isinstance(value, (dict, KeyframesDef)):
        return "<keyframes>"
    return "<callable>" if callable(value) else "<array>"


GoalValue = (
    Annotated[PositionOrPositions, Tag("<array>")]
    | Annotated[KeyframesDef, Tag("<keyframes>")]
    | Annotated[SkipJsonSchema[Callable[..., Any]], Tag("<callable>")]
)


NailGoal = Annotated[GoalValue | Annotated[None, Tag("<none>")], Discriminator(_goal_kind)]


class ConstraintBase(Definition):
    """What all constraints share."""

    name: Name = Field(description="Name, unique among constraints [text].")
    enabled: Flag = Field(default=True, description="Whether it acts in its time window [true or false].")
    start: Number = Field(default=0.0, description="Active from this time on [s].")
    end: Number | None = Field(default=None, description="Not active from this time on [s].")
    break_force: Positive | None = Field(default=None, description="Switched off for good above this force [N].")
    ramp: RampDef | None = Field(default=None, description="Gradual activation [steps].")

    @model_validator(mode="after")
    def _check_window(self) -> ConstraintBase:
        if self.end is not None and self.end <= self.start:
            raise problem("end must be later than start", "end")
        return self


class NailDef(ConstraintBase):
    """Points held at a goal: where they start, a place, keyframes, or a Python callable t -> (3,) or (n, 3)."""

    type: Literal["nail"] = "nail"
    points: PointsList = Field(description="The points [selection].")
    goal: NailGoal = Field(default=None, description="Where the points are held, (3,) or (n, 3), or keyframes [m].")

    @model_validator(mode="after")
    def _check(self) -> NailDef:
        if isinstance(self.goal, KeyframesDef) and self.goal.velocities is not None:
            raise problem("a nail takes positions or offsets", "goal", "velocities")
        return self


class VelocityDef(ConstraintBase):
    """Points that move at a given velocity."""

    type: Literal["velocity"] = "velocity"
    points: PointsList = Field(description="The points [selection].")
    goal: Annotated[GoalValue, Discriminator(_goal_kind)] = Field(
        description="Velocity, (3,) or (n, 3), or keyframes with velocities [m/s]."
    )

    @model_validator(mode="after")
    def _check(self) -> VelocityDef:
        if isinstance(self.goal, KeyframesDef) and self.goal.velocities is None:
            raise problem("a velocity goal takes velocities", "goal")
        return self


class CoincidentDef(Definition):
    """Every set of points of these bodies that coincide at the start."""

    bodies: list[Name] = Field(min_length=1, description="Names of the bodies [text].")
    tolerance: NonNegative = Field(default=1e-6, description="Largest distance of points taken as one place [m].")

    @model_validator(mode="after")
    def _check(self) -> CoincidentDef:
        for i, name in enumerate(self.bodies):
            if name in self.bodies[:i]:
                raise problem(f"names {name!r} twice", "bodies", i)
        return self


Group = Annotated[list[PointRef], Field(min_length=2)]


class PointsToPointDef(ConstraintBase):
    """Points that become one, at the place their centre of mass goes to (Local, (22)-(25))."""

    type: Literal["points_to_point"] = "points_to_point"
    groups: Annotated[list[Group], Field(min_length=1)] | None = Field(
        default=None, description="Each inner list is one constraint of its points [points]."
    )
    zip: Annotated[list[PointsDef], Field(min_length=2)] | None = Field(
        default=None, description="Selections of equal length; the k-th points of all are joined [selections]."
    )
    join: PointsList | None = Field(default=None, description="All points of all selections become one [selections].")
    coincident: CoincidentDef | None = Field(default=None, description="Points that start at one place [bodies].")

    @model_validator(mode="after")
    def _check(self) -> PointsToPointDef:
        exactly_one(self, [("groups",), ("zip",), ("join",), ("coincident",)])
        for i, group in enumerate(self.groups or ()):
            seen = set()
            for k, ref in enumerate(group):
                if (ref.body, ref.index) in seen:
                    raise problem(f"names point {ref.index} of {ref.body!r} twice", "groups", i, k)
                seen.add((ref.body, ref.index))
        return self


class AttachToDef(Definition):
    """Elements that points are attached to: given, or the nearest of a kind."""

    body: Name = Field(description="Name of the body [text].")
    elements: Elements | None = Field(
        default=None, description="A line, triangle or tetrahedron a point, shape (m, 2), (m, 3) or (m, 4) [indices]."
    )
    nearest: Literal["line", "triangle", "tetrahedron"] | None = Field(
        default=None, description="Take the nearest element of this kind [text]."
    )

    @model_validator(mode="after")
    def _check(self) -> AttachToDef:
        exactly_one(self, [("elements",), ("nearest",)])
        if self.elements is not None:
            ordered = np.sort(self.elements, axis=1)
            double = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
            if double.any():
                row = int(np.argmax(double))
                raise problem(f"uses a point twice ({self.elements[row].tolist()})", "elements", row)
        return self


class AttachDef(ConstraintBase):
    """Points held at fixed weights of a line, triangle or tetrahedron, two-way (Local, (26)-(28))."""

    type: Literal["attach"] = "attach"
    points: PointsList = Field(description="The points [selection].")
    to: AttachToDef = Field(description="What they are attached to [elements].")
    weights: Weights | None = Field(
        default=None, description="Weights of the element's points, each row of sum 1, shape (m, k) [1]."
    )

    @model_validator(mode="after")
    def _check(self) -> AttachDef:
        if self.weights is None:
            return self
        if self.to.elements is None:
            raise problem("weights need 'elements'", "weights")
        if self.weights.shape != self.to.elements.shape:
            shapes = f"{self.weights.shape}, but to.elements has shape {self.to.elements.shape}"
            raise problem(f"has shape {shapes}", "weights")
        off = np.abs(self.weights.sum(axis=1) - 1.0) > 1e-9
        if off.any():
            raise problem("each row must have the sum 1", "weights", int(np.argmax(off)))
        return self


class SlideOnDef(Definition):
    """What points slide on: lines or triangles of a body."""

    body: Name = Field(description="Name of the body [text].")
    lines: Lines | None = Field(default=None, description="Connected lines, shape (m, 2) [indices].")
    triangles: Triangles | None = Field(default=None, description="A triangulated surface, shape (m, 3) [indices].")
    line: Line | None = Field(default=None, description="One line, from end to end, shape (2,) [indices].")
    triangle: Triangle | None = Field(default=None, description="One triangle, up to its rim, shape (3,) [indices].")
    surface: Flag = Field(default=False, description="The boundary of a solid, the triangles of a sheet [true].")
    rope: Flag = Field(default=False, description="The lines of a rope [true].")
    where: Where | None = Field(
        default=None, description="Keep the elements of which all points satisfy this expression in x, y, z [m]."
    )

    @model_validator(mode="after")
    def _check(self) -> SlideOnDef:
        exactly_one(self, [(way,) for way in ("lines", "triangles", "line", "triangle", "surface", "rope")])
        return self


class SlideDef(ConstraintBase):
    """Points that stay on a line, a triangle or a triangulated surface and slide without friction (4.4)."""

    type: Literal["slide"] = "slide"
    points: PointsList = Field(description="The points [selection].")
    on: SlideOnDef = Field(description="What they slide on [elements].")
