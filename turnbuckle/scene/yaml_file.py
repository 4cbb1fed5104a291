"""Scene files: YAML to a validated definition and back, bit for bit. Every error says file, line and field.

Nothing in a file is executed: no tags, expressions through `expression.py`, arrays without pickles. Meshes and array
files are relative to the scene file.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from turnbuckle.data.errors import InputError
from turnbuckle.scene.array_files import ArrayFiles
from turnbuckle.scene.definitions import SceneDef
from turnbuckle.scene.validation import given_data, place_text, problems, report
from turnbuckle.scene.yaml_nodes import Node, YamlError, line_of, parse_yaml, plain
from turnbuckle.scene.yaml_writer import write_yaml

LONG_ARRAY = 50  # rows; longer arrays of a saved scene go into a file beside it
MESH_FIELDS = ("mesh", "surface", "sequence")


def read_definition(path: str | os.PathLike[str]) -> SceneDef:
    """The definition in a scene file. Raises `InputError`, one line a problem: `file:line: field: what is wrong`."""
    path = Path(path)
    return parse_definition(read_text(path), path.parent, str(path))


def read_text(path: Path) -> str:
    """The text of a file. Raises `InputError` for what is no text file in UTF-8."""
    shown = str(path)
    try:
        if path.is_dir():
            raise InputError(f"{shown}: is a folder, name the scene file in it")
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{shown}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{shown}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{shown}:{line}: not a text file in UTF-8 (byte {error.start})") from None


def parse_definition(text: str, folder: Path, shown: str = "<text>") -> SceneDef:
    """The definition in a text; meshes and array files are relative to `folder`, `shown` names the text in errors."""
    try:
        root = parse_yaml(text)
    except YamlError as error:
        raise InputError(f"{shown}:{error.line}: {error}") from None
    if root is None or root.value is None:
        raise InputError(f"{shown}:1: the file holds no scene; start with 'bodies:'")
    if not isinstance(root.value, dict):
        raise InputError(f"{shown}:{root.line}: expected the fields of a scene, such as 'bodies:'")
    data = plain(root)
    context = {"folder": folder, "load_array": ArrayFiles(folder).load}
    try:
        return SceneDef.model_validate(data, context=context)
    except ValidationError as error:
        raise InputError(_with_lines(problems(error, SceneDef, data), root, shown)) from None
    except RecursionError:
        raise InputError(f"{shown}:1: nested too deeply") from None


def _with_lines(found: list[tuple[tuple[str | int, ...], str]], root: Node, shown: str) -> str:
    located = sorted(((line_of(root, place), place_text(place), text) for place, text in found), key=lambda p: p[0])
    return report([(f"{shown}:{line}: {place}" if place else f"{shown}:{line}", text) for line, place, text in located])


def write_definition(
    definition: SceneDef,
    folder: Path,
    path: str | os.PathLike[str],
    text_of: Callable[[dict[str, Any]], str] = write_yaml,
) -> None:
    """Write a scene file. Arrays of more than `LONG_ARRAY` rows go into `NAME.arrays.npz` beside it.

    `folder` is what the meshes of the definition are relative to; their paths are rewritten for the new place. Raises
    `InputError` for callables, which a file cannot hold, and where the file cannot be written.
    """
    path = Path(path)
    refuse_callables(definition)
    arrays: dict[str, np.ndarray] = {}
    beside = path.with_name(path.stem + ".arrays.npz")
    data = _file_data(definition, folder, path.parent, beside.name, arrays)
    try:
        if arrays:
            _replace(beside, lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]
        _replace(path, lambda file: file.write(text_of(data).encode("utf-8")))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def _replace(path: Path, write: Any) -> None:
    """Write beside and rename, so that a file is never half written."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as file:
            write(file)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def definition_text(definition: SceneDef, text_of: Callable[[dict[str, Any]], str] = write_yaml) -> str:
    """The YAML text of a definition, all arrays inside. Raises `InputError` for callables."""
    refuse_callables(definition)
    return text_of(_file_data(definition, Path(), Path(), "", None))


def refuse_callables(definition: SceneDef) -> None:
    """Raise `InputError` that names each force and constraint with a Python callable in it."""
    found = []
    for force in definition.forces:
        if force.callable is not None:
            found.append(f"the force {force.name!r} is a Python callable; give an expression")
        if force.pull is not None and callable(force.pull.goal):
            found.append(f"the goal of the force {force.name!r} is a Python callable; give keyframes")
    for constraint in definition.constraints:
        if callable(getattr(constraint, "goal", None)):
            found.append(f"the goal of the constraint {constraint.name!r} is a Python callable; give keyframes")
        if callable(getattr(constraint, "domain", None)):
            found.append(f"the domain of the joint {constraint.name!r} is a Python callable; give a curve or surface")
    for body in definition.bodies:
        if callable(getattr(body, "trajectory", None)):
            found.append(f"the trajectory of the body {body.name!r} is a Python callable; give keyframes")
        if callable(getattr(body, "motion", None)):
            found.append(f"the motion of the obstacle {body.name!r} is a Python callable; give frames or a sequence")
    if found:
        raise InputError("a scene file cannot hold callables: " + ", and ".join(found))


def _file_data(
    definition: SceneDef, old: Path, new: Path, beside: str, arrays: dict[str, np.ndarray] | None
) -> dict[str, Any]:
    """What goes into the file: fields that were given, paths rewritten, long arrays replaced by their place."""
    data = {"schema_version": definition.schema_version, **given_data(definition)}
    move_meshes(data, old, new)
    for kind in ("bodies", "forces", "constraints", "skins"):
        items = data.get(kind, [])
        for i, item in enumerate(items):
            ordered = {key: item[key] for key in ("type", "name") if key in item} | item
            ordered = _single(ordered)
            items[i] = ordered if arrays is None else _shorten(ordered, f"{kind}.{item.get('name', i)}", beside, arrays)
    return data


def move_meshes(data: Any, old: Path, new: Path) -> None:
    """Rewrite the paths of meshes anywhere in nested dicts and lists, from relative to `old` to relative to `new`."""
    if isinstance(data, dict) and old.resolve() != new.resolve():
        for key, value in data.items():
            if key in MESH_FIELDS and isinstance(value, str) and not os.path.isabs(value):
                data[key] = Path(os.path.relpath(old.resolve() / value, new.resolve())).as_posix()
    if isinstance(data, (dict, list)):
        for value in data.values() if isinstance(data, dict) else data:
            move_meshes(value, old, new)


def _single(value: Any, name: str = "") -> Any:
    """`points: {...}` instead of a list of one selection."""
    if isinstance(value, dict):
        return {key: _single(inner, key) for key, inner in value.items()}
    if name in ("points", "join") and isinstance(value, list) and len(value) == 1 and isinstance(value[0], dict):
        return value[0]
    return value


def _shorten(value: Any, key: str, beside: str, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray) and len(value) > LONG_ARRAY:
        arrays[key] = value
        return f"{beside}#{key}"
    if isinstance(value, dict):
        return {name: _shorten(inner, f"{key}.{name}", beside, arrays) for name, inner in value.items()}
    if isinstance(value, list):
        return [_shorten(inner, f"{key}.{i}", beside, arrays) for i, inner in enumerate(value)]
    return value


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a scene file, for editors that complete and check YAML."""
    schema = SceneDef.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "Turnbuckle scene"
    return schema
