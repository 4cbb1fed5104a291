"""The argument SCENE: a scene file, or the name of a ready scene, with `--set` applied."""

import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

import turnbuckle.scenes as ready_scenes
from turnbuckle.data.errors import InputError
from turnbuckle.scene.definitions import SceneDef
from turnbuckle.scene.overrides import SHORT, split_assignment
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.suggestion import did_you_mean


def load_scene(text: str, assignments: Sequence[str] = ()) -> Scene:
    """The scene that the user means. `--set m=40` sets a parameter of a ready scene, else a field of the definition.

    Raises `InputError`.
    """
    ready = ready_scenes.REGISTRY.get(text)
    if ready is not None:
        scene, rest = _ready_scene(text, ready, assignments)
    elif _is_path(text):
        scene, rest = Scene.load(text), list(assignments)
    else:
        raise InputError(f"there is no file and no ready scene {text!r}{did_you_mean(text, ready_scenes.REGISTRY)}")
    for assignment in rest:
        scene.apply_set(assignment)
    return scene


def _is_path(text: str) -> bool:
    path = Path(text)
    if path.suffix.lower() in (".yaml", ".yml", ".json", ".gascuel") or len(path.parts) > 1:
        return True
    try:
        return path.exists()
    except (OSError, ValueError):  # no name that a file could have
        return False


def _ready_scene(name: str, make: Callable[..., Scene], assignments: Sequence[str]) -> tuple[Scene, list[str]]:
    """The ready scene with its parameters, and the assignments that are none of them."""
    parameters = inspect.signature(make, eval_str=True).parameters
    values: dict[str, Any] = {}
    rest = []
    for assignment in assignments:
        path, value = split_assignment(assignment)
        if path in parameters:
            values[path] = _converted(value, parameters[path], name)
        elif path.isidentifier() and path not in SceneDef.model_fields and path not in SHORT:
            known = [*parameters, *SceneDef.model_fields]
            raise InputError(f"--set {assignment}: {name} has no parameter {path!r}{did_you_mean(path, known)}")
        else:
            rest.append(assignment)
    missing = [p.name for p in parameters.values() if p.default is p.empty and p.name not in values]
    if missing:
        raise InputError(f"the scene {name!r} needs --set {missing[0]}=...")
    return make(**values), rest


def _converted(value: Any, parameter: inspect.Parameter, name: str) -> Any:
    """The value as the type that the parameter declares."""
    if parameter.annotation is parameter.empty:
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and parameter.annotation is str:
        value = str(value)
    if isinstance(value, bool) and parameter.annotation in (int, float):
        raise InputError(f"--set {parameter.name}: {name} expects {_type_text(parameter)}, got {str(value).lower()}")
    try:
        return TypeAdapter(parameter.annotation).validate_python(value)
    except ValidationError:
        raise InputError(f"--set {parameter.name}: {name} expects {_type_text(parameter)}, got {value!r}") from None


def _type_text(parameter: inspect.Parameter) -> str:
    words = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}
    return words.get(parameter.annotation, str(parameter.annotation))
