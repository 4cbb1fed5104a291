"""From pydantic's errors to sentences for a user: the place, what is wrong, and the nearest right word.

Nothing here knows of files; `yaml_file.py` adds file and line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, get_args

import numpy as np
from pydantic import ValidationError

from turnbuckle.data.errors import InputError
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.fields import describe
from turnbuckle.scene.suggestion import did_you_mean

MAX_PROBLEMS = 20  # lines of one error message

Place = tuple[str | int, ...]
Problem = tuple[Place, str]
D = TypeVar("D", bound=Definition)


def validate(kind: type[D], data: Mapping[str, Any], label: str = "", context: dict[str, Any] | None = None) -> D:
    """A definition of `kind` made of `data`. Raises `InputError`, one line a problem: `label, place: what is wrong`."""
    try:
        return kind.model_validate(dict(data), context=context)
    except ValidationError as error:
        found = [(", ".join(filter(None, (label, place_text(at)))), text) for at, text in problems(error, kind, data)]
        raise InputError(report(found)) from None
    except RecursionError:
        raise InputError(f"{label or 'the scene'}: nested too deeply") from None


def report(lines: list[tuple[str, str]]) -> str:
    """The message of an error: at most `MAX_PROBLEMS` lines `place: text`."""
    texts = [f"{place}: {text}" if place else text for place, text in lines[:MAX_PROBLEMS]]
    if len(lines) > MAX_PROBLEMS:
        texts.append(f"... and {len(lines) - MAX_PROBLEMS} more")
    return "\n".join(texts)


def place_text(place: Place) -> str:
    """A place in words, such as `bodies[0].density`."""
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")


def problems(error: ValidationError, kind: type[Definition], data: Any) -> list[Problem]:
    """All problems, each with its place in `data` (nested dicts and lists)."""
    found: list[Problem] = []
    for item in error.errors(include_url=False):
        if item["type"] == "turnbuckle_many":
            raw = [((*item["loc"], *at), text) for at, text in item["ctx"]["problems"]]
        else:
            raw = list(_explain(item, kind))
        found.extend((clean(at, data), text) for at, text in raw)
    return found


def clean(place: Place, data: Any) -> Place:
    """`place` without the tags of unions (`<rope>`) and without the index 0 of what was not written as a list."""
    parts: list[str | int] = []
    node = data
    for part in place:
        if isinstance(part, str) and part.startswith("<"):
            continue
        if isinstance(part, int) and isinstance(node, (Mapping, Definition)):
            continue
        parts.append(part)
        node = _child(node, part)
    return tuple(parts)


def _child(node: Any, part: str | int) -> Any:
    if isinstance(node, Definition):
        return getattr(node, str(part), None)
    if isinstance(node, Mapping):
        return node.get(part)
    if isinstance(node, (list, tuple)) and isinstance(part, int) and part < len(node):
        return node[part]
    return None


def fields_at(kind: type[Definition], place: Place) -> list[str]:
    """Names of the fields that a mapping at `place` may have."""
    kinds = {kind}
    for part in place:
        if isinstance(part, int):
            continue
        if part.startswith("<"):
            kinds = {k for k in kinds if "type" not in k.model_fields or f"<{k.model_fields['type'].default}>" == part}
        else:
            annotations = [k.model_fields[part].annotation for k in kinds if part in k.model_fields]
            kinds = {found for annotation in annotations for found in _definitions_in(annotation)}
    return sorted({name for k in kinds for name in k.model_fields if not (name == "callable")})


def _definitions_in(annotation: Any) -> Iterator[type[Definition]]:
    if isinstance(annotation, type) and issubclass(annotation, Definition):
        yield annotation
    for inner in get_args(annotation):
        yield from _definitions_in(inner)


_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "of at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "of at most"),
}


def _explain(item: Any, kind: type[Definition]) -> Iterator[Problem]:
    """The problem of one pydantic error."""
    what, at, value, context = item["type"], item["loc"], item.get("input"), item.get("ctx") or {}
    if what == "turnbuckle":
        yield (*at, *context["at"]), context["text"]
    elif what == "extra_forbidden":
        yield at, f"unknown field{did_you_mean(at[-1], fields_at(kind, at[:-1]))}"
    elif what == "missing":
        yield at, "this field is needed, but missing"
    elif what in ("union_tag_invalid", "union_tag_not_found"):
        yield _explain_tag(at, value, context, kind)
    elif what in ("literal_error", "enum"):
        options = re.findall(r"'([^']*)'", context["expected"]) or [context["expected"]]
        near = did_you_mean(value, options) if isinstance(value, str) else ""
        near = near if near.startswith(", did") else ""
        yield (
            at,
            f"expected {', '.join(options[:-1])}{' or ' * (len(options) > 1)}{options[-1]}, got {describe(value)}{near}",
        )
    elif what in _BOUNDS:
        key, words = _BOUNDS[what]
        yield at, f"expected a number {words} {context[key]:g}, got {describe(value)}"
    elif what in ("model_type", "model_attributes_type", "dict_type"):
        yield at, f"expected a mapping of fields, got {describe(value)}"
    elif what == "list_type":
        yield at, f"expected a list, got {describe(value)}"
    elif what == "callable_type":
        yield at, f"expected a Python callable, which a scene file cannot hold, got {describe(value)}"
    elif what in ("too_short", "string_too_short") and isinstance(value, str):
        yield at, "expected text, got an empty one"
    elif what in ("too_long", "string_too_long") and isinstance(value, str):
        yield at, f"expected text of at most {context['max_length']} characters, got {len(value)}"
    elif what in ("too_short", "too_long"):
        words, bound = (
            ("at least", context["min_length"]) if what == "too_short" else ("at most", context["max_length"])
        )
        yield at, f"expected {words} {bound} item{'s' * (bound != 1)}, got {context['actual_length']}"
    elif what == "string_pattern_mismatch":
        yield at, f"expected a name of letters, digits, '_', '-' and '.', got {describe(value)}"
    elif what == "value_error":
        yield at, str(context.get("error", item["msg"]))
    else:
        yield at, item["msg"].replace("Input should be", "expected")


def _explain_tag(at: Place, value: Any, context: dict[str, Any], kind: type[Definition]) -> Problem:
    """A union without a matching kind: the `type` of a body or constraint, or a missing velocity goal."""
    known = [tag[1:-1] for tag in re.findall(r"<\w+>", str(context.get("expected_tags", "")))]
    if at and at[-1] == "goal":
        return at, f"expected an array of shape (3,) or (n, 3), or keyframes, got {describe(value)}"
    if not known:
        known = _types(kind, at)
    if not isinstance(value, (Mapping, Definition)):
        return at, f"expected a mapping of fields, got {describe(value)}"
    name = value.get("type") if isinstance(value, Mapping) else getattr(value, "type", None)
    if name is None:
        return at, f"'type' is needed (known: {', '.join(known)})"
    if not isinstance(name, str):
        return (*at, "type"), f"expected one of {', '.join(known)}, got {describe(name)}"
    near = did_you_mean(name, known)
    listed = f" (known: {', '.join(known)})" if near.startswith(", did") else ""
    return (*at, "type"), f"unknown type {name[:60]!r}{near}{listed}"


def _types(kind: type[Definition], at: Place) -> list[str]:
    """The values of `type` allowed at a place, for a mapping that has none."""
    annotations = [kind.model_fields[str(part)].annotation for part in at[:1] if part in kind.model_fields]
    found = [k for annotation in annotations for k in _definitions_in(annotation)]
    return [str(k.model_fields["type"].default) for k in found if "type" in k.model_fields]


def given_data(value: Any) -> Any:
    """A definition as nested dicts and lists of what the user gave (defaults left out), arrays and callables as is."""
    if isinstance(value, Definition):
        names = [n for n in type(value).model_fields if n in value.model_fields_set or n == "type"]
        if "bodies" in type(value).model_fields and "forces" in type(value).model_fields:  # a whole scene
            names = [
                n
                for n in type(value).model_fields
                if n in names or (isinstance(getattr(value, n), list) and getattr(value, n))
            ]
        return {n: given_data(getattr(value, n)) for n in names if getattr(value, n) is not None}
    if isinstance(value, (list, tuple)):
        return [given_data(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return value
    return value
