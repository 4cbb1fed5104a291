"""A scene in which all that a checkpoint must hold of rigid bodies and joints goes on at once, and a state as bits.

At step 60 of 1 ms: `weak` has broken, `first` has been switched off by its window and `second` on, `knee` is at its limit,
`spin` turns too far in a step, which is halved, motors drive, springs swing, points of bodies are tied to soft ones.
"""

import hashlib
from dataclasses import fields, is_dataclass

import numpy as np
import warp as wp

import turnbuckle

DT = 1e-3
MIDDLE = 60  # steps


def box(name: str, position: list, **more: object) -> dict:
    return {"type": "rigid", "name": name, "box": [0.2, 0.1, 0.06], "mass": 1.0, "position": position, **more}


def ball(name: str, body0: str | None, body1: str, anchor: list, **more: object) -> dict:
    ends = {"body1": body1} if body0 is None else {"body0": body0, "body1": body1}
    return {"type": "ball", "name": name, **ends, "anchor": anchor, **more}


def swing(t: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array([0.3 * np.sin(5.0 * t), 6.0, 0.0]), np.array([0.0, 0.0, 2.0 * t])


def bowl(p: np.ndarray) -> np.ndarray:
    """The nearest point of a sphere of 0.5 m."""
    return 0.5 * p / np.linalg.norm(p)


def chain(n: int, **more: object) -> turnbuckle.Scene:
    """A chain of boxes that hangs by its first end."""
    bodies = [box(f"b{i}", [0.2 * i + 0.1, 0, 0], angular_velocity=[0.1 * i, 0, 0]) for i in range(n)]
    joints = [ball(f"j{i}", f"b{i - 1}" if i else None, f"b{i}", [0.2 * i, 0, 0]) for i in range(n)]
    return turnbuckle.Scene("chain", **{"dt": DT, "duration": 0.1, **more}, bodies=bodies, constraints=joints)


def mechanisms(**more: object) -> turnbuckle.Scene:
    """Joints of all sorts, each in its own place."""
    keys = {"times": [0.0, 0.05, 0.2], "positions": [[0, 5, 0], [0, 5, 0.05], [0, 5.1, 0]], "interpolation": "smooth"}
    rest = {"gravity": [0, 0, -9.81], "dt": DT, "duration": 0.12, "max_rotation": 0.3}
    push = {"on": "axial", "target_position": 0.1, "max_force": 30.0, "time_constant": 0.02}
    bodies = [
        box("thigh", [0.1, 0, 0]),
        box("shin", [0.3, 0, 0], angular_velocity=[0, -12, 0], velocity=[0, 0, 1.2]),
        box("rotor", [0.1, 1, 0], linear_damping=0.3, angular_damping=0.2),
        box("slider", [0, 2, 0]),
        box("sprung", [0.3, 3, 0], velocity=[0, 0.5, 0]),
        box("arm", [0.1, 4, 0], angular_velocity=[0, 0, 3.0]),
        box("crane", [0, 5, 0], trajectory=keys),
        box("load", [0, 5, -0.3]),
        box("script", [0, 6, 0], trajectory=swing),
        box("hung", [0, 6, -0.3]),
        box("spin", [0, 7, 0], angular_velocity=[350, 2, 1]),
        box("rail", [0, 8, 0], velocity=[1.0, 0.3, 0]),
        box("dish", [0, 9, -0.5], velocity=[0.5, 0, 0]),
        {"type": "rigid", "name": "wheel", "sphere": 0.1, "mass": 1.0, "position": [0, 10, 0.1], "velocity": [0.4, 0, 0],
         "angular_velocity": [0, 4.0, 0]},
        box("falling", [0, 11, 0]),
        box("handed", [0, 12, 0]),
    ]  # fmt: skip
    constraints = [
        {"type": "revolute", "name": "hip", "body1": "thigh", "anchor": [0, 0, 0], "axis": [0, 1, 0],
         "motor": {"on": "twist", "target_velocity": 2.0, "max_force": 5.0}},
        {"type": "revolute", "name": "knee", "body0": "thigh", "body1": "shin", "anchor": [0.2, 0, 0], "axis": [0, 1, 0],
         "lower_limit": -0.2, "upper_limit": 0.4, "restitution": 0.2},
        {"type": "revolute", "name": "drive", "body1": "rotor", "anchor": [0, 1, 0], "axis": [1, 0, 0],
         "motor": {"on": "twist", "target_position": 0.7, "time_constant": 0.03}},
        {"type": "prismatic", "name": "slot", "body1": "slider", "anchor": [0, 2, 0], "axis": [1, 0, 0],
         "lower_limit": -0.05, "upper_limit": 0.3, "motor": push},
        {"type": "distance", "name": "spring", "body1": "sprung", "local_pos0": [0, 3, 0], "local_pos1": [-0.1, 0, 0],
         "min": 0.1, "max": 0.15, "stiffness": 400.0, "damping": 2.0},
        {"type": "cone_twist", "name": "shoulder", "body1": "arm", "anchor": [0, 4, 0], "axis": [1, 0, 0], "cone": 0.1,
         "lower_limit": -0.1, "upper_limit": 0.1},
        ball("rope", "crane", "load", [0, 5, -0.15]),
        ball("cord", "script", "hung", [0, 6, -0.15]),
        {"type": "joint", "name": "bead", "body1": "rail", "local_pos0": [0, 8, 0], "local_pos1": [0, 0, 0],
         "curve": {"points": [[-1, 0, 0.1], [0, 0, 0], [1, 0.3, 0], [2, 0, 0.2]], "interpolation": "spline"}},
        {"type": "joint", "name": "inside", "body1": "dish", "local_pos0": [0, 9, 0], "local_pos1": [0, 0, 0],
         "domain": bowl},
        {"type": "rolling", "name": "roll", "body1": "wheel", "local_pos0": [0, 10, 0], "local_pos1": [0, 0, 0],
         "normal": [0, 0, 1], "radius": 0.1},
        ball("weak", None, "falling", [0, 11, 0.05], break_force=1.0, start=0.01),
        ball("first", None, "handed", [0.1, 12, 0], end=0.04),
        {"type": "weld", "name": "second", "body1": "handed", "anchor": [0.1, 12, 0], "start": 0.04, "enabled": True},
    ]  # fmt: skip
    return turnbuckle.Scene(
        "mechanisms",
        **{**rest, **more},
        bodies=bodies,
        forces=[
            {"name": "wind", "body": "slider", "expression": ["0.3 * sin(40 * t)", "0", 0], "torque": ["0.1", 0, 0]}
        ],
        constraints=constraints,
    )


def mixed(**more: object) -> turnbuckle.Scene:
    """Soft bodies tied to rigid ones, two-way, with points that are led."""
    rope = {"type": "rope", "name": "rope", "start": [0.1, 0, 0], "end": [1.1, 0, 0], "segments": 6, "mass": 0.5}
    rope |= {"stretch_stiffness": 300.0, "damping": 0.02}
    block = {"type": "solid", "name": "block", "box": {"size": [0.3, 0.3, 0.3], "cells": [1, 1, 1]}, "mass": 1.0}
    block |= {"k_distance": 5.0, "k_volume": 5.0, "position": [1.35, 0, 0]}
    marks = {"markers": [[0.1, 0, 0], [-0.1, 0, 0], [0, 0.05, 0.03]]}
    frames = {"times": [0.0, 0.05, 0.2], "offsets": [[0, 0, 0], [0, 0, 0.05], [0, 0.1, 0]], "interpolation": "smooth"}
    bodies = [
        box("a", [0, 0, 0], **marks), box("b", [0, 1, 0], **marks, angular_velocity=[3, 0, 1]), rope, block,
        box("c", [1.45, 0.05, -0.03], **marks),
    ]  # fmt: skip
    constraints = [
        {"type": "points_to_point", "name": "tie", "groups": [[{"body": "a", "index": 0}, {"body": "rope", "index": 0}]]},
        {"type": "nail", "name": "led", "points": [{"body": "a", "index": 1}], "goal": frames},
        {"type": "nail", "name": "pin", "points": [{"body": "b", "index": 2}]},
        {"type": "attach", "name": "held", "points": [{"body": "c", "index": 2}],
         "to": {"body": "block", "elements": [[0, 1, 2]]}},
        {"type": "nail", "name": "corner", "points": [{"body": "block", "index": 7}]},
        ball("link", "a", "b", [0, 0.5, 0]),
    ]  # fmt: skip
    return turnbuckle.Scene("mixed", **{"dt": DT, "duration": 0.1, **more}, bodies=bodies, constraints=constraints)


SCENES = {"chain": lambda: chain(8), "mechanisms": mechanisms, "mixed": mixed}


def bits(value: object, name: str = "") -> dict[str, str]:
    """Every number of a state by name: arrays by their SHA-256, the rest as text. Objects of the user do not count."""
    if is_dataclass(value) and not isinstance(value, type):
        skip = ("definition", "goal", "layout")
        parts = {f.name: getattr(value, f.name) for f in fields(value) if f.name not in skip}
    elif isinstance(value, dict):
        parts = value
    elif isinstance(value, list):
        parts = {str(i): item for i, item in enumerate(value)}
    else:
        if isinstance(value, wp.array):
            value = value.numpy()
        if isinstance(value, np.ndarray):
            return {name: f"{value.shape} {hashlib.sha256(np.ascontiguousarray(value)).hexdigest()}"}
        if isinstance(value, float | np.floating):
            return {name: float(value).hex()}
        return {name: repr(value) if isinstance(value, str | int | bool | None) else type(value).__name__}
    return {key: text for part, inner in parts.items() for key, text in bits(inner, f"{name}.{part}").items()}
