"""Checkpoints: all of a `State` in one file, so that a run resumed has the bits of one that never stopped.

The file is an .npz: arrays by name (``now.x``, ``rigid.q``, ``nail.phase``, ...) and ``header``, a JSON text with all
single numbers, the groups and joints, and a fingerprint of the model. Every member carries a checksum. It is written beside
its place and renamed, so there is a whole checkpoint at any time. What a checkpoint cannot hold are Python callables: goals
and domains that are callables come back from the scene, by the name of their constraint.
"""

import json
import os
import struct
import tokenize
import zipfile
import zlib
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import JointParts, Loads, RigidState
from turnbuckle.data.state import Kinematics, State
from turnbuckle.data.tables import Domain, Ramp, Table, Tables
from turnbuckle.io.atomic import write_atomically
from turnbuckle.io.checkpoint_groups import Shelf, pack_groups, unpack_groups
from turnbuckle.io.checkpoint_joints import pack_joints, unpack_joints
from turnbuckle.io.fingerprint import difference, fingerprint
from turnbuckle.io.recorder import reason

AnyPath = str | os.PathLike[str]
FORMAT = "turnbuckle checkpoint"
SCHEMA_VERSION = 4
_PLAIN = (Kinematics, RigidState, Loads, JointParts)  # fields of `State` that are arrays by name
_RESIZED = (  # arrays that are as long as the rows, or the contacts, were in the last step
    "impulse", "active", "contact_keys", "contact_impulse", "contact_sliding",
    "contact_yielding",
)  # fmt: skip
_BROKEN_FILE = (
    OSError, ValueError, KeyError, EOFError, TypeError, IndexError, AttributeError, NotImplementedError, RuntimeError,
    OverflowError, MemoryError, SyntaxError, tokenize.TokenError, struct.error, zlib.error, zipfile.BadZipFile,
)  # fmt: skip


def save(path: AnyPath, model: Model, state: State) -> None:
    """Write all of ``state`` to ``path``, whole or not at all.

    Raises InputError that names a constraint added or retargeted in the run whose goal is a Python callable, OSError
    where the file cannot be written.
    """
    header, arrays = _pack(model, state)
    write_atomically(path, lambda file: np.savez(file, header=np.array(header), **arrays))


def load(path: AnyPath, model: Model, state: State) -> None:
    """Make ``state``, as `Scene.build` gave it together with ``model``, the state that was saved.

    What may change in a run (switches, goals, gravity, ...) is then as in the checkpoint. Raises InputError, and
    changes nothing, for a file that is no checkpoint or not whole, or the checkpoint of another scene.
    """
    header, arrays = _read(path, everything=True)
    other = difference(header["model"], fingerprint(model))
    if other:
        raise InputError(f"checkpoint {path}: is of another scene ({other}); resume with the scene it was made of")
    try:
        found = _unpack(header, arrays, model, state, str(path))
    except InputError:
        raise
    except _BROKEN_FILE as error:
        raise InputError(f"checkpoint {path}: is not whole ({reason(error)}); take an older one") from None
    layout = max(state.layout, found["layout"])
    for name, value in found.items():
        setattr(state, name, value)
    state.layout = layout + 1  # launches recorded for other tables must not be replayed


def read_header(path: AnyPath) -> dict[str, Any]:
    """What the checkpoint says of itself: ``time`` [s], ``steps``, ``model``, ... Raises InputError if it is none."""
    header, _ = _read(path, everything=False)
    return {**header["numbers"], **header}


# Packing --------------------------------------------------------------------------------------------------------------


def _pack(model: Model, state: State) -> tuple[str, dict[str, np.ndarray]]:
    """The header and the arrays. Goes through the fields of State, so that none can be forgotten."""
    arrays: dict[str, np.ndarray] = {}
    numbers: dict[str, Any] = {}
    shelf = Shelf()
    for field in fields(State):
        name, value = field.name, getattr(state, field.name)
        if isinstance(value, _PLAIN):
            arrays |= {f"{name}.{f.name}": _array(getattr(value, f.name)) for f in fields(value)}
        elif name == "tables":
            for kind, table in value.by_kind().items():
                arrays |= {f"{kind}.{column}": array.numpy() for column, array in _columns(table).items()}
                numbers[f"{kind}.rows"] = int(table.rows)
        elif name in ("groups", "joints", "domains"):
            pass  # below
        elif isinstance(value, wp.array | np.ndarray):
            arrays[name] = _array(value)
        elif isinstance(value, dict):
            numbers[name] = {key: float(number) for key, number in value.items()}
        else:
            numbers[name] = field.type(value) if field.type in (int, float, bool) else value
    domains = [
        {"name": d.name, "elements": shelf.put(d.elements), "rim": shelf.put(d.rim)} for d in state.tables.domains
    ]
    header = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "model": fingerprint(model),
        "numbers": numbers,
        "domains": domains,
        "groups": pack_groups(state, shelf),
        "joints": pack_joints(state, shelf),
    }
    return json.dumps(header), {**arrays, **shelf.arrays()}


