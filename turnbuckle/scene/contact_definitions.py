"""Contact as the user writes it: the scene's options, what a body says of its surface, friction of pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from turnbuckle.scene.base_definition import Definition, problem
from turnbuckle.scene.fields import Count, Flag, Index, Name, NonNegative, Positive
from turnbuckle.scene.suggestion import did_you_mean

FRICTION = 0.3  # coefficient where nothing is said
Depth = Annotated[Index, Field(le=20)]
TwoNames = Annotated[list[Name], Field(min_length=2, max_length=2)]


class PairDef(Definition):
    """Two bodies; `[a, b]` for short."""

    between: TwoNames = Field(description="Their names [text].")


def _pair(value: Any) -> Any:
    return {"between": value} if isinstance(value, (list, tuple)) else value


BodyPair = Annotated[PairDef, BeforeValidator(_pair, json_schema_input_type=PairDef | TwoNames)]


class ContactDef(Definition):
    """How bodies keep apart (Contact: Otaduy, Tamstorf, Steinemann, Gross 2009). `contact: true` takes all defaults.

    Bodies that a constraint of the scene joins (a joint, attach, points_to_point, slide) do not touch each other, unless
    `jointed` is true or `collide` names them: where they are joined they lie on each other.
    """

    delta: Positive | None = Field(
        default=None,
        description="Distance that surfaces keep; a tenth of the mean edge length around each vertex, at most 0.5 % of "
        "the body's size, and of what is scripted at most the median of what is not [m].",
    )
    friction: NonNegative = Field(default=FRICTION, description="Static coefficient of bodies that give none [1].")
    dynamic_friction: NonNegative | None = Field(
        default=None, description="Dynamic coefficient of bodies that give none, as the static one [1]."
    )
    solver: Literal["newton", "ica", "anticipation"] = Field(
        default="newton", description="Solver of the contact problem: the fast one, or the paper's (5.1, 5.2) [text]."
    )
    friction_shape: Literal["cone", "pyramid4", "pyramid8", "pyramid16"] = Field(
        default="cone", description="Section of the cone of friction; the paper's is pyramid4 [text]."
    )
    broad_phase: Literal["bvh", "hash"] = Field(default="bvh", description="How near features are found [text].")
    rounds: Count = Field(default=5, description="Rounds of refinement before the step is halved (section 4) [1].")
    halvings: Depth = Field(default=2, description="How often a step may be halved, before the last resort [1].")
    proximity: Flag = Field(
        default=True, description="Start with pairs that are near already, not with none (section 4) [true or false]."
    )
    rows: Literal["position", "velocity"] = Field(
        default="position", description="Ask for distances at the end of the step, or for speeds of parting [text]."
    )
    tolerance: Positive = Field(
        default=1e-2, description="What velocities may miss by, of what gravity or delta / 4 do in a step [1]."
    )
    max_iterations: Count = Field(default=500, description="Limit on iterations of the solver [1].")
    recovery: Positive = Field(default=0.05, description="Fastest at which what is too near is let apart [m/s].")
    newton: Count = Field(default=1, description="Newton iterations of the implicit scheme in a step [1].")
    on_intersection: Literal["refuse", "grow"] = Field(
        default="refuse", description="What to do with a start that intersects: refuse it, or let it apart [text]."
    )
    on_impossible: Literal["fail", "stall"] = Field(
        default="fail", description="Where a script makes a step impossible: fail, or let the script wait [text]."
    )
    jointed: Flag = Field(default=False, description="Whether bodies that are joined may touch [true or false].")
    collide: list[BodyPair] = Field(default_factory=list, description="Pairs of bodies that touch all the same [list].")
    ignore: list[BodyPair] = Field(default_factory=list, description="Pairs of bodies that pass each other [list].")

    @model_validator(mode="after")
    def _check(self) -> ContactDef:
        check_coefficients(self.friction, self.dynamic_friction, "dynamic_friction")
        return self


def _switch(value: Any) -> Any:
    """`contact: true` is all defaults, false is none."""
    if value is True:
        return {}
    return None if value is False else value


ContactField = Annotated[ContactDef | None, BeforeValidator(_switch, json_schema_input_type=ContactDef | bool | None)]


WORDS = {True: "on", False: "off", "self off": "others"}


def _touches(value: Any) -> Any:
    return WORDS.get(value, value) if isinstance(value, (bool, str)) else value


Touches = Annotated[
    Literal["on", "off", "others"],
    BeforeValidator(_touches, json_schema_input_type=bool | Literal["on", "off", "others", "self off"]),
]


class TouchFields(Definition):
    """What a body says of its surface."""

    contact: Touches | None = Field(
        default=None,
        description="Whether it touches others and itself (true, on), others only (others, 'self off'), or nothing (false, "
        "off). When left out on for what deforms, others for rigid bodies and obstacles [text].",
    )
    static_friction: NonNegative | None = Field(default=None, description="Coefficient at rest; the scene's [1].")
    dynamic_friction: NonNegative | None = Field(
        default=None, description="Coefficient of sliding; the static one where that is given, else the scene's [1]."
    )
    friction: Name | None = Field(
        default=None, description="Name of its material in the scene's `frictions`; other bodies may share it [text]."
    )
    contact_delta: Positive | None = Field(default=None, description="Distance that its surface keeps; by edges [m].")

    @model_validator(mode="after")
    def _check_friction(self) -> TouchFields:
        check_coefficients(self.static_friction, self.dynamic_friction, "dynamic_friction")
        return self


TOUCH = tuple(TouchFields.model_fields)


class FrictionDef(Definition):
    """Friction between two materials, or two bodies, or a material and a body; it goes before what bodies say alone.

    Where no pair is given, coefficients are the geometric means of those of the two bodies.
    """

    between: TwoNames = Field(description="Two names, of bodies or of materials (field `friction` of bodies) [text].")
    static: NonNegative = Field(description="Coefficient at rest [1].")
    dynamic: NonNegative | None = Field(default=None, description="Coefficient of sliding, as `static` [1].")

    @model_validator(mode="after")
    def _check(self) -> FrictionDef:
        check_coefficients(self.static, self.dynamic, "dynamic")
        return self


def check_coefficients(static: float | None, dynamic: float | None, field: str) -> None:
    """Sliding cannot be harder than starting to slide."""
    if static is not None and dynamic is not None and dynamic > static:
        raise problem(f"{dynamic:g} is more than the static coefficient {static:g}; nothing slides so", field)


def contact_problems(
    contact: ContactDef | None, frictions: list[FrictionDef], bodies: Collection[str], materials: Collection[str]
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Names in `contact` and `frictions` that nothing has, each with its place."""
    both = [*bodies, *materials]
    for i, pair in enumerate(frictions):
        for k, name in enumerate(pair.between):
            if name not in both:
                near = did_you_mean(name, both)
                yield ("frictions", i, "between", k), f"there is no body and no material {name!r}{near}"
    for field in ("collide", "ignore"):
        for i, pair in enumerate(getattr(contact, field, ())):
            for k, name in enumerate(pair.between):
                if name not in bodies:
                    yield ("contact", field, i, "between", k), f"there is no body {name!r}{did_you_mean(name, bodies)}"
