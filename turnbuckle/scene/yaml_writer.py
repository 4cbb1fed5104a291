"""A definition to YAML text, exactly: reading it again gives the same bits.

Written here because what a generic writer quotes follows YAML 1.1, where `1e5` is a text and needs no quotes; under
YAML 1.2 it is a number. Every text is quoted unless it is a plain word; floats are written by `repr`, which is exact.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from turnbuckle.scene.yaml_nodes import resolve

_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def write_yaml(data: dict[str, Any]) -> str:
    """YAML of nested dicts (keys are plain words), lists, arrays and scalars."""
    return "\n".join(_block(data)) + "\n"


def _block(value: Any) -> list[str]:
    """The lines of a value in block style."""
    if isinstance(value, dict):
        lines = []
        for key, inner in value.items():
            if _is_flow(inner):
                lines.append(f"{key}: {_flow(inner)}")
            else:
                lines.append(f"{key}:")
                lines.extend(f"  {line}" for line in _block(inner))
        return lines
    lines = []
    for inner in value:
        first, *rest = [_flow(inner)] if _is_flow(inner) else _block(inner)
        lines.append(f"- {first}")
        lines.extend(f"  {line}" for line in rest)
    return lines


def _is_flow(value: Any) -> bool:
    """Whether a value goes on one line: scalars, rows of numbers, short lists of scalars, what is empty."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 or value.size <= 6
    if isinstance(value, dict):
        return not value
    if isinstance(value, (list, tuple)):
        return all(not isinstance(inner, (dict, list, tuple, np.ndarray)) for inner in value)
    return True


def _flow(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return _flow(value.tolist())
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_flow(inner) for inner in value) + "]"
    if isinstance(value, dict):
        return "{}"
    return _scalar(value)


def _scalar(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    return _quote(str(value))


def _quote(text: str) -> str:
    if _WORD.fullmatch(text) and isinstance(resolve(text), str):
        return text
    if text.isprintable():
        return json.dumps(text, ensure_ascii=False)
    escaped = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08X}" for c in text)
    return '"' + "".join(escaped) + '"'
