"""`--set path=value`: change one field of a definition by its path."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from turnbuckle.data.errors import InputError
from turnbuckle.scene.array_files import ArrayFiles
from turnbuckle.scene.definitions import PointsDef, SceneDef
from turnbuckle.scene.suggestion import did_you_mean
from turnbuckle.scene.validation import given_data, place_text, problems, report
from turnbuckle.scene.yaml_nodes import YamlError, parse_yaml, plain

SHORT = {"friction": "contact.friction"}  # what a whole scene has, by the name that everybody tries first
_PART = re.compile(r"\.?([^.\[\]]+)|\[(-?\d{1,9})\]")


def split_assignment(assignment: str) -> tuple[str, Any]:
    """Path and value of `path=value`; the value is YAML, nothing after the `=` is null."""
    path, equals, text = assignment.partition("=")
    if not equals or not path.strip():
        raise InputError(f"--set {assignment!r}: expected path=value, such as dt=1e-3 or bodies.rope.density=3")
    try:
        node = parse_yaml(text)
    except YamlError as error:
        raise InputError(f"--set {assignment!r}: the value {error}") from None
    return path.strip(), None if node is None else plain(node)


def override(definition: SceneDef, assignment: str, context: dict[str, Any] | None = None) -> SceneDef:
    """A new definition with one field changed and everything validated again. Raises `InputError`."""
    path, value = split_assignment(assignment)
    data = given_data(definition)
    if path in SHORT:
        if definition.contact is None:
            raise InputError(
                f"--set {assignment}: contact is off, so there is no friction; add --set contact=true before"
            )
        path = SHORT[path]
    place = _assign(data, path, value, assignment)
    folder = Path((context or {}).get("folder", ""))
    try:
        return SceneDef.model_validate(data, context={"load_array": ArrayFiles(folder).load, **(context or {})})
    except ValidationError as error:
        found = problems(error, SceneDef, data)
        # A problem elsewhere (two ways at once, say) is told with its own place, one at the path itself without.
        lines = [("" if at == place else place_text(at), text) for at, text in found]
        raise InputError("\n".join(f"--set {assignment}: {line}" for line in report(lines).splitlines())) from None


def _assign(data: dict[str, Any], path: str, value: Any, assignment: str) -> tuple[str | int, ...]:
    """Set the value at the path in nested dicts and lists; returns the path with names of items as numbers."""
    place: list[str | int] = []
    node: Any = data
    rest = path
    while True:
        if isinstance(node, list) and len(node) == 1 and isinstance(node[0], dict) and _is_field(rest):
            place.append(0)  # `points` is a list of one selection, but may be written as that selection
            node = node[0]
        key, rest = _next_part(node, rest, assignment)
        place.append(key)
        if not rest:
            node[key] = value
            return tuple(place)
        inner: Any = node[key] if isinstance(key, int) else node.get(key)
        if inner is None:
            inner = {}
        elif isinstance(inner, np.ndarray):
            inner = inner.tolist()
        elif not isinstance(inner, (dict, list)):
            raise InputError(f"--set {assignment}: {place_text(tuple(place))} has no parts")
        node[key] = inner
        node = inner


def _is_field(rest: str) -> bool:
    """Whether the path goes on with the name of a field of a selection of points."""
    match = _PART.match(rest)
    return match is not None and match.group(1) in PointsDef.model_fields


def _next_part(node: Any, rest: str, assignment: str) -> tuple[str | int, str]:
    """The next part of a path, and what follows. An item of a list may be named (names may hold dots: longest wins)."""
    if isinstance(node, list) and rest.startswith("."):
        names = {item["name"]: i for i, item in enumerate(node) if isinstance(item, dict) and "name" in item}
        text = rest[1:]
        fitting = [n for n in names if text == n or text.startswith((n + ".", n + "["))]
        if fitting:
            name = max(fitting, key=len)
            return names[name], text[len(name) :]
        raise InputError(
            f"--set {assignment}: there is no {text.split('.')[0]!r}{did_you_mean(text.split('.')[0], names)}"
        )
    match = _PART.match(rest)
    if match is None:
        raise InputError(f"--set {assignment}: the path cannot be read at {rest[:40]!r}")
    after = rest[match.end() :]
    if match.group(1) is not None:
        if isinstance(node, list):
            raise InputError(f"--set {assignment}: expected [number] or a name before {match.group(1)[:40]!r}")
        return match.group(1).strip(), after
    index = int(match.group(2))
    if not isinstance(node, list) or not 0 <= index < len(node):
        size = f"there are {len(node)}" if isinstance(node, list) else "this is no list"
        raise InputError(f"--set {assignment}: there is no item [{index}], {size}")
    return index, after
