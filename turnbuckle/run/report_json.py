"""A `RunReport` as JSON, under names that scripts may rely on, and back."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from turnbuckle.data.errors import InputError
from turnbuckle.data.report import RunReport

SCHEMA_VERSION = 1


def to_json(report: RunReport) -> str:
    """The text of a report file: every field of `RunReport` by its name. Numbers that are not finite become null."""
    names = [f.name for f in fields(RunReport)]
    data = {"schema_version": SCHEMA_VERSION, **{name: _plain(getattr(report, name)) for name in names}}
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def from_json(text: str) -> RunReport:
    """The report that `to_json` wrote. Raises InputError when it is none."""
    try:
        data = json.loads(text)
        if not isinstance(data, dict) or data.pop("schema_version", None) != SCHEMA_VERSION:
            raise InputError(f"report: is no report of Turnbuckle of schema_version {SCHEMA_VERSION}")
        return RunReport(**data)
    except (ValueError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"report: is no report of Turnbuckle ({error})") from None


def _plain(value: Any) -> Any:
    """Numbers of NumPy as Python's, keys as text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if value is None or isinstance(value, bool | str):
        return value
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, int | float) else str(value)
