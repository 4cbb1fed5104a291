"""URDF: poses, masses and limits of a robot, what is part of what, and what has no counterpart."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.data.errors import InputError

INERTIAL = '<inertial><origin xyz="0 0 .25" rpy="0 .1 0"/><mass value="1"/><inertia ixx=".02" iyy=".02" izz=".002"/></inertial>'
ROBOT = f"""<robot name="arm"><link name="world"/>
<link name="base"><collision><geometry><cylinder radius=".1" length=".2"/></geometry></collision></link>
<link name="upper">{INERTIAL}<visual><origin xyz="0 0 .25"/><geometry><box size=".05 .05 .5"/></geometry></visual></link>
<link name="lower">{INERTIAL}</link>
<link name="tool"><visual><geometry><sphere radius=".03"/></geometry></visual></link>
<joint name="fix" type="fixed"><parent link="world"/><child link="base"/></joint>
<joint name="shoulder" type="revolute"><origin xyz="0 0 .1"/><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
 <limit lower="-1" upper="2" effort="10" velocity="3"/><dynamics damping=".1"/></joint>
<joint name="elbow" type="revolute"><origin xyz="0 0 .5" rpy="0 0 1.5707963267948966"/><parent link="upper"/>
 <child link="lower"/><axis xyz="1 0 0"/><limit lower=".3" upper="9"/><mimic joint="shoulder"/></joint>
<joint name="flange" type="fixed"><origin xyz="0 0 .4"/><parent link="lower"/><child link="tool"/></joint>
<transmission name="t"/></robot>"""


def read(tmp_path: Path, text: str, **options: str) -> turnbuckle.Imported:
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    return turnbuckle.import_scene(file, **options)


def test_a_robot(tmp_path: Path) -> None:
    found = read(tmp_path, ROBOT)
    bodies = {b.name: b for b in found.scene.definition.bodies}
    assert list(bodies) == ["base", "upper", "lower"], "the tool has no mass and is part of the lower arm"
    assert bodies["base"].motion == "immobile"
    assert np.allclose(bodies["upper"].position, [0, 0, 0.1]) and np.allclose(bodies["lower"].position, [0, 0, 0.6])
    assert np.allclose(bodies["lower"].parts[0].position, [0, 0, 0.4]) and bodies["lower"].parts[0].sphere == 0.03
    turn = np.array([[np.cos(0.1), 0, np.sin(0.1)], [0, 1, 0], [-np.sin(0.1), 0, np.cos(0.1)]])
    assert np.allclose(bodies["upper"].inertia, turn @ np.diag([0.02, 0.02, 0.002]) @ turn.T)
    assert np.allclose(bodies["upper"].center, [0, 0, 0.25]) and bodies["upper"].mass == 1.0
    shoulder, elbow = found.scene.definition.constraints
    assert (shoulder.body0, shoulder.body1, shoulder.lower_limit, shoulder.upper_limit) == ("base", "upper", -1, 2)
    # Turned a quarter about z, the child's x is the parent's y.
    assert np.allclose(elbow.axis, [0, 1, 0]) and elbow.lower_limit == 0.0 and elbow.upper_limit is None
    told = "\n".join(found.left_out)
    for words in ("joint 'elbow': starts at 0.3", "upper_limit 8.7 rad is more than half a turn", "follows another has no",
                  "damping and friction of a joint has no counterpart: shoulder", "effort and speed", "<transmission> (1)",
                  "link 'base': has no mass"):  # fmt: skip
        assert words in told, (words, told)
    report = turnbuckle.Simulation(found.scene).step(1e-3)
    assert report.status == "ok" and max(report.position_residual.values()) < 1e-12


def test_meshes_are_found_scaled_and_put_into_the_scene(tmp_path: Path) -> None:
    package = tmp_path / "arm_description"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    trimesh.creation.box(extents=[100, 200, 300]).export(package / "meshes" / "link.stl")
    mesh = '<mesh filename="package://arm_description/meshes/link.stl" scale=".001 .001 .001"/>'
    lost = '<collision><geometry><mesh filename="package://arm_description/meshes/none.stl"/></geometry></collision>'
    text = f'<robot name="r"><link name="l">{INERTIAL}<collision><geometry>{mesh}</geometry></collision>{lost}</link></robot>'
    (package / "urdf" / "r.urdf").write_text(text)
    found = turnbuckle.import_scene(package / "urdf" / "r.urdf")
    body = found.scene.definition.bodies[0]
    assert np.allclose(np.ptp(body.vertices, axis=0), [0.1, 0.2, 0.3]) and len(body.triangles) == 12
    assert any("none.stl' was not found" in text for text in found.left_out)
    found.scene.save(tmp_path / "r.yaml")
    assert turnbuckle.Scene.load(tmp_path / "r.yaml").to_yaml() == found.scene.to_yaml()


def test_an_impossible_inertia_is_told_and_replaced(tmp_path: Path) -> None:
    text = ROBOT.replace('izz=".002"', 'izz=".2"')
    found = read(tmp_path, text)
    assert any("no body has the inertia" in told for told in found.left_out)
    assert turnbuckle.Simulation(found.scene).step(1e-3).status == "ok"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('<link name="lower">', '<link name="upper">', "same name"),
        ('child link="tool"', 'child link="nothing"', "there is no link 'nothing'"),
        ('type="revolute"', 'type="magic"', "unknown type 'magic'"),
        ('lower="-1"', 'lower="3"', "above its upper limit"),
        ('lower="-1"', 'lower="abc"', "expected 1 finite number"),
        ('xyz="0 1 0"', 'xyz="0 0 0"', "its axis is zero"),
        ('xyz="0 1 0"', 'xyz="0 1"', "expected 3 finite numbers"),
        ('xyz="0 1 0"', 'xyz="0 nan 0"', "expected 3 finite numbers"),
        ('<mass value="1"/>', '<mass value="-1"/>', "is negative"),
        ('<mass value="1"/>', "<mass/>", "has no value"),
        ('radius=".1"', 'radius="-.1"', "cylinder.radius"),
        ('<parent link="base"/>', "", "has no <parent>"),
        ('parent link="world"', 'parent link="lower"', "circle"),
        ("<robot", "<human", "is no XML"),
        ("</robot>", "", "is no XML"),
        ('name="arm"', 'name="arm" name="b"', "is no XML"),
    ],
)
def test_wrong_files_name_what_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in ROBOT
    file = tmp_path / "robot.urdf"
    file.write_text(ROBOT.replace(old, new))
    result = CliRunner().invoke(app, ["import", str(file), str(tmp_path / "out.yaml")])
    assert result.exit_code == 2 and words in result.stderr and not (tmp_path / "out.yaml").exists(), result.output


def test_the_command(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(ROBOT)
    result = CliRunner().invoke(app, ["import", str(tmp_path / "robot.xml"), str(tmp_path / "out.yaml")])
    assert (
        result.exit_code == 0
        and "3 bodies, 2 constraints" in result.stdout
        and "left out: joint 'elbow'" in result.stdout
    )
    assert CliRunner().invoke(app, ["check", str(tmp_path / "out.yaml")]).exit_code == 0
    for words in (["none.urdf", "o.yaml"], [str(tmp_path), "o.yaml"], [str(tmp_path / "robot.xml"), "o.txt"],
                  [str(tmp_path / "robot.xml"), str(tmp_path / "no" / "o.yaml")], ["x.step", "o.yaml"]):  # fmt: skip
        assert CliRunner().invoke(app, ["import", *words]).exit_code == 2, words


def test_wrong_option(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'collision' or 'visual'"):
        read(tmp_path, ROBOT, shapes="both")
