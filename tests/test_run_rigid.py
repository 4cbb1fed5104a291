"""Whole runs of rigid bodies, alone and with soft ones: recordings, report, certificate; overrides; the schema."""

import json
from pathlib import Path

import numpy as np
import pytest
from rigid_scene_example import box, chain, mechanisms, mixed
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.io import read_recording
from turnbuckle.scene.check import check


@pytest.mark.parametrize("make", [chain, mixed], ids=["rigid", "mixed"])
def test_all_recordings_of_a_run(make, tmp_path: Path) -> None:
    scene = make(3, duration=0.03) if make is chain else make(duration=0.03)
    names = ("a.npz", "a.vtkhdf", "a.usdc", "a.png", "a.gif")
    seen = []
    result = turnbuckle.run_scene(
        scene, out=[tmp_path / n for n in names], report=tmp_path / "a.json", checkpoint=tmp_path / "a.ckpt",
        progress=lambda *given: seen.append(given), stop=lambda simulation, report: seen.append(simulation),
    )  # fmt: skip
    assert result.status == "done" and result.degraded_steps == 0
    assert {Path(p).name for p in result.outputs} == {*names, "a.ckpt"}
    assert all((tmp_path / n).stat().st_size > 500 for n in names)
    simulation = seen[-1]
    for name in ("a.npz", "a.vtkhdf"):
        recording = read_recording(tmp_path / name)
        assert recording.x(len(recording) - 1) == pytest.approx(simulation.positions(), abs=1e-5)
    assert seen[-2][:3] == (pytest.approx(0.03), 0.03, 30) and 0.0 <= seen[-2][3] < 1e-10


def test_report_of_a_run(tmp_path: Path) -> None:
    result = turnbuckle.run_scene(mechanisms(duration=0.05), report=tmp_path / "a.json")
    report = json.loads((tmp_path / "a.json").read_text())
    assert report["counts"]["rigid_bodies"] == 16 and report["counts"]["joints"] == 14
    for kinds in (report["worst_residual"], report["worst_rate_residual"]):
        assert 0.0 <= kinds["joint"] < 1e-10 and 0.0 <= kinds["joint_rotation"] < 1e-10
    assert report["halvings"] == 50, "the spinning body turns by 0.35 rad in a step of 1 ms, 0.3 are allowed"
    histogram = report["iterations"]["equality"]
    assert sum(histogram.values()) == report["steps"] == 50 and all(int(n) >= 0 for n in histogram)
    assert any("broke: weak" in text for text in report["messages"])
    text = result.certificate()
    assert "16 rigid bodies, 14 joints" in text and "rad/s" in text and "equality:" in text
    assert "50 times a step was taken in two halves" in text
    soft = turnbuckle.Scene("soft", duration=0.002, bodies=[
        {"type": "rope", "name": "r", "start": [0, 0, 0], "end": [1, 0, 0], "segments": 4, "mass": 0.5}])  # fmt: skip
    result = turnbuckle.run_scene(soft)
    assert "rigid_bodies" not in result.counts and "rigid" not in result.certificate() and result.halvings == 0


def test_the_command(tmp_path: Path) -> None:
    chain(3).save(tmp_path / "chain.yaml")
    shown = CliRunner().invoke(
        app, ["check", str(tmp_path / "chain.yaml"), "--set", "constraints.j1.local_pos0=[0.1,0,0]"]
    )
    assert shown.exit_code == 2 and "anchor" in shown.output
    shown = CliRunner().invoke(app, ["check", str(tmp_path / "chain.yaml"), "--set", "bodies.b0.position=[0.1,0,0.2]"])
    assert shown.exit_code == 0, shown.output
    assert "degrees of freedom" in shown.output and "rigid bodies                 3 (3 dynamic)" in shown.output
    shown = CliRunner().invoke(
        app, ["run", str(tmp_path / "chain.yaml"), "--set", "bodies.b0.mass=4", "--set", "duration=0.005",
              "--report", str(tmp_path / "r.json")]
    )  # fmt: skip
    assert shown.exit_code == 0, shown.output
    assert "3 rigid bodies, 3 joints" in shown.output


