"""A small scene in which everything that a checkpoint must hold goes on at once, and its state as bits.

At step 60 of 1 ms: `late` is in the middle of its ramp, `weak` has broken, `first` has been switched off by its window
and `second` on, `pulled` follows a callable, `moved` keyframes, `bead` slides on a net, wind blows.
"""

import hashlib
from dataclasses import fields

import numpy as np
import warp as wp

import turnbuckle

DT = 1e-3
MIDDLE = 60  # steps


def spiral(t: float) -> np.ndarray:
    return np.array([0.2 * np.sin(9.0 * t), 0.1 * t, 0.0])


def rope(name: str, y: float, **more: object) -> dict:
    springs = {"stretch_stiffness": 300.0, "bend_stiffness": 1.0, "damping": 0.02}
    return {
        "type": "rope",
        "name": name,
        "start": [0, y, 0],
        "end": [1, y, 0],
        "segments": 12,
        "mass": 0.5,
        **springs,
        **more,
    }


def nail(name: str, body: str, index: int, **more: object) -> dict:
    return {"type": "nail", "name": name, "points": [{"body": body, "index": index}], **more}


def scene(integrator: str, cells: int = 6, **more: object) -> turnbuckle.Scene:
    net = {"type": "net", "name": "net", "size": [1, 1], "cells": [cells, cells], "position": [0.5, -1.5, 0.0]}
    net |= {"damping": 0.05, "mass": cells * cells / 36}
    block = {"type": "solid", "name": "block", "box": {"size": [0.3, 0.3, 0.3], "cells": [1, 1, 1]}, "mass": 1.0}
    block |= {"k_distance": 5.0, "k_volume": 5.0, "damping_distance": 0.01, "position": [2, 0, 0]}
    frames = {"times": [0.0, 0.05, 0.2], "offsets": [[0, 0, 0], [0, 0, 0.05], [0, 0.1, 0]], "interpolation": "smooth"}
    corner = {"body": "block", "elements": [[0, 1, 2]]}
    fields = {"dt": DT, "duration": 0.12, "integrator": integrator, **more}
    return turnbuckle.Scene(
        "everything",
        **fields,
        bodies=[rope("a", 0.0), rope("b", 0.5), rope("c", 1.0, velocity=[0, 0, 1.0]), net, block],
        forces=[{"name": "wind", "body": "a", "expression": ["0.3 * sin(40 * t)", "-0.1 * vy", 0]}],
        constraints=[
            nail("pulled", "a", 0, goal=spiral),
            nail("moved", "b", 0, goal=frames),
            nail("late", "b", 6, goal=[0.5, 0.6, 0.1], start=0.03, ramp={"steps": 60, "max_speed": 50.0}),
            nail("weak", "c", 0, break_force=3.0),
            nail("first", "c", 12, end=0.04),
            nail("second", "a", 12, start=0.04, goal=[1.0, 0.0, 0.0], ramp={"steps": 8, "mode": "paper"}),
            {
                "type": "points_to_point",
                "name": "joint",
                "groups": [[{"body": "a", "index": 6}, {"body": "b", "index": 3}]],
                "start": 0.02,
                "ramp": {"steps": 70},
            },
            {"type": "attach", "name": "hook", "points": [{"body": "c", "index": 6}], "to": corner},
            {
                "type": "slide",
                "name": "bead",
                "points": [{"body": "b", "index": 12}],
                "on": {"body": "net", "lines": [[0, 1], [1, 2]]},
                "ramp": {"steps": 40},
                "start": 0.03,
            },
            {"type": "velocity", "name": "winch", "points": [{"body": "net", "index": 10}], "goal": [0, 0, 0.3]},
        ],
    )


def digest(state: turnbuckle.State) -> dict[str, str]:
    """Every number of a state by name: arrays by their SHA-256, the rest as text."""
    found: dict[str, object] = {}
    for name in ("time", "steps", "dt", "stale", "work", "dissipation", "dissipation_power", "energies", "activated"):
        found[name] = getattr(state, name)
    parts = {"now": state.now, **state.tables.by_kind()}
    parts |= {f"{kind}.ramp": table.ramp for kind, table in state.tables.by_kind().items()}
    for part, columns in parts.items():
        for field in fields(columns):
            found[f"{part}.{field.name}"] = getattr(columns, field.name)
    for name in ("owner", "domain_use", "nailed", "external", "gravity"):
        found[name] = getattr(state, name)
    for name, group in state.groups.items():
        found[name] = [
            group.enabled,
            group.acting,
            group.broken.tolist(),
            group.points.tolist(),
            group.number,
            group.moving,
        ]
    return {name: _text(value) for name, value in found.items() if not name.endswith(".ramp")}


def _text(value: object) -> str:
    if isinstance(value, wp.array):
        value = value.numpy()
    if isinstance(value, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(value)).hexdigest()
    if isinstance(value, dict):
        value = {key: float(number) for key, number in value.items()}
    return repr(float(value)) if isinstance(value, float) else repr(value)
