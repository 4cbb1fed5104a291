"""Groups and goals of a checkpoint: as JSON, with their arrays on a `Shelf`."""

import hashlib
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.groups import Goal, Group
from turnbuckle.data.state import State
from turnbuckle.scene.goals import CallableGoal, FixedGoal, KeyframedGoal
from turnbuckle.scene.scene import CONSTRAINTS

PLAIN = ("name", "kind", "enabled", "start", "end", "ramp_steps", "ramp_paper", "ramp_speed", "break_force", "moving",
         "acting", "number", "domain")  # fmt: skip
ARRAYS = ("rows", "offsets", "points", "broken")


class Shelf:
    """Many small arrays in two long ones: of float64 and of int64. A place is ``[which, begin, *shape]``."""

    def __init__(self, arrays: dict[str, np.ndarray] | None = None) -> None:
        self._parts: dict[str, list[np.ndarray]] = {"numbers": [], "integers": []}
        self._used = {"numbers": 0, "integers": 0}
        self._whole = arrays or {}

    def put(self, array: np.ndarray) -> list[Any]:
        """Keep an array; its place."""
        which, kind = ("numbers", np.float64) if array.dtype.kind == "f" else ("integers", np.int64)
        place = [which, self._used[which], *array.shape]
        self._parts[which].append(np.asarray(array, dtype=kind).ravel())
        self._used[which] += array.size
        return place

    def arrays(self) -> dict[str, np.ndarray]:
        """The two arrays to write."""
        kinds = {"numbers": np.float64, "integers": np.int64}
        return {
            f"shelf.{which}": np.concatenate([np.zeros(0, kinds[which]), *parts])
            for which, parts in self._parts.items()
        }

    def get(self, place: list[Any]) -> np.ndarray:
        """The array at a place."""
        which, begin, *shape = place
        size = int(np.prod(shape, dtype=np.int64))
        return self._whole[f"shelf.{which}"][begin : begin + size].reshape(shape).copy()


def pack_groups(state: State, shelf: Shelf) -> list[dict[str, Any]]:
    """All groups in their order. Raises InputError that names one whose goal is a callable the scene does not know."""
    packed = []
    for group in state.groups.values():
        live = group.number > state.scene_groups
        entry = {name: _plain(getattr(group, name)) for name in PLAIN}
        entry |= {name: shelf.put(getattr(group, name)) for name in ARRAYS}
        entry["goal"] = _pack_goal(group, live, shelf)
        entry["definition"] = definition_text(group.definition) if live else definition_digest(group.definition)
        packed.append(entry)
    return packed


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _pack_goal(group: Group, live: bool, shelf: Shelf) -> dict[str, Any] | None:
    goal = group.goal
    if goal is None:
        return None
    if isinstance(goal, FixedGoal):
        return {"type": "fixed", "values": shelf.put(goal.values)}
    if isinstance(goal, KeyframedGoal):
        places = {"times": shelf.put(np.asarray(goal.times, dtype=np.float64)), "values": shelf.put(goal.values)}
        return {"type": "keyframes", "smooth": bool(goal.smooth), **places}
    own = getattr(goal, "function", None)
    if live or own is None or own is not getattr(group.definition, "goal", None):
        raise InputError(
            f"constraint '{group.name}': its goal is a Python callable that the scene does not define, which a "
            "checkpoint cannot hold; give keyframes, or define it in the scene"
        )
    return {"type": "callable"}


def unpack_groups(
    entries: list[dict[str, Any]], shelf: Shelf, fresh: State, scene_groups: int, shown: str
) -> dict[str, Group]:
    """The groups, in their order. ``fresh``: the state as the scene builds it. Raises InputError where they do not fit."""
    numbered = {g.number: g for g in fresh.groups.values() if g.number <= fresh.scene_groups}
    if scene_groups != fresh.scene_groups:
        raise InputError(
            f"checkpoint {shown}: is of another scene (it has {scene_groups} constraints, here are {fresh.scene_groups}); "
            "resume with the scene it was made of"
        )
    groups = {}
    for entry in entries:
        number, name = entry["number"], entry["name"]
        own = numbered.get(number)
        if own is not None and (own.name != name or definition_digest(own.definition) != entry["definition"]):
            raise InputError(
                f"checkpoint {shown}: was made with another definition of the constraint '{own.name}'; "
                "resume with the scene it was made of, and change it in the run"
            )
        arrays = {name: shelf.get(entry[name]) for name in ARRAYS}
        arrays["broken"] = arrays["broken"].astype(bool)
        definition = own.definition if own is not None else _definition(entry)
        goal = _goal(entry, own, shelf, shown)
        groups[name] = Group(**{n: entry[n] for n in PLAIN}, **arrays, goal=goal, definition=definition)
    return groups


def _goal(entry: dict[str, Any], own: Group | None, shelf: Shelf, shown: str) -> Goal | None:
    packed = entry["goal"]
    if packed is None:
        return None
    if packed["type"] == "fixed":
        return FixedGoal(shelf.get(packed["values"]))
    if packed["type"] == "keyframes":
        return KeyframedGoal(shelf.get(packed["times"]), shelf.get(packed["values"]), packed["smooth"])
    if own is None or not isinstance(own.goal, CallableGoal):
        raise InputError(
            f"checkpoint {shown}: the goal of the constraint '{entry['name']}' is a Python callable, which the scene must "
            "define; resume with the scene it was made of"
        )
    return own.goal


# Definitions ----------------------------------------------------------------------------------------------------------


def definition_text(definition: Any, instead: Callable[[Any], Any] | None = None) -> str | None:
    """The definition of a constraint as JSON: what was given, exactly. With ``instead``, which is written for what JSON
    does not know, defaults too.
    """
    if definition is None:
        return None

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        if instead is None:
            raise TypeError(f"no JSON for {type(value).__name__}")
        return instead(value)

    return json.dumps(definition.model_dump(exclude_unset=instead is None), default=plain)


def definition_digest(definition: Any) -> str | None:
    """What tells one definition from another; callables count by their type alone."""
    text = definition_text(definition, instead=lambda value: type(value).__name__)
    return None if text is None else hashlib.sha256(text.encode()).hexdigest()


def _definition(entry: dict[str, Any]) -> Any:
    """What the user wrote for a constraint that was added in the run."""
    if entry["definition"] is None:
        return None
    return CONSTRAINTS[entry["kind"]].model_validate(json.loads(entry["definition"]))
