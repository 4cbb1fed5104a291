"""What all definitions share: unknown fields refused, constant, compared by value (arrays bit for bit)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


def same(a: Any, b: Any) -> bool:
    """Whether two plain values, arrays, lists, or definitions are identical (arrays also in shape and type)."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return (
            isinstance(a, np.ndarray)
            and isinstance(b, np.ndarray)
            and a.dtype == b.dtype
            and a.shape == b.shape
            and a.tobytes() == b.tobytes()
        )
    if isinstance(a, Definition):
        return type(a) is type(b) and same(a.__dict__, b.__dict__)
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return type(a) is type(b) and bool(a == b)


class Definition(BaseModel):
    """Base of all definitions: constant, and equal when every field is identical."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=False)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Definition) and same(self, other)

    __hash__ = None  # type: ignore[assignment]  # arrays inside have no hash

    def given(self, names: Iterable[str]) -> list[str]:
        """Those of the fields `names` that are set (not None, not False)."""
        found = []
        for name in names:
            value = getattr(self, name)
            if value is not None and value is not False:
                found.append(name)
        return found

    def fill(self, name: str, value: Any) -> None:
        """Set a field that was left open to its default without marking it as given by the user."""
        self.__dict__[name] = value


def problem(message: str, *at: str | int) -> PydanticCustomError:
    """A validation error of one sentence; `at` is the place below the definition that raises it."""
    return PydanticCustomError("turnbuckle", "{text}", {"text": message, "at": at})


def exactly_one(definition: Definition, options: Iterable[tuple[str, ...]], together: Iterable[str] = ()) -> str:
    """Check that exactly one group of fields is given, and all of that group; return its first name.

    `options`: groups of fields that belong together. `together` names fields that may join any group (not checked).
    """
    groups = list(options)
    text = ", or ".join(" + ".join(group) for group in groups)
    touched = [group for group in groups if definition.given(group)]
    if not touched:
        raise problem(f"give exactly one of {text}")
    if len(touched) > 1:
        names = " and ".join(definition.given(group)[0] for group in touched)
        raise problem(f"give exactly one of {text}, not {names} together", definition.given(touched[1])[0])
    missing = [name for name in touched[0] if name not in definition.given(touched[0])]
    if missing:
        raise problem(f"{definition.given(touched[0])[0]!r} needs {' and '.join(map(repr, missing))} beside it")
    return touched[0][0]
