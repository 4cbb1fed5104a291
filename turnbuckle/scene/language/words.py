"""The words of the language: which field a keyword stands for, and which values follow it without a word.

The paper counts objects 1 and 2, the definitions count bodies 0 and 1; so every field of a joint that ends in 0 or 1
is said with 1 or 2 (`axis0` is `axis1`, `body1` is `object2`). All other fields are said by their own names, with `-`
or `_` between the words.
"""

from __future__ import annotations

import re
from functools import cache

from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import (
    AngleDef,
    AttachToDef,
    AxialDef,
    BodyPairDef,
    BoxDef,
    CoincidentDef,
    ConstraintBase,
    CurveDef,
    CylinderDef,
    ForceDef,
    MotorDef,
    PlanarDef,
    PointRef,
    PointsDef,
    RigidDef,
    RopeDef,
    RoundDef,
    SceneDef,
    SectionDef,
    SkinDef,
    SlideOnDef,
    TwistDef,
)
from turnbuckle.scene.language.forms import form_of

LISTS = {"object": "bodies", "force": "forces", "constraint": "constraints", "skin": "skins"}
BLOCKS = ("world", *LISTS)
# A bare name may be one of these only right before a ';': a name forgotten before them must not swallow them.
RESERVED = {
    *(*BLOCKS, "end", "object1", "object2", "hinge", "axial", "planar", "angle", "twist", "about", "min", "max"),
    *("inf", "infinity"),
}
STRUCTURE = {*BLOCKS, "end"}  # never a bare name, not even right before a ';'
INFINITE = {"inf": 1.0, "+inf": 1.0, "-inf": -1.0, "infinity": 1.0, "+infinity": 1.0, "-infinity": -1.0}
FLAGS = {"yes": True, "true": True, "no": False, "false": False}

# Fields that have another word, by the class that brings them in.
_OWN: dict[type[Definition], dict[str, str]] = {
    SceneDef: {"up_axis": "up"},
    RigidDef: {"angular_velocity": "spin", "parts": "part"},
    RopeDef: {"start": "first", "end": "last"},
    ForceDef: {"body": "on", "expression": "push"},
    ConstraintBase: {"start": "from", "end": "until"},
    BodyPairDef: {"body0": "object1", "body1": "object2", "local_pos0": "point1", "local_pos1": "point2"},
    PointsDef: {"body": "of"},
    PointRef: {"body": "of"},
    AttachToDef: {"body": "of"},
    SlideOnDef: {"body": "of"},
    CoincidentDef: {"bodies": "objects"},
    SkinDef: {"bodies": "objects", "sections": "section"},
    SectionDef: {"body": "of"},
    AngleDef: {"axis0": "a1", "axis1": "a2"},
    TwistDef: {"vector0": "b1", "vector1": "b2"},
}
# Records of which some fields come first, without a word.
POSITIONAL: dict[type[Definition], tuple[str, ...]] = {
    AxialDef: ("axis",),
    PlanarDef: ("normal",),
    AngleDef: ("axis0", "axis1"),
    TwistDef: ("vector0", "vector1"),
    CurveDef: ("points",),
    MotorDef: ("on",),
    RoundDef: ("radius", "length"),
    BoxDef: ("size",),
    CylinderDef: ("radius", "length"),
}
# Words that give two vectors at once: P1 P2 of a hinge, and the axes of a twist.
PAIRS: dict[type[Definition], dict[str, tuple[str, str]]] = {
    BodyPairDef: {"hinge": ("local_pos0", "local_pos1")},
    TwistDef: {"about": ("axis0", "axis1")},
}
# Words that stand for a field and its value.
SHORT: dict[type[Definition], dict[str, tuple[str, str]]] = {RigidDef: {"immobile": ("motion", "immobile")}}
# What the places after a keyword mean, for error messages.
MEANING = {
    "hinge": "P1 in object1, then P2 in object2",
    "axial": "the direction u1 in object1",
    "planar": "the normal n1 in object1",
    "angle": "the direction a1 in object1, then a2 in object2",
    "twist": "the vector b1 in object1, then b2 in object2",
    "about": "the axis in object1, then that in object2",
    "cylinder": "radius and length",
    "capsule": "radius and length",
    "curve": "its points, such as (0 0 0) (1 0 0)",
    "motor": "the axis that it drives, axial or twist",
}
_COUNTED = re.compile(r"(\w*[^\W\d])([01])")
_SAID_IN_MESSAGES = re.compile(r"\b(body|local_pos|axis|vector)([01])\b")


@cache
def words_of(kind: type[Definition]) -> dict[str, str]:
    """Keyword -> field, of a definition. `type` and `name` are among them, `callable` and `domain` are not."""
    return {word_of(kind, field): field for field in kind.model_fields if form_of(kind, field).said}


@cache
def word_of(kind: type[Definition], field: str) -> str:
    """The keyword that says a field."""
    for owner, own in _OWN.items():
        if issubclass(kind, owner) and field in own:
            return own[field]
    counted = _COUNTED.fullmatch(field)
    if counted:
        return f"{counted[1].replace('_', '-')}{int(counted[2]) + 1}"
    return field.replace("_", "-")


@cache
def pairs_of(kind: type[Definition]) -> dict[str, tuple[str, str]]:
    """Keywords that give two vectors at once, of a definition."""
    return next((pairs for owner, pairs in PAIRS.items() if issubclass(kind, owner)), {})


@cache
def short_of(kind: type[Definition]) -> dict[str, tuple[str, str]]:
    """Keywords that stand for a field and its value, of a definition."""
    return next((short for owner, short in SHORT.items() if issubclass(kind, owner)), {})


@cache
def all_words(kind: type[Definition]) -> tuple[str, ...]:
    """All keywords of a definition, the paper's first."""
    return (*pairs_of(kind), *words_of(kind), *short_of(kind))


def normal(word: str) -> str:
    """A keyword with `-` for `_`: both may be written."""
    return word.replace("_", "-")


def say(message: str) -> str:
    """A message about a definition in the words of the language."""
    names = {"body": "object", "local_pos": "point", "axis": "axis", "vector": "b"}
    return _SAID_IN_MESSAGES.sub(lambda m: f"{names[m[1]]}{int(m[2]) + 1}", message)