def test_set_changes_bodies_and_joints() -> None:
    scene = mechanisms()
    for assignment in (
        "bodies.thigh.mass=2", "bodies.thigh.angular_damping=0.5", "bodies.crane.trajectory.interpolation=linear",
        "constraints.hip.axis=[0, 0, 1]", "constraints.knee.upper_limit=0.6", "constraints.hip.motor.target_velocity=-1",
        "constraints.bead.curve.points[1]=[0, 0.01, 0]", "constraints.weak.break_force=5", "forces.wind.at=[0, 0, 0.1]",
        "solver=displacement", "displacement.scheme=1", "max_rotation=0.2", "rigid_motion=paper",
    ):  # fmt: skip
        scene.apply_set(assignment)
    definition = scene.definition
    bodies = {b.name: b for b in definition.bodies}
    joints = {c.name: c for c in definition.constraints}
    assert bodies["thigh"].mass == 2.0 and bodies["thigh"].angular_damping == 0.5
    assert bodies["crane"].trajectory.interpolation == "linear"
    assert np.array_equal(joints["hip"].axis, [0, 0, 1]) and joints["hip"].motor.target_velocity == -1.0
    assert joints["knee"].upper_limit == 0.6 and joints["weak"].break_force == 5.0
    assert joints["bead"].curve.points[1].tolist() == [0, 0.01, 0]
    assert definition.forces[0].at.tolist() == [0, 0, 0.1]
    assert (definition.solver, definition.displacement.scheme, definition.max_rotation) == ("displacement", 1, 0.2)
    for assignment, words in [
        ("bodies.thigh.mass=-1", "bodies.thigh.mass.*greater than 0"),
        ("constraints.hip.axis=[0, 0, 0]", "constraints.*axis.*zero"),
        ("constraints.hip.axle=1", "axle.*unknown field"),
        ("constraints.hep.axis=[0,0,1]", "'hep'.*hip"),
        ("constraints.hip.body1=thing", "'thing'"),
    ]:
        with pytest.raises(turnbuckle.InputError, match=words):
            scene.apply_set(assignment)
    assert scene.definition is definition


def test_set_of_a_mass_is_what_is_simulated() -> None:
    scene = turnbuckle.Scene("one", bodies=[box("b", [0, 0, 0])])
    scene.apply_set("bodies.b.mass=2.5")
    model, _ = scene.build()
    assert model.rigid.mass[1] == 2.5


def test_the_schema_knows_rigid_bodies_and_joints() -> None:
    schema = json.loads(CliRunner().invoke(app, ["schema"]).output)
    text = json.dumps(schema)
    names = schema["$defs"]
    for name in (
        "RigidDef",
        "JointDef",
        "RevoluteDef",
        "RollingDef",
        "MotorDef",
        "TrajectoryDef",
        "CurveDef",
        "CoatingDef",
    ):
        assert name in names, name
        for field, value in names[name]["properties"].items():
            assert field == "type" or value.get("description"), f"{name}.{field}"
    assert "callable" not in text.lower() or "Python" in text
    assert names["RevoluteDef"]["properties"]["type"]["const"] == "revolute"
    assert "solver" in schema["properties"] and "max_rotation" in schema["properties"]


def test_joints_that_start_open_are_told_with_the_way_out() -> None:
    ends = {"local_pos0": [0.1, 0, 0], "local_pos1": [-0.1, 0, 0]}
    joint = {"type": "ball", "name": "gap", "body0": "a", "body1": "b", **ends}
    bodies = [box("a", [0, 0, 0]), box("b", [0.2, 0, 0.02])]
    scene = turnbuckle.Scene("open", dt=1e-3, duration=0.002, bodies=bodies, constraints=[joint])
    result = turnbuckle.run_scene(scene)
    assert result.messages == check(scene)
    assert "'gap' by 0.02 m" in result.messages[0] and "turnbuckle assemble" in result.messages[0]
    assert result.messages[0] in result.certificate()
    assert turnbuckle.run_scene(chain(2, duration=0.002)).messages == []
