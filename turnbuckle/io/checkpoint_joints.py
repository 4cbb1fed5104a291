"""Joints and their domains in a checkpoint: as JSON, with their arrays on a `Shelf`.

The parts of joints (`State.parts`) are plain columns, those of the scene first; parts of removed joints stay among them.
Here is what goes with them: which joint they belong to, its switches and definition, and the curves and surfaces they lie
on. Python callables come back from the scene.
"""

import json
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.rigid import Joint, JointParts
from turnbuckle.data.state import State
from turnbuckle.geometry.curve_domain import Curve
from turnbuckle.geometry.domains import Domain, Point
from turnbuckle.geometry.surface_domain import Surface
from turnbuckle.io.checkpoint_groups import Shelf, definition_digest, definition_text
from turnbuckle.scene.definitions import JOINTS

PLAIN = ("name", "kind", "a", "b", "enabled", "start", "end", "break_force", "break_torque", "mu", "alpha", "acting",
         "broken", "live")  # fmt: skip


def pack_joints(state: State, shelf: Shelf) -> dict[str, Any]:
    """All joints in their order, and all domains. Raises InputError that names a joint with a callable of its own."""
    joints = []
    for joint in state.joints.values():
        entry = {name: _plain(getattr(joint, name)) for name in PLAIN}
        entry["parts"] = shelf.put(joint.parts)
        entry["definition"] = _live_text(joint) if joint.live else definition_digest(joint.definition)
        joints.append(entry)
    known = scene_domains(state.parts, state.scene_parts)
    return {"joints": joints, "domains": [_pack_domain(d, i < known, shelf) for i, d in enumerate(state.domains)]}


def unpack_joints(
    packed: dict[str, Any], shelf: Shelf, parts: JointParts, scene_parts: int, fresh: State, shown: str
) -> tuple[dict[str, Joint], list[Domain]]:
    """The joints in their order, and their domains.

    ``parts``: those of the checkpoint; ``fresh``: the state as the scene builds it. Raises InputError where they do not fit.
    """
    for entry in packed["joints"]:
        own = fresh.joints.get(entry["name"])
        if not entry["live"] and (own is None or definition_digest(own.definition) != entry["definition"]):
            raise InputError(
                f"checkpoint {shown}: was made with another definition of the joint '{entry['name']}'; "
                "resume with the scene it was made of, and change it in the run"
            )
    if scene_parts != fresh.scene_parts or any(
        not np.array_equal(getattr(parts, name)[:scene_parts], getattr(fresh.parts, name))
        for name in ("kind", "a", "b")
    ):
        raise InputError(
            f"checkpoint {shown}: is of another scene (its joints differ); resume with the scene it was made of"
        )
    joints = {}
    for entry in packed["joints"]:
        name = entry["name"]
        definition: object
        if entry["live"]:
            definition = JOINTS[entry["kind"]].model_validate(json.loads(entry["definition"]))
        else:
            definition = fresh.joints[name].definition
        joints[name] = Joint(
            **{n: entry[n] for n in PLAIN}, parts=shelf.get(entry["parts"]).astype(np.int64), definition=definition
        )
    domains = [_unpack_domain(d, fresh.domains[i : i + 1], shelf) for i, d in enumerate(packed["domains"])]
    return joints, domains


def scene_domains(parts: JointParts, scene_parts: int) -> int:
    """How many domains are those of joints that the scene defines; they come first."""
    return int(parts.domain[:scene_parts].max(initial=-1)) + 1


def _live_text(joint: Joint) -> str | None:
    try:
        return definition_text(joint.definition)
    except TypeError:
        raise InputError(
            f"joint '{joint.name}': its domain is a Python callable that the scene does not define, which a checkpoint "
            "cannot hold; give a curve or surface, or define it in the scene"
        ) from None


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _pack_domain(domain: Domain, known: bool, shelf: Shelf) -> dict[str, Any]:
    """``known``: the scene defines it, so that it need not be written."""
    if known:
        return {"type": "scene"}
    if isinstance(domain, Curve):
        points = domain.points[:-1] if domain.closed else domain.points
        return {
            "type": "curve", "points": shelf.put(points), "closed": domain.closed, "spline": domain.spline is not None,
        }  # fmt: skip
    if isinstance(domain, Surface):
        return {"type": "surface", "vertices": shelf.put(domain.vertices), "triangles": shelf.put(domain.triangles)}
    return {"type": "gone"}  # a callable, of a joint that was removed: nothing asks for it any more


def _unpack_domain(packed: dict[str, Any], own: list[Domain], shelf: Shelf) -> Domain:
    if packed["type"] == "scene":
        return own[0]
    if packed["type"] == "curve":
        return Curve(shelf.get(packed["points"]), closed=packed["closed"], spline=packed["spline"])
    if packed["type"] == "surface":
        return Surface(shelf.get(packed["vertices"]), shelf.get(packed["triangles"]))
    return Point()
