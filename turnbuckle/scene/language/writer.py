"""Nested dicts of a scene file to a text of the language, exactly: reading it again gives the same bits."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import SceneDef
from turnbuckle.scene.language.forms import Form, form_of
from turnbuckle.scene.language.parser import DEFAULT_TYPES, classes_of
from turnbuckle.scene.language.tokens import NUMBER, WORD, number
from turnbuckle.scene.language.words import BLOCKS, FLAGS, LISTS, POSITIONAL, RESERVED, pairs_of, short_of, word_of

INDENT = "  "
WIDTH = 100  # characters of a statement on one line
ROW = "\n"


def write_description(data: dict[str, Any]) -> str:
    """The text of the data of a scene (as `validation.given_data` gives it, names of array files allowed)."""
    blocks = []
    world = {key: value for key, value in data.items() if key not in LISTS.values() and key != "schema_version"}
    if world:
        blocks.append(_block("world", "world", SceneDef, world))
    for block, name in LISTS.items():
        for item in data.get(name, []):
            kind = classes_of(block)[item.get("type", DEFAULT_TYPES.get(block, block))]
            rest = {key: value for key, value in item.items() if key != "type"}
            title = f"object {_name(rest.pop('name'))}" if block == "object" else block
            if block in DEFAULT_TYPES and item["type"] != DEFAULT_TYPES[block]:
                title += f" type {item['type']};"
            blocks.append(_block(block, title, kind, rest))
    return "\n".join(blocks)


def _block(block: str, title: str, kind: type[Definition], item: dict[str, Any]) -> str:
    lines = [title]
    for statement in _statements(kind, item):  # with a line end between rows of numbers
        long = len(statement) > WIDTH
        lines.append(f"{INDENT}{statement.replace(ROW, ROW + 2 * INDENT if long else ' ')};")
    return "\n".join([*lines, "end", ""])


def _statements(kind: type[Definition], item: dict[str, Any]) -> list[str]:
    """One text a statement; pairs of vectors at once."""
    found: list[str] = []
    done: set[str] = set()
    order = list(item)
    for pair in pairs_of(kind).values():  # a hinge right after the objects, as the paper has it
        if all(name in item for name in pair):
            order.remove(pair[0])
            at = max((order.index(name) + 1 for name in ("body0", "body1") if name in order), default=0)
            order.insert(at, pair[0])
    for name in order:
        if name in done or item[name] is None:
            continue
        both = next(((w, pair) for w, pair in pairs_of(kind).items() if name in pair), None)
        short = [w for w, meant in short_of(kind).items() if meant == (name, item[name])]
        form = form_of(kind, name)
        if both is not None and all(one in item and not isinstance(item[one], str) for one in both[1]):
            found.append(f"{both[0]} {'  '.join(_array(item[one]) for one in both[1])}")
            done.update(both[1])
        elif short:
            found.append(short[0])
        elif form.records or form.groups:
            entries = item[name] if isinstance(item[name], list) else [item[name]]
            found.extend(f"{word_of(kind, name)} {_entry(form, entry)}".rstrip() for entry in entries)
        else:
            found.append(_said(kind, name, item[name], False))
    return found


def _said(kind: type[Definition], name: str, value: Any, inner: bool) -> str:
    """The word of a field and its value."""
    word = word_of(kind, name)
    if value is True:
        return word
    if isinstance(value, bool):
        return f"{word} {next(text for text, flag in FLAGS.items() if flag is value)}"
    if name == "bodies":
        return f"{word} ({' '.join(_text(one) for one in value)})"
    return f"{word} {_value(form_of(kind, name), value, inner)}".rstrip()


def _value(form: Form, value: Any, inner: bool) -> str:
    if isinstance(value, dict):
        text = _record(_kind_of(form.record, value), value)
        return f"({text})" if inner else text
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, list):
        return _list(form, value)
    if isinstance(value, (int, float)):
        return _number(value)
    if form.array:
        return _quoted(value)  # the name of a file
    return str(value) if value in form.options else _text(str(value))


def _entry(form: Form, entry: Any) -> str:
    if form.groups:
        return " ".join(f"({_record(_kind_of(form.groups, one), one)})" for one in entry)
    return _record(_kind_of(form.records, entry), entry)


def _kind_of(kinds: tuple[type[Definition], ...], value: dict[str, Any]) -> type[Definition]:
    return next((kind for kind in kinds if set(value) <= set(kind.model_fields)), kinds[0])


def _record(kind: type[Definition], value: dict[str, Any]) -> str:
    """Fields in one statement: first those without a word."""
    given = POSITIONAL.get(kind, ())
    parts = [_value(form_of(kind, name), value[name], True) for name in given]
    rest = {key: inner for key, inner in value.items() if key not in given and inner is not None}
    for word, pair in pairs_of(kind).items():
        if all(name in rest for name in pair):
            parts.append(f"{word} {'  '.join(_array(rest.pop(name)) for name in pair)}")
    for name, inner in rest.items():
        form = form_of(kind, name)
        entries = (inner if isinstance(inner, list) else [inner]) if form.records or form.groups else []
        parts.extend(f"{word_of(kind, name)} ({_entry(form, entry)})" for entry in entries)
        if not entries:
            parts.append(_said(kind, name, inner, True))
    for k in range(len(given) - 1):  # two vectors without a word stand a little apart
        parts[k] += " " if isinstance(value[given[k]], np.ndarray) else ""
    return " ".join(parts)


def _array(value: np.ndarray) -> str:
    """Numbers of a row plainly, rows in parentheses."""
    if value.ndim == 1:
        return " ".join(_number(one) for one in value.tolist())
    return ROW.join(f"({_array(row).replace(ROW, ' ')})" for row in value)


def _list(form: Form, value: list[Any]) -> str:
    """Texts, such as the components of a force: numbers plainly where that reads back the same."""
    if form.text or not all(isinstance(one, str) for one in value):
        raise InputError(f"the language has no way to say the list {value!r:.60}")
    return " ".join(one if NUMBER.fullmatch(one) and repr(number(one)) == one else _quoted(one) for one in value)


def _number(value: float) -> str:
    text = repr(value)
    return text[:-2] if text.endswith(".0") and text != "-0.0" else text


def _text(value: str) -> str:
    plain = WORD.fullmatch(value) and value not in RESERVED and value not in BLOCKS and value not in FLAGS
    return value if plain and value.isprintable() else _quoted(value)


_name = _text


def _quoted(value: str) -> str:
    """In quotes; what a text file does not hold is written as \\uXXXX."""
    if value.isprintable():
        return json.dumps(value, ensure_ascii=False)
    return json.dumps(value)
