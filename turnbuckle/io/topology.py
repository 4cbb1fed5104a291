"""Shapes as flat arrays and one JSON text, for the formats that keep the whole run."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnbuckle.data.shape import Shape, Skin

SCHEMA_VERSION = 1
_PLAIN = ("lines", "triangles", "tetrahedra")
_SKIN = ("points", "weights", "triangles")


def pack(shapes: list[Shape], info: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], str]:
    """Arrays by name (``shape0_lines``, ``shape0_skin_weights``, ...) and everything else as JSON."""
    arrays: dict[str, np.ndarray] = {}
    described = []
    for number, shape in enumerate(shapes):
        for name in _PLAIN:
            arrays[f"shape{number}_{name}"] = getattr(shape, name)
        if shape.skin is not None:
            for name in _SKIN:
                arrays[f"shape{number}_skin_{name}"] = getattr(shape.skin, name)
        if shape.local is not None:
            arrays[f"shape{number}_local"] = shape.local
        described.append(
            {
                "name": shape.name,
                "begin": int(shape.begin),
                "end": int(shape.end),
                "color": None if shape.color is None else [float(c) for c in shape.color],
                "skin": shape.skin is not None,
                "rigid": shape.local is not None,
                "still": shape.still,
                "drawn": shape.drawn,
            }
        )
    return arrays, json.dumps({"schema_version": SCHEMA_VERSION, **info, "shapes": described}, default=_plain_value)


def unpack(arrays: Mapping[str, np.ndarray], text: str) -> tuple[list[Shape], dict[str, Any]]:
    """The inverse of `pack`. Raises KeyError or ValueError for what is no recording."""
    info = json.loads(text)
    shapes = []
    for number, one in enumerate(info.pop("shapes")):
        skin = None
        if one["skin"]:
            skin = Skin(**{name: np.asarray(arrays[f"shape{number}_skin_{name}"]) for name in _SKIN})
        plain = {name: np.asarray(arrays[f"shape{number}_{name}"]) for name in _PLAIN}
        color = None if one["color"] is None else tuple(one["color"])
        local = np.asarray(arrays[f"shape{number}_local"]) if one.get("rigid") else None
        more = {"skin": skin, "color": color, "local": local, "still": bool(one.get("still", False))}
        shapes.append(Shape(one["name"], one["begin"], one["end"], **plain, **more, drawn=bool(one.get("drawn", True))))
    return shapes, info


def _plain_value(value: object) -> object:
    """What JSON does not know: NumPy's numbers and arrays, and anything else by its text."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value)
