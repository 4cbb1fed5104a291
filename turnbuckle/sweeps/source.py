"""From values to a scene: parameters of a function, fields of a scene by their path."""

import inspect
import os
from collections.abc import Callable, Mapping
from typing import Any

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene
from turnbuckle.sweeps.values import Values, text_of

Source = Scene | str | os.PathLike[str] | Callable[..., Scene]
Make = Callable[[Values], Scene]


def maker(source: Source, fixed: Mapping[str, Any]) -> tuple[str, Make]:
    """The name of the sweep's scene, and what makes a scene of values. Raises `InputError`.

    ``source``: a `Scene`, the path of a scene file, or a function that returns a `Scene`: values under the name of one of
    its parameters go to it, all others are paths of fields. ``fixed``: values that all runs share.
    """
    if callable(source) and not isinstance(source, Scene):
        return getattr(source, "__name__", "scene"), lambda values: _called(source, {**fixed, **values})
    scene = source if isinstance(source, Scene) else Scene.load(source)
    return scene.name, lambda values: with_fields(scene, {**fixed, **values})


def _called(function: Callable[..., Scene], values: Values) -> Scene:
    known = inspect.signature(function).parameters
    scene = function(**{name: value for name, value in values.items() if name in known})
    if not isinstance(scene, Scene):
        raise InputError(f"sweep: {getattr(function, '__name__', 'the function')} returned no Scene")
    return with_fields(scene, {path: value for path, value in values.items() if path not in known})


def with_fields(scene: Scene, values: Values) -> Scene:
    """The scene with fields changed by their path; the scene given stays as it is. Raises `InputError`."""
    changed = Scene.from_definition(scene.definition, scene.folder)
    for path, value in values.items():
        changed.apply_set(f"{path}={text_of(value)}")
    return changed
