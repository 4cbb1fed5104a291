"""A text of the language to a validated definition. Every error says file, line, column, and what was expected."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from turnbuckle.data.errors import InputError
from turnbuckle.scene.array_files import ArrayFiles
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import SceneDef
from turnbuckle.scene.joint_limits import idle_limits
from turnbuckle.scene.language.parser import Description, classes_of, parse
from turnbuckle.scene.language.tokens import LanguageError, Position
from turnbuckle.scene.language.values import Place
from turnbuckle.scene.language.words import LISTS, POSITIONAL, say, word_of
from turnbuckle.scene.validation import given_data, problems, report
from turnbuckle.scene.yaml_file import move_meshes, read_text

SUFFIX = ".gascuel"
_NAME = re.compile(r"\w[\w.\-]{0,180}")
BODY_FIELDS = ("body", "body0", "body1")


def is_description(path: str | os.PathLike[str]) -> bool:
    """Whether a path names a file in this language."""
    return Path(path).suffix.lower() == SUFFIX


def read_description(path: str | os.PathLike[str]) -> SceneDef:
    """The definition in a file. Raises `InputError`, one line a problem: `file:line:column: what is wrong`."""
    path = Path(path)
    return parse_description(read_text(path), path.parent, str(path))


def parse_description(text: str, folder: Path, shown: str = "<text>") -> SceneDef:
    """The definition in a text; meshes and array files are relative to `folder`, `shown` names the text in errors."""
    parsed = _parsed(text, shown)
    _refuse_constraints_only(parsed, shown)
    return _validated(parsed, ArrayFiles(folder), folder, shown)


def add_description(path: str | os.PathLike[str], scene: SceneDef, folder: Path) -> SceneDef:
    """A scene (its meshes relative to `folder`) with what a file adds to it. Raises `InputError`."""
    path = Path(path)
    parsed = _parsed(read_text(path), str(path))
    move_meshes(parsed.data, path.parent, folder)
    return _validated(parsed, ArrayFiles(path.parent), folder, str(path), scene)


def _refuse_constraints_only(parsed: Description, shown: str) -> None:
    needed = list(dict.fromkeys(bodies_named([parsed.data[name] for name in LISTS.values()])))
    if needed and not parsed.data["bodies"]:
        some = ", ".join(needed[:12]) + (", ..." if len(needed) > 12 else "")
        raise InputError(
            f"{shown}: describes constraints only; it needs the object{'s' * (len(needed) > 1)} {some}: describe them in "
            "it, or include it in a scene that has them"
        )


@dataclass(frozen=True)
class ConstraintsOnly:
    """What a file without objects says. `needed`: the objects that it is about, in the order of their first mention.

    `definition` is checked with a stand-in for each of them. `warnings`: one sentence each, with file, line, column.
    """

    definition: SceneDef
    needed: list[str]
    warnings: list[str]


def read_constraints_only(path: str | os.PathLike[str]) -> ConstraintsOnly | None:
    """A file with constraints, forces or skins but without objects, checked as far as can be; None for any other file.

    Raises `InputError`.
    """
    path = Path(path)
    parsed = _parsed(read_text(path), str(path))
    if parsed.data["bodies"] or not any(parsed.data[name] for name in LISTS.values()):
        return None
    needed = list(dict.fromkeys(bodies_named([parsed.data[name] for name in LISTS.values()])))
    stand_ins = SceneDef.model_construct(bodies=[], forces=[], constraints=[])
    try:
        stand_ins = SceneDef.model_validate({"bodies": [{"type": "rigid", "name": n, "sphere": 1.0} for n in needed]})
    except ValidationError:
        pass  # a name that cannot be one: the constraint that says it is told below
    definition = _validated(parsed, ArrayFiles(path.parent), path.parent, str(path), stand_ins)
    warnings = []
    for i, what, text in idle_limits(definition):
        position = _position(("constraints", i, what, "max"), parsed)
        warnings.append(f"{path}:{position.line}:{position.column}: {text}")
    return ConstraintsOnly(definition, needed, warnings)


def bodies_named(value: Any) -> Iterable[str]:
    """Names of bodies anywhere in the data of forces and constraints."""
    if isinstance(value, list):
        for inner in value:
            yield from bodies_named(inner)
    elif isinstance(value, dict):
        for key, inner in value.items():
            if key in BODY_FIELDS and isinstance(inner, str):
                yield inner
            elif key == "bodies" and isinstance(inner, list):
                yield from (name for name in inner if isinstance(name, str))
            else:
                yield from bodies_named(inner)


def _parsed(text: str, shown: str) -> Description:
    try:
        parsed = parse(text)
    except LanguageError as error:
        raise InputError(f"{shown}:{error.position.line}:{error.position.column}: {error}") from None
    if not parsed.has_world and not any(parsed.data[name] for name in LISTS.values()):
        raise InputError(f"{shown}:1:1: the file describes nothing; start with 'constraint', 'object' or 'world'")
    return parsed


def _validated(
    parsed: Description, arrays: ArrayFiles, folder: Path, shown: str, into: SceneDef | None = None
) -> SceneDef:
    base: dict[str, Any] = {} if into is None else given_data(into)
    first = {name: len(base.get(name, [])) for name in LISTS.values()}
    data = {**base, **parsed.data}
    for name in LISTS.values():
        data[name] = [*base.get(name, []), *data[name]]
    name_constraints(data["constraints"])
    try:
        return SceneDef.model_validate(data, context={"folder": folder, "load_array": arrays.load})
    except ValidationError as error:
        found = []
        for place, text in problems(error, SceneDef, data):
            place = _own_place(place, first)
            found.append((_position(place, parsed), f"{_label(place, parsed, data, first)}{say(text)}"))
        found.sort(key=lambda entry: (entry[0].line, entry[0].column))
        lines = [(f"{shown}:{position.line}:{position.column}", text) for position, text in found]
        raise InputError(report(lines)) from None


def name_constraints(constraints: list[dict[str, Any]]) -> None:
    """Constraints without a name are called after their objects, `body.wheel`; the second of a pair `body.wheel.2`."""
    taken = {item["name"] for item in constraints if "name" in item}
    for item in constraints:
        if "name" not in item:
            stem = f"{item.get('body0') or 'world'}.{item.get('body1', '')}"
            if "body1" not in item or not _NAME.fullmatch(stem):  # not about two objects, or about what cannot be one
                stem = str(item["type"])
            number, name = 2, stem
            while name in taken:
                number, name = number + 1, f"{stem}.{number}"
            taken.add(name)
            item["name"] = name


def _own_place(place: Place, first: dict[str, int]) -> Place:
    """A place in the text from one in the scene that it was added to; () for what was there before."""
    if len(place) > 1 and place[0] in first and isinstance(place[1], int):
        index = place[1] - first[str(place[0])]
        return (place[0], index, *place[2:]) if index >= 0 else ()
    return place


def _position(place: Place, parsed: Description) -> Position:
    """The position of a place as deep as the text says it."""
    while place not in parsed.places:
        place = place[:-1]
    return parsed.places[place]


def _label(place: Place, parsed: Description, data: dict[str, Any], first: dict[str, int]) -> str:
    """A place in the words of the language, such as `constraint 'body.wheel', angle max: `."""
    if not place:
        return ""
    block = next((block for block, name in LISTS.items() if name == place[0]), "world")
    kind: type[Definition] | None = SceneDef
    words = ["world"]
    rest = place
    if block != "world" and len(place) > 1 and isinstance(place[1], int):
        item = data[str(place[0])][place[1] + first[str(place[0])]]
        words = [f"{block} {item['name']!r}" if "name" in item else block]
        kind = classes_of(block).get(item.get("type", block))
        rest = place[2:]
    path = []
    for part in rest:
        if isinstance(part, str):
            path.append(word_of(kind, part) if kind is not None and part in kind.model_fields else part)
            kind = next((k for k in POSITIONAL if part in ("axial", "planar", "angle", "twist") and _is(k, part)), None)
    return ", ".join(filter(None, [words[0], " ".join(path)])) + ": "


def _is(kind: type[Definition], part: str) -> bool:
    return kind.__name__.lower() == f"{part}def"
