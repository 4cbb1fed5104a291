"""What a field of a definition may hold, read off its annotation, so that a new field can be said without a word here."""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic.fields import FieldInfo

from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.fields import ArraySpec


@dataclass(frozen=True)
class Form:
    """The kinds of values a field takes; several may be true."""

    number: bool = False
    text: bool = False
    flag: bool = False
    array: bool = False
    shapes: tuple[tuple[int | None, ...], ...] = ()  # of an array
    optional: bool = False
    options: tuple[str, ...] = ()  # of a text that is one of a few
    texts: bool = False  # a list of texts
    record: tuple[type[Definition], ...] = ()
    records: tuple[type[Definition], ...] = ()  # a list of records: the statement may be repeated
    groups: tuple[type[Definition], ...] = ()  # a list of lists of records: likewise

    @property
    def said(self) -> bool:
        """Whether a text can say it: not what is only a Python callable."""
        return any((self.number, self.text, self.flag, self.array, self.texts, self.record, self.records, self.groups))

    @property
    def lengths(self) -> set[int]:
        """Lengths that a plain row of numbers may have; empty where any length does."""
        flat = [shape[0] for shape in self.shapes if len(shape) == 1]
        return set() if None in flat else {length for length in flat if length is not None}


@cache
def form_of(kind: type[Definition], field: str) -> Form:
    """The form of a field of a definition."""
    found: dict[str, Any] = {}
    for depth, what in _leaves(kind.model_fields[field], 0):
        if isinstance(what, type) and issubclass(what, Definition):
            name = ("record", "records", "groups")[min(depth, 2)]
            found[name] = (*found.get(name, ()), what)
        elif isinstance(what, ArraySpec):
            found["shapes"] = (*found.get("shapes", ()), *what.shapes)
        elif isinstance(what, str):
            found["options"] = (*found.get("options", ()), what)
            found["text"] = True
        elif depth:
            found["texts"] = True
        elif what is np.ndarray:
            found["array"] = True
        elif what is bool:
            found["flag"] = True
        elif what in (int, float):
            found["number"] = True
        elif what is str:
            found["text"] = True
        elif what is type(None):
            found["optional"] = True
    return Form(**found)


def types_in(kind: type[Definition], field: str) -> dict[str, type[Definition]]:
    """Definitions by their `type`, of a list such as the bodies of a scene."""
    form = form_of(kind, field)
    return {str(k.model_fields["type"].default): k for k in form.records if "type" in k.model_fields}


def _leaves(annotation: Any, depth: int) -> Iterator[tuple[int, Any]]:
    """The plain types inside an annotation, each with the number of lists around it."""
    if isinstance(annotation, FieldInfo):
        yield from _leaves(annotation.annotation, depth)
        yield from ((depth, mark) for mark in annotation.metadata if isinstance(mark, ArraySpec))
        return
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _leaves(inner[0], depth)
        for mark in inner[1:]:
            if isinstance(mark, ArraySpec):
                yield depth, mark
    elif origin in (Union, types.UnionType):
        for one in inner:
            yield from _leaves(one, depth)
    elif origin is list:
        yield from _leaves(inner[0], depth + 1)
    elif origin is Literal:
        for one in inner:
            yield depth, one if isinstance(one, str) else type(one)
    elif origin is None:
        yield depth, annotation
