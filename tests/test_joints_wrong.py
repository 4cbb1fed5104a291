"""What is wrong with joints is said with file, line and field where it was written, and by name where it is done live."""

import json
import re
from pathlib import Path

import pytest
from rigid_scene_example import ball, box
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.benchmarks import REGISTRY
from turnbuckle.cli.app import app
from turnbuckle.scene.yaml_file import json_schema

HEAD = """\
name: wrong
bodies:
  - {type: rigid, name: a, box: [1, 1, 1]}
  - {type: rigid, name: wall, box: [1, 1, 1], motion: immobile}
constraints:
  - name: j
    body1: a
    anchor: [0, 0, 0]
"""
AXIS = "    axis: [0, 1, 0]\n"


@pytest.mark.parametrize(
    ("lines", "line", "what"),
    [
        ("type: revolute, axis, lower_limit: 0.5, upper_limit: -0.5", 12, "lower_limit 0.5 is above upper_limit -0.5"),
        ("type: revolute, axis, upper_limit: 90", 11, "a rotation of 90 rad .* outside of -pi to pi; .*angles are in rad"),
        ("type: revolute, axis, lower_limit: -3.2", 11, "a rotation of -3.2 rad"),
        ("type: cone_twist, axis, cone: 0.3, upper_limit: 4", 12, "upper_limit: a rotation of 4 rad"),
        ("type: cone_twist, axis, cone: 0.3, lower_limit: 1, upper_limit: 0", 13, "lower_limit 1 is above upper_limit 0"),
        ("type: prismatic, axis, lower_limit: 2, upper_limit: 1", 12, "lower_limit 2 is above upper_limit 1"),
        ("type: cylindrical, axis, lower_limit: 2, upper_limit: 1", 12, "lower_limit 2 is above upper_limit 1"),
        ("type: distance, min: 2, max: 1", 11, "min 2 is above max 1"),
        ("type: point_to_ring, axis, min: 2, max: 1", 12, "min 2 is above max 1"),
        ("type: revolute, axis, motor: {on: axial; target_velocity: 1}", 11, "revolute .* twist, not axial; write on: twist"),
        ("type: prismatic, axis, motor: {on: twist; target_velocity: 1}", 11, "prismatic .* axial, not twist"),
        ("type: ball, ramp: {steps: 3}", 10, "joints have no ramp; .*assemble"),
    ],
)  # fmt: skip
def test_wrong_joints_name_file_line_and_field(tmp_path: Path, lines: str, line: int, what: str) -> None:
    own = [f"    {part.replace(';', ',')}\n" if part != "axis" else AXIS for part in lines.split(", ")]
    path = tmp_path / "bad.yaml"
    path.write_text(HEAD + "".join(own))
    with pytest.raises(turnbuckle.InputError, match=what) as error:
        turnbuckle.Scene.load(path)
    found = re.search(r"bad\.yaml:(\d+): constraints\[0\]", str(error.value))
    assert found is not None and int(found.group(1)) == line, str(error.value)
    assert "\n" not in str(error.value), "one sentence for one mistake"


def test_half_a_turn_and_equal_limits_are_no_mistake() -> None:
    for limits in (
        {"lower_limit": -3.14159265359, "upper_limit": 3.14159265359},
        {"lower_limit": 0.2, "upper_limit": 0.2},
    ):
        joint = {"type": "revolute", "name": "j", "body1": "a", "anchor": [0, 0, 0], "axis": [0, 1, 0], **limits}
        turnbuckle.Scene("fine", bodies=[box("a", [0, 0, 0])], constraints=[joint]).build()


def test_live_joints_name_the_body_that_is_wrong() -> None:
    bodies = [box("arm", [0, 0, 0]), box("wall", [1, 0, 0], motion="immobile")]
    bodies += [{"type": "rope", "name": "r", "start": [0, 2, 0], "end": [1, 2, 0], "segments": 3}]
    simulation = turnbuckle.Simulation(turnbuckle.Scene("s", dt=1e-3, bodies=bodies))
    for name, what in (
        ("amr", "joint 'j': there is no body 'amr', did you mean 'arm'?"),
        ("r", "joint 'j': 'r' is no rigid body; joints join rigid bodies"),
        ("wall", "joint 'j': neither of its bodies is dynamic"),
    ):
        with pytest.raises(turnbuckle.InputError, match=re.escape(what)):
            simulation.add_constraint(**ball("j", None, name, [0, 0, 0]))
    assert simulation.state.joints == {}
    assert simulation.step().status == "ok"


def test_a_push_pushes() -> None:
    simulation = turnbuckle.Simulation(turnbuckle.Scene("s", dt=1e-3, gravity=[0, 0, 0], bodies=[box("a", [0, 0, 0])]))
    with pytest.raises(turnbuckle.InputError, match="push 'a': give a force or a torque"):
        simulation.push("a")
    with pytest.raises(turnbuckle.InputError, match="push 'a': 'at' is where a force acts"):
        simulation.push("a", torque=[1, 0, 0], at=[0, 0, 1])
    simulation.push("a", force=[2.0, 0, 0])
    simulation.run(0.1)
    simulation.push("a", force=[0, 0, 0])
    simulation.run(0.1)
    assert simulation.velocity("a")[0] == pytest.approx([0.2, 0, 0], rel=1e-12)


def test_the_schema_offers_no_ramp_for_joints() -> None:
    definitions = json_schema()["$defs"]
    assert "ramp" in definitions["NailDef"]["properties"]
    for name in ("JointDef", "BallDef", "RevoluteDef", "RollingDef"):
        assert "ramp" not in definitions[name]["properties"] and "anchor" in definitions[name]["properties"], name
    assert "SkipJsonSchema" not in json.dumps(definitions)


def test_the_help_names_what_there_is() -> None:
    def said(verb: str) -> str:
        shown = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
        assert shown.exit_code == 0
        return " ".join(re.sub(r"\x1b\[[0-9;]*m|[│╭╮╰╯─]", " ", shown.output).split())

    assert all(suffix in said("run") for suffix in (".npz", ".vtkhdf", ".usdc", ".png", ".gif", ".mp4"))
    assert all(name in said("bench") for name in REGISTRY)
