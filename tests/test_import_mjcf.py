"""MJCF: the imported mechanism moves as MuJoCo moves it, and what has no counterpart is named."""

from pathlib import Path

import numpy as np
import pytest

import turnbuckle
from turnbuckle.data.errors import InputError

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><option timestep="1e-4" gravity="0 0 -9.81" integrator="RK4"/>
<worldbody>
 <body name="a" pos="0 0 2" euler="0 30 0">
  <joint name="shoulder" type="hinge" axis="0 1 0" pos="0 0 .3"/><geom type="box" size=".05 .06 .3"/>
  <body name="rim" pos="0 0 -.1"><geom type="sphere" size=".03" mass="0"/>
   <body name="b" pos="0 0 -.2" euler="0 40 20">
    <joint name="u1" type="hinge" axis="1 0 0"/><joint name="u2" type="hinge" axis="0 1 0"/>
    <geom type="capsule" size=".05 .2" pos="0 0 -.2" euler="0 10 0"/>
    <body name="c" pos="0 0 -.45"><joint name="slider" type="slide" axis="1 0 0"/>
     <geom type="ellipsoid" size=".05 .06 .1"/></body>
   </body></body></body>
 <body name="d" pos=".6 0 2.1"><freejoint/><geom type="cylinder" size=".1 .2"/></body>
</worldbody>
<equality><connect name="link" body1="d" body2="a" anchor="-.5 .1 0.1"/></equality></mujoco>"""


def test_an_arm_moves_as_in_mujoco(tmp_path: Path) -> None:
    """Hinge, universal, slide and a loop of bodies: the poses agree after a fifth of a second of free fall."""
    file = tmp_path / "arm.xml"
    file.write_text(ARM)
    found = turnbuckle.import_scene(file)
    assert found.left_out == ["contacts are off; import with --contact, or say contact: true in the scene"]
    kinds = {c.name: c.type for c in found.scene.definition.constraints}
    assert kinds == {"shoulder": "revolute", "u1_u2": "universal", "slider": "prismatic", "link": "ball"}

    model = mujoco.MjModel.from_xml_string(ARM)
    model.eq_solref[:, 0] = 4e-4  # MuJoCo's coupling is a spring: as stiff as it goes
    model.eq_solimp[:, :2] = 0.9999
    data = mujoco.MjData(model)
    simulation = turnbuckle.Simulation(found.scene)
    for _ in range(2000):
        mujoco.mj_step(model, data)
        simulation.step(1e-4)
    for name in ("a", "b", "c", "d"):
        own = simulation.pose(name)[0]
        assert np.allclose(own, data.body(name).xpos, atol=2e-3), name
    start = mujoco.MjData(model)
    mujoco.mj_kinematics(model, start)
    assert np.linalg.norm(data.body("c").xpos - start.body("c").xpos) > 0.05, "nothing has moved"


def read(tmp_path: Path, world: str, rest: str = "") -> turnbuckle.Imported:
    file = tmp_path / "m.xml"
    file.write_text(f"<mujoco><worldbody>{world}</worldbody>{rest}</mujoco>")
    return turnbuckle.import_scene(file)


def test_limits_count_from_where_the_joint_starts(tmp_path: Path) -> None:
    body = '<body name="b"><joint name="j" type="hinge" axis="1 0 0" range="20 90"/><geom size=".1"/></body>'
    found = read(tmp_path, body)
    joint = found.scene.definition.constraints[0]
    assert (joint.lower_limit, joint.upper_limit) == pytest.approx((0.0, np.radians(70)))
    assert np.allclose(found.scene.definition.bodies[0].rotation, [np.radians(20), 0, 0])
    assert any("'j': starts at 0.349" in text for text in found.left_out)


@pytest.mark.parametrize(
    ("joints", "kind"),
    [
        ('<joint type="ball"/>', "ball"),
        ('<joint type="slide" axis="0 0 1" range="-1 1"/><joint type="hinge" axis="0 0 1"/>', "cylindrical"),
        ('<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint axis="0 0 1"/>', "planar"),
        ('<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>', "joint"),
        ('<joint axis="1 0 0"/><joint axis="0 1 0"/><joint axis="0 0 1"/>', "ball"),
        ('<freejoint/>', None),
    ],
)  # fmt: skip
def test_joints_of_one_body_become_one_of_the_same_freedom(tmp_path: Path, joints: str, kind: str | None) -> None:
    found = read(tmp_path, f'<body name="b">{joints}<geom size=".1" pos=".1 .2 .3"/></body>')
    assert [c.type for c in found.scene.definition.constraints] == ([] if kind is None else [kind])
    report = turnbuckle.Simulation(found.scene).step(1e-3)
    assert report.status == "ok", report.messages


def test_other_joints_become_a_chain_that_is_named(tmp_path: Path) -> None:
    joints = '<joint name="s" type="slide" axis="0 0 1"/><joint name="h" axis="1 0 0" range="-30 30"/>'
    found = read(tmp_path, f'<body name="b">{joints}<geom size=".1"/></body>')
    assert [c.type for c in found.scene.definition.constraints] == ["prismatic", "revolute"]
    assert found.scene.definition.constraints[1].upper_limit == pytest.approx(np.radians(30))
    assert any("became a chain over light bodies (b_s" in text for text in found.left_out)


def test_world_and_welds(tmp_path: Path) -> None:
    """What hangs on the world without a joint stands still, and is welded elsewhere; geoms of the world are obstacles."""
    found = read(
        tmp_path,
        '<geom name="floor" type="plane" size="0 0 1"/><geom name="wall" type="box" size=".1 2 3" pos="4 0 0"/>'
        '<body name="base"><geom size=".1"/><body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 .5" size=".02"/><body name="tool" pos="0 0 .5"><geom size=".03"/>'
        "</body></body></body>",
    )
    bodies = {b.name: b for b in found.scene.definition.bodies}
    assert bodies["floor"].type == "obstacle" and np.allclose(bodies["floor"].plane, 100)
    assert np.allclose(bodies["wall"].box, [0.2, 4, 6]) and np.allclose(bodies["wall"].position, [4, 0, 0])
    assert bodies["base"].motion == "immobile" and bodies["tool"].motion == "dynamic"
    assert {c.name: c.type for c in found.scene.definition.constraints} == {"j": "revolute", "tool_weld": "weld"}


def test_what_has_no_counterpart_is_named(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        '<body name="b"><joint name="j" damping=".1" stiffness="2" armature=".01" frictionloss=".3"/><geom size=".1"/>'
        '<site name="s"/></body><body name="p" mocap="true"><geom size=".1"/></body>',
        '<actuator><motor name="mot" joint="j"/></actuator><sensor><jointpos name="pos" joint="j"/></sensor>'
        '<equality><joint name="eq" joint1="j"/></equality><tendon><fixed name="ten"><joint joint="j" coef="1"/></fixed>'
        '</tendon><contact><exclude name="ex" body1="b" body2="p"/></contact><keyframe><key name="home" qpos="0"/></keyframe>',
    )
    told = "\n".join(found.left_out)
    for word in ("mot", "pos", "eq", "ten", "ex", "home", "damping of a joint", "spring of a joint", "armature",
                 "friction of a joint", "mocap"):  # fmt: skip
        assert word in told, (word, told)


@pytest.mark.parametrize("text", ["", "<mujoco>", "<mujoco><bla/></mujoco>", "<html/>", "\0\1", "<mujoco><worldbody><body/>",
                                  '<mujoco><include file="none.xml"/></mujoco>',
                                  '<mujoco><worldbody><body><joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'])  # fmt: skip
def test_wrong_files_are_told_in_a_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "wrong.xml"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        turnbuckle.import_scene(file)
    assert "\n" not in str(caught.value) and str(file) in str(caught.value)


TOUCHING = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="3 3 0.1" friction="0.4 0.005 0.0001"/>
  <body name="a" pos="0 0 0.1005"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2" friction="0.9 0 0"/>
    <geom name="look" type="sphere" size="0.3" contype="0" conaffinity="0" mass="0"/></body>
  <body name="b" pos="0.1 0 0.35"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>
  <body name="inside_b" pos="0.1 0.05 0.35"><freejoint/><geom type="sphere" size="0.08" mass="1"/></body>
  <body name="ghost" pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.2" mass="1" contype="0" conaffinity="0"/></body>
</worldbody><contact><exclude body1="a" body2="b"/></contact></mujoco>"""


