"""YAML text to a tree of nodes that remember their lines.

PyYAML's parser gives the events (libyaml's where it is there, for speed); the tree is built here and not by PyYAML's
composer, because a scene file is input from strangers: the composer recurses (deep nesting ends the process), expands
aliases without limit, resolves numbers after YAML 1.1 (`1e5` is a text, `on` is true) and keeps the last of two equal
keys. Here nothing recurses while reading, nesting and aliases are bounded, scalars follow the core schema of YAML 1.2,
and no tag but the core ones is known, so nothing can be executed or constructed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml

from turnbuckle.data.errors import InputError

MAX_DEPTH = 40  # nested lists and mappings
MAX_EXPANSION = 200_000  # nodes that aliases may add in all
MAX_CHARACTERS = 200_000_000

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NULL = re.compile(r"(~|null|Null|NULL|)")
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+")
_OCT = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INF = re.compile(r"[-+]?\.(inf|Inf|INF)")
_NAN = re.compile(r"\.(nan|NaN|NAN)")
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TAG = "tag:yaml.org,2002:"


@dataclass
class Node:
    """A place in the text. `value`: a scalar, a list of nodes, or a dict of (line of the key, node)."""

    line: int
    value: Any
    size: int = 1  # nodes in it, aliases expanded
    height: int = 1  # levels in it


@dataclass
class _Open:
    """A list or mapping that is not closed yet."""

    node: Node
    anchor: str | None
    key: tuple[str, int] | None = None  # of a mapping, while its value is awaited
    merged: list[tuple[int, Node]] = field(default_factory=list)  # `<<`


class YamlError(InputError):
    """The text is not the YAML of a scene; `line` counts from 1."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(message)
        self.line = line


def parse_yaml(text: str) -> Node | None:
    """The tree of the only document in `text`, None where there is none. Raises `YamlError`."""
    if len(text) > MAX_CHARACTERS:
        raise YamlError(1, f"longer than {MAX_CHARACTERS} characters; keep large arrays in .npz files beside the scene")
    strange = _UNPRINTABLE.search(text)
    if strange:
        line = text.count("\n", 0, strange.start()) + 1
        raise YamlError(line, f"the character U+{ord(strange.group()):04X} does not belong in a text file")
    try:
        return _Builder().build(yaml.parse(text, Loader=_LOADER))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise YamlError(mark.line + 1 if mark else 1, _yaml_problem(error)) from None
    except (yaml.YAMLError, UnicodeError) as error:
        raise YamlError(1, f"cannot be read as YAML ({str(error).splitlines()[0]})") from None
    except RecursionError:
        raise YamlError(1, "nested too deeply") from None


def _yaml_problem(error: yaml.MarkedYAMLError) -> str:
    problem = error.problem or "unknown error"
    context = f" {error.context}" if error.context else ""
    if "tab character" in problem or "'\\t'" in problem or "cannot start any token" in problem:
        return f"cannot be read as YAML: {problem}{context} (indent with spaces, not tabs)"
    if "mapping values are not allowed" in problem:
        return f"cannot be read as YAML: {problem} (check the indentation, and quote texts that hold ': ')"
    return f"cannot be read as YAML: {problem}{context}"