def _array(value: wp.array | np.ndarray) -> np.ndarray:
    return np.asarray(value.numpy() if isinstance(value, wp.array) else value)


def _columns(table: Table) -> dict[str, wp.array]:
    """All arrays of a table by name, those of its ramp as ``ramp.step``, ..."""
    own = {f.name: getattr(table, f.name) for f in fields(table)}
    ramp = {f"ramp.{f.name}": getattr(table.ramp, f.name) for f in fields(Ramp)}
    return {name: value for name, value in {**own, **ramp}.items() if isinstance(value, wp.array)}


# Unpacking ------------------------------------------------------------------------------------------------------------


def _read(path: AnyPath, everything: bool) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays; reading a member checks its checksum."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"checkpoint {path}: there is no such file")
    try:
        with zipfile.ZipFile(path), np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
            if header["format"] != FORMAT:
                raise ValueError("another kind of file")
            version = header["schema_version"]
            if version == SCHEMA_VERSION and everything:
                return header, {name: file[name] for name in file.files if name != "header"}
    except _BROKEN_FILE as error:
        raise InputError(f"checkpoint {path}: is no checkpoint, or not whole ({reason(error)}); take another") from None
    if version != SCHEMA_VERSION:
        raise InputError(
            f"checkpoint {path}: has schema_version {version}, this Turnbuckle reads {SCHEMA_VERSION}; run the scene anew"
        )
    return header, {}


def _unpack(
    header: dict[str, Any], arrays: dict[str, np.ndarray], model: Model, state: State, shown: str
) -> dict[str, Any]:
    """The fields of the state that was saved, made without touching ``state``."""
    numbers, shelf = header["numbers"], Shelf(arrays)
    found: dict[str, Any] = {}
    for field in fields(State):
        name, value = field.name, getattr(state, field.name)
        if isinstance(value, _PLAIN):
            columns = {f.name: (getattr(value, f.name), arrays[f"{name}.{f.name}"]) for f in fields(value)}
            found[name] = type(value)(**{n: _like(old, new, model) for n, (old, new) in columns.items()})
        elif name == "tables":
            domains = [
                Domain(d["name"], shelf.get(d["elements"]).astype(np.int32), shelf.get(d["rim"]).astype(np.int32))
                for d in header["domains"]
            ]
            tables = {kind: _table(kind, table, arrays, numbers, model) for kind, table in value.by_kind().items()}
            found[name] = Tables(**tables, domains=domains)
        elif name == "groups":
            found[name] = unpack_groups(header["groups"], shelf, state, numbers["scene_groups"], shown)
        elif name in ("joints", "domains"):
            pass  # below
        elif name in _RESIZED:
            found[name] = arrays[name].astype(value.dtype)
        elif isinstance(value, wp.array):
            found[name] = _put(value, arrays[name], model)
        elif isinstance(value, np.ndarray):
            found[name] = arrays[name].astype(value.dtype).reshape(value.shape)
        else:
            found[name] = numbers[name]
    found["joints"], found["domains"] = unpack_joints(
        header["joints"], shelf, found["parts"], numbers["scene_parts"], state, shown
    )
    return found


def _like(old: wp.array | np.ndarray, values: np.ndarray, model: Model) -> wp.array | np.ndarray:
    """Values as an array of the same sort as ``old``."""
    if isinstance(old, wp.array):
        return _put(old, values, model)
    if values.dtype != old.dtype or values.shape[1:] != old.shape[1:]:
        raise ValueError(f"an array of {values.dtype} {values.shape} where {old.dtype} {old.shape} is expected")
    return values


def _put(old: wp.array, values: np.ndarray, model: Model) -> wp.array:
    """An array like ``old`` on the device of the model, as long as ``values``."""
    sample = old.numpy()
    if values.dtype != sample.dtype or values.shape[1:] != sample.shape[1:]:
        raise ValueError(f"an array of {values.dtype} {values.shape} where {sample.dtype} {sample.shape} is expected")
    return wp.array(np.ascontiguousarray(values), dtype=old.dtype, device=model.device)


def _table(kind: str, old: Table, arrays: dict[str, np.ndarray], numbers: dict[str, Any], model: Model) -> Table:
    columns = {name: _put(array, arrays[f"{kind}.{name}"], model) for name, array in _columns(old).items()}
    ramp = Ramp(**{f.name: columns.pop(f"ramp.{f.name}") for f in fields(Ramp)})
    return type(old)(rows=numbers[f"{kind}.rows"], ramp=ramp, **columns)
