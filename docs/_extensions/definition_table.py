"""Directives that make tables from the source, so that pages cannot go stale.

``definition-table``: the fields of a definition as a table, made from the definition itself.

    ```{definition-table} NailDef
    ```

lists the name, the type, the default and the description of each field of `turnbuckle.scene.definitions.NailDef`.
Fields that it shares with its base are left out under the option ``own``, which names that base.

``comment-table``: the fields of a data class with the comments beside them.

    ```{comment-table} turnbuckle.data.report.StepReport
    ```
"""

from __future__ import annotations

import importlib
import inspect
import re
import types
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin

import numpy as np
from docutils import nodes
from docutils.parsers.rst import Directive, directives
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.application import Sphinx

from turnbuckle.scene import definitions
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.fields import ArraySpec

WORDS = {float: "number", int: "whole number", bool: "true or false", str: "text", type(None): ""}
HUGE = 1e6  # bounds above only guard against typing errors and are not shown
COMMENTED = re.compile(r"^    (\w+): ([^=#\n]+?)(?: = [^#\n]*?)?(?:  # (.+))?$", re.MULTILINE)
HEAD = ("Field", "Type", "Default", "Meaning")
WIDTHS = (20, 26, 14, 60)


def type_text(annotation: Any, metadata: tuple[Any, ...] = ()) -> str:
    """The type of a field in words."""
    for item in metadata:
        if isinstance(item, ArraySpec):
            whole = "indices" if item.low is None else "whole numbers"
            return f"{whole if item.dtype == np.int32 else 'numbers'} {item.shape_text()}{_bounds(item)}"
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *more = get_args(annotation)
        return type_text(inner, (*metadata, *_flat(more)))
    if origin in (Union, types.UnionType):
        options = dict.fromkeys(type_text(option) for option in get_args(annotation))
        return " or ".join(option for option in options if option)
    if origin is Literal:
        return " or ".join(f"`{option}`" for option in get_args(annotation))
    if origin is list:
        return f"list of {type_text(get_args(annotation)[0])}"
    if isinstance(annotation, type) and issubclass(annotation, Definition):
        return annotation.__name__
    if annotation in WORDS:
        return WORDS[annotation] + (_bounds(metadata) if annotation in (int, float) else "")
    return "Python callable" if "Callable" in str(annotation) else str(annotation)


def _flat(metadata: list[Any]) -> tuple[Any, ...]:
    """The constraints inside a `Field(...)` are its metadata."""
    found: list[Any] = []
    for item in metadata:
        found.extend(item.metadata if isinstance(item, FieldInfo) else [item])
    return tuple(found)


def _bounds(item: Any) -> str:
    if isinstance(item, ArraySpec):
        pairs = ((">", item.above), ("≥", item.low), ("≤", item.high))
    else:
        found = {key: getattr(m, key) for m in item for key in ("gt", "ge", "lt", "le") if hasattr(m, key)}
        signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
        pairs = tuple((signs[key], value) for key, value in found.items())
    texts = [f"{sign} {value:g}" for sign, value in pairs if value is not None and value <= HUGE]
    return f", {', '.join(texts)}" if texts else ""


def default_text(field: FieldInfo) -> str:
    """The default in words: empty where there is none to show."""
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True, validated_data={})
    if value is None or value is PydanticUndefined:
        return ""
    if isinstance(value, np.ndarray):
        return f"`{[float(v) if v % 1 else int(v) for v in value]}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


class DefinitionTable(Directive):
    """See the head of this file."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"own": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        kind = getattr(definitions, self.arguments[0])
        shared = set(getattr(definitions, self.options["own"]).model_fields) if "own" in self.options else set()
        fields = [(name, field) for name, field in kind.model_fields.items() if name not in shared]
        return [_table(HEAD, [_cells(name, field) for name, field in fields])]


def _cells(name: str, field: FieldInfo) -> tuple[str, ...]:
    kind = type_text(field.annotation, tuple(field.metadata))
    if name == "type":  # a file has to say it, Python knows it by the name of the method
        return f"`{name}`", kind, "required", "What it is [text]."
    return f"`{name}`", kind, default_text(field), field.description or ""


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> nodes.table:
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=width) for width in WIDTHS[-len(head) :]]
    top, body = nodes.thead(), nodes.tbody()
    top += _row(head)
    body += [_row(row) for row in rows]
    group += [top, body]
    table = nodes.table(classes=["definition"])
    table += group
    return table


def _row(cells: tuple[str, ...]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        paragraph = nodes.paragraph()
        for i, part in enumerate(cell.split("`")):  # every second part is code
            if part:
                paragraph += nodes.literal(text=part) if i % 2 else nodes.Text(part)
        entry = nodes.entry()
        entry += paragraph
        row += entry
    return row


class CommentTable(Directive):
    """See the head of this file."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        module, _, name = self.arguments[0].rpartition(".")
        source = inspect.getsource(getattr(importlib.import_module(module), name))
        rows = [(f"`{field}`", f"`{kind}`", comment.strip()) for field, kind, comment in COMMENTED.findall(source)]
        if not rows:
            raise self.error(f"{self.arguments[0]} has no commented fields")
        return [_table(("Field", "Type", "Meaning"), rows)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_directive("definition-table", DefinitionTable)
    app.add_directive("comment-table", CommentTable)
    return {"parallel_read_safe": True}