class _Builder:
    def __init__(self) -> None:
        self.stack: list[_Open] = []
        self.anchors: dict[str, Node] = {}
        self.open_anchors: set[str] = set()
        self.expansion = 0
        self.root: Node | None = None

    def build(self, events: Iterator[yaml.Event]) -> Node | None:
        documents = 0
        for event in events:
            line = event.start_mark.line + 1
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise YamlError(line, "a scene file holds one document; remove the second '---'")
            elif isinstance(event, yaml.ScalarEvent):
                self.scalar(event, line)
            elif isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent)):
                self.open(event, line)
            elif isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent)):
                self.close()
            elif isinstance(event, yaml.AliasEvent):
                self.alias(event.anchor, line)
        return self.root

    def scalar(self, event: yaml.ScalarEvent, line: int) -> None:
        parent = self.stack[-1] if self.stack else None
        if parent is not None and isinstance(parent.node.value, dict) and parent.key is None:
            if event.tag not in (None, "!", _TAG + "str"):
                raise YamlError(line, f"the tag {event.tag[:60]!r} is not allowed")
            parent.key = (event.value, line)
            if event.anchor:
                self.anchors[event.anchor] = Node(line, event.value)
            return
        node = Node(line, _scalar(event, line))
        if event.anchor:
            self.anchors[event.anchor] = node
        self.put(node, line)

    def open(self, event: Any, line: int) -> None:
        mapping = isinstance(event, yaml.MappingStartEvent)
        if event.tag not in (None, "!", _TAG + ("map" if mapping else "seq")):
            raise YamlError(line, f"the tag {event.tag[:60]!r} is not allowed")
        self.refuse_as_key(line)
        if len(self.stack) >= MAX_DEPTH:
            raise YamlError(line, f"nested more than {MAX_DEPTH} levels deep")
        self.stack.append(_Open(Node(line, {} if mapping else []), event.anchor))
        if event.anchor:
            self.anchors.pop(event.anchor, None)
            self.open_anchors.add(event.anchor)

    def close(self) -> None:
        done = self.stack.pop()
        node = done.node
        for line, source in done.merged:
            self.merge(node, source, line)
        children = node.value if isinstance(node.value, list) else [child for _, child in node.value.values()]
        node.size = 1 + sum(child.size for child in children)
        node.height = 1 + max((child.height for child in children), default=0)
        if node.height > MAX_DEPTH:
            raise YamlError(node.line, f"nested more than {MAX_DEPTH} levels deep")
        if done.anchor:
            self.open_anchors.discard(done.anchor)
            self.anchors[done.anchor] = node
        self.put(node, node.line)

    def alias(self, name: str, line: int) -> None:
        if name in self.open_anchors:
            raise YamlError(line, f"the alias *{name} is inside its own anchor")
        node = self.anchors.get(name)
        if node is None:
            raise YamlError(line, f"there is no anchor &{name} before this alias")
        self.refuse_as_key(line)
        self.expansion += node.size
        if self.expansion > MAX_EXPANSION:
            raise YamlError(line, f"the aliases expand to more than {MAX_EXPANSION} values")
        self.put(node, line)

    def refuse_as_key(self, line: int) -> None:
        if self.stack and isinstance(self.stack[-1].node.value, dict) and self.stack[-1].key is None:
            raise YamlError(line, "the name of a field must be a plain text")

    def put(self, node: Node, line: int) -> None:
        if not self.stack:
            self.root = node
            return
        parent = self.stack[-1]
        if isinstance(parent.node.value, list):
            parent.node.value.append(node)
            return
        assert parent.key is not None  # keys come first, refuse_as_key saw to it
        (key, key_line), parent.key = parent.key, None
        if key == "<<":
            parent.merged.append((key_line, node))
        elif key in parent.node.value:
            first = parent.node.value[key][0]
            raise YamlError(key_line, f"the field {key[:60]!r} is given twice (first in line {first})")
        else:
            parent.node.value[key] = (key_line, node)

    def merge(self, target: Node, source: Node, line: int) -> None:
        """`<<: *base`: the fields of base that are not given here."""
        for part in source.value if isinstance(source.value, list) else [source]:
            if not isinstance(part.value, dict):
                raise YamlError(line, "'<<' takes a mapping")
            for key, entry in part.value.items():
                target.value.setdefault(key, entry)


def _scalar(event: yaml.ScalarEvent, line: int) -> Any:
    """The value of a scalar after the core schema of YAML 1.2."""
    text, tag = event.value, event.tag
    if tag not in (None, "!", *(_TAG + kind for kind in ("str", "int", "float", "bool", "null"))):
        raise YamlError(line, f"the tag {tag[:60]!r} is not allowed")
    quoted = event.style is not None and event.style != ""
    if tag in ("!", _TAG + "str") or (quoted and tag is None):
        return text
    value = resolve(text)
    if tag is not None and tag != _TAG + _kind(value):
        if tag == _TAG + "float" and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        raise YamlError(line, f"{text[:40]!r} does not fit its tag {tag.removeprefix(_TAG)}")
    return value


def _kind(value: Any) -> str:
    return {bool: "bool", int: "int", float: "float", str: "str"}.get(type(value), "null")


def resolve(text: str) -> Any:
    """The value of an unquoted scalar: nothing, true or false, a number, or else the text itself."""
    if _NULL.fullmatch(text):
        return None
    if text in _BOOL:
        return _BOOL[text]
    if len(text) > 400:  # no number worth having; conversion of digits is quadratic
        return text
    if _INT.fullmatch(text):
        return int(text)
    if _OCT.fullmatch(text):
        return int(text, 8)
    if _HEX.fullmatch(text):
        return int(text, 16)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INF.fullmatch(text):
        return float("-inf") if text.startswith("-") else float("inf")
    if _NAN.fullmatch(text):
        return float("nan")
    return text


def plain(node: Node) -> Any:
    """Nested dicts, lists and scalars (recursion bounded by the height of the tree)."""
    if isinstance(node.value, dict):
        return {key: plain(child) for key, (_, child) in node.value.items()}
    if isinstance(node.value, list):
        return [plain(child) for child in node.value]
    return node.value


def line_of(root: Node, place: tuple[str | int, ...]) -> int:
    """The line of a place as deep as the tree knows it; of a field, the line of its name."""
    node, line = root, root.line
    for part in place:
        if isinstance(node.value, dict) and part in node.value:
            line, node = node.value[part]
        elif isinstance(node.value, list) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.line
        else:
            break
    return line
