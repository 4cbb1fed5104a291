"""What is varied: `friction=0.1:0.9:9`, `integrator=verlet,rk4`, and all combinations of such."""

import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.yaml_nodes import YamlError, parse_yaml, plain

Values = dict[str, Any]  # path of a field, or name of a parameter -> value
LIMIT = 100_000  # runs of one sweep; more is a typing error
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER}):({_NUMBER}):(\d{{1,9}})(:log)?\s*")


def parse_vary(text: str) -> tuple[str, list[Any]]:
    """Path and values of `path=first:last:count`, `path=first:last:count:log` (a constant ratio) or `path=a,b,c`.

    Each value of a list is YAML; commas in brackets or quotes divide nothing. Raises `InputError`.
    """
    path, equals, right = text.partition("=")
    path = path.strip()
    if not equals or not path or not right.strip():
        raise InputError(f"--vary {text!r}: expected path=first:last:count or path=a,b,c, such as dt=1e-3,1e-4")
    found = _RANGE.fullmatch(right)
    if found:
        return path, spaced(float(found[1]), float(found[2]), int(found[3]), bool(found[4]), f"--vary {text}")
    if re.match(rf"\s*{_NUMBER}:", right):
        raise InputError(
            f"--vary {text}: a range is first:last:count, such as 0.1:0.9:9, with :log for a constant ratio"
        )
    values = []
    for part in _parts(right, text):
        try:
            node = parse_yaml(part)
        except YamlError as error:
            raise InputError(f"--vary {text}: the value {part.strip()!r} {error}") from None
        if node is None:
            raise InputError(f"--vary {text}: there is an empty value between commas")
        values.append(plain(node))
    return path, values


def spaced(first: float, last: float, count: int, ratio: bool, label: str) -> list[Any]:
    """``count`` values from ``first`` to ``last``, whole numbers where all are. Raises `InputError`."""
    if not 1 <= count <= LIMIT:
        raise InputError(f"{label}: a range needs from 1 to {LIMIT} values")
    if not (math.isfinite(first) and math.isfinite(last)):
        raise InputError(f"{label}: the ends of a range must be finite")
    if ratio and (first * last <= 0.0):
        raise InputError(f"{label}: a range with :log needs two ends of one sign, and not 0")
    values = np.geomspace(first, last, count) if ratio else np.linspace(first, last, count)
    # 0.30000000000000004 is 0.3 to whoever asked for 0.1:0.9:9.
    rounded = [float(f"{value:.12g}") for value in values]
    return [int(v) for v in rounded] if all(v.is_integer() and abs(v) < 2**53 for v in rounded) else rounded


def _parts(text: str, whole: str) -> list[str]:
    """Split at commas outside of brackets and quotes."""
    parts, depth, quote, begin = [], 0, "", 0
    for i, c in enumerate(text):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == "," and depth == 0:
            parts.append(text[begin:i])
            begin = i + 1
    if depth or quote:
        raise InputError(f"--vary {whole}: a bracket or quote is not closed")
    return [*parts, text[begin:]]


def combine(vary: Mapping[str, Sequence[Any]], together: bool = False) -> list[Values]:
    """All combinations, the last name fastest; ``together``: the first values of all, then the second ones, ...

    Raises `InputError` for nothing to vary, lists of other lengths where they go together, and too many runs.
    """
    if not vary:
        raise InputError("sweep: there is nothing to vary; give a path and its values")
    lists = {}
    for path, values in vary.items():
        if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray):
            raise InputError(f"sweep: vary[{path!r}] is {values!r}; give a list of values")
        plain_values = values.tolist() if isinstance(values, np.ndarray) else [_plain(v) for v in values]
        if not plain_values:
            raise InputError(f"sweep: vary[{path!r}] is empty; give at least one value")
        if len({text_of(v) for v in plain_values}) < len(plain_values):
            raise InputError(f"sweep: {path} has the same value twice; every run is to be another one")
        lists[path] = plain_values
    lengths = {len(values) for values in lists.values()}
    if together and len(lengths) > 1:
        told = ", ".join(f"{path} has {len(values)}" for path, values in lists.items())
        raise InputError(f"sweep: values that go together must be as many of each; {told}")
    count = max(lengths) if together else math.prod(len(values) for values in lists.values())
    if count > LIMIT:
        raise InputError(f"sweep: these are {count} runs, at most {LIMIT} are allowed")
    rows = zip(*lists.values(), strict=True) if together else itertools.product(*lists.values())
    return [dict(zip(lists, row, strict=True)) for row in rows]


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def text_of(value: Any) -> str:
    """A value as JSON, which is YAML too. Raises `InputError` for what neither can hold."""
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(f"sweep: {value!r} cannot be written into a scene file; give numbers, text or lists") from None


def slug(values: Values) -> str:
    """Values as the name of a folder, for people; at most 80 characters, none of which a file system refuses."""
    shown = ",".join(f"{path.rpartition('.')[2]}={_short(value)}" for path, value in values.items())
    return re.sub(r"[^A-Za-z0-9=,.+_-]+", "_", shown)[:80].strip("._") or "run"


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else value if isinstance(value, str) else text_of(value)
