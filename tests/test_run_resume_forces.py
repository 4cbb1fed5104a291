"""A checkpoint of a scene with other forces, limits or motors is refused."""

from pathlib import Path

import pytest
from rigid_scene_example import box

import turnbuckle


def scene(limit: float = 0.4, speed: float = 1.0, push: str = "0.1", turn: str = "0.2", wind: str = "0.3"):
    bodies = [box("a", [0, 0, 0]), {"type": "rope", "name": "r", "start": [0, 2, 0], "end": [1, 2, 0], "segments": 3}]
    hinge = {"type": "revolute", "name": "hinge", "body1": "a", "anchor": [0, 0, 0], "axis": [0, 1, 0]}
    hinge |= {"lower_limit": -limit, "upper_limit": limit, "motor": {"on": "twist", "target_velocity": speed}}
    forces = [
        {"name": "push", "body": "a", "expression": [push, 0, 0], "torque": [turn, 0, 0]},
        {"name": "wind", "body": "r", "expression": [wind, 0, "z * t"]},
    ]
    return turnbuckle.Scene("s", dt=1e-3, duration=0.005, bodies=bodies, constraints=[hinge], forces=forces)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"limit": 0.5}, "another definition of the joint 'hinge'"),
        ({"speed": 2.0}, "another definition of the joint 'hinge'"),
        ({"push": "0.2"}, "expressions of forces and torques on rigid bodies.*0.1.*here.*0.2"),
        ({"turn": "t"}, "expressions of forces and torques on rigid bodies.*0.2.*here.*'t'"),
        ({"wind": "0.3 * t"}, "expressions of forces: .*0.3.*here.*0.3 . t"),
    ],
)
def test_a_changed_scene_is_refused(tmp_path: Path, change: dict[str, object], what: str) -> None:
    saved = tmp_path / "a.ckpt"
    turnbuckle.run_scene(scene(), checkpoint=saved)
    with pytest.raises(turnbuckle.InputError, match=what):
        turnbuckle.run_scene(scene(**change), resume=saved, duration=0.01)
    assert turnbuckle.run_scene(scene(), resume=saved, duration=0.01).status == "done"