def test_contact_is_turned_on_when_asked_for(tmp_path: Path) -> None:
    (tmp_path / "pile.xml").write_text(TOUCHING)
    off = turnbuckle.import_scene(tmp_path / "pile.xml")
    assert off.scene.definition.contact is None and any("--contact" in text for text in off.left_out)
    found = turnbuckle.import_scene(tmp_path / "pile.xml", contact=True)
    scene = found.scene.definition
    assert not any("contacts are off" in text for text in found.left_out)
    assert "geoms that touch nothing, of bodies with others that do: look" in found.left_out
    ignored = {frozenset(pair.between) for pair in scene.contact.ignore}
    assert ignored == {frozenset({"a", "b"}), frozenset({"b", "inside_b"})}, (
        "the file's pair, and the one that overlaps"
    )
    assert any("'inside_b'" in text and "overlap" in text for text in found.left_out)
    bodies = {body.name: body for body in scene.bodies}
    assert bodies["a"].static_friction == 0.9 and bodies["floor"].static_friction == 0.4
    assert bodies["ghost"].contact == "off" and bodies["a"].box is not None
    simulation = turnbuckle.Simulation(found.scene)
    for _ in range(60):
        report = simulation.step()
    assert report.status == "ok" and simulation.pose("a")[0][2] == pytest.approx(0.1, abs=2e-3), (
        "it stands on the floor"
    )
    assert simulation.pose("ghost")[0][2] < 0.1 - 0.03, "and the ghost falls through"
