"""Appendix A of Displacement, read to the letter, and what the paper's grammar leaves to be said."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import turnbuckle.scenes
from turnbuckle.data.errors import InputError
from turnbuckle.scene.definitions import JointDef
from turnbuckle.scene.graph.edges import ANGLE, BOTH, POINT, constraint_graph
from turnbuckle.scene.language.parser import parse
from turnbuckle.scene.language.reader import read_constraints_only
from turnbuckle.scene.scene import Scene

APPENDIX = Path(turnbuckle.scenes.__file__).with_name("monocycle_constraints.gascuel")
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
# object1, object2, P1, P2, (a1, a2, max): what the page prints, in its order (left leg first).
PRINTED = [
    ("body", "wheel", (0, -2, 0), (0, 0, 0), (X, X, 0)),
    (None, "body", None, None, (Y, Y, 0.066)),
    ("body", "left-thigh", (0.4, -0.6, 0), (0, 0, 0), (X, X, 0)),
    ("left-thigh", "left-leg", (0, 0, 1), (0, 0, 0), (X, X, 0)),
    ("left-leg", "left-foot", (0, 0, 1.4), (0, 0, -0.1), (X, X, 0)),
    ("wheel", "left-foot", (0.4, 0, -0.5), (0, 0, 0), None),
    ("body", "left-foot", None, None, (Z, Z, 0.1)),
    ("body", "right-thigh", (-0.4, -0.6, 0), (0, 0, 0), (X, X, 0.04)),
    ("right-thigh", "right-leg", (0, 0, 1), (0, 0, 0), (X, X, 0)),
    ("right-leg", "right-foot", (0, 0, 1.4), (0, 0, -0.1), (X, X, 9)),
    ("wheel", "right-foot", (-0.4, 0, 0.5), (0, 0, 0), None),
    ("body", "right-foot", None, None, (Z, Z, 0.1)),
]
OBJECTS = ["body", "wheel", "left-thigh", "left-leg", "left-foot", "right-thigh", "right-leg", "right-foot"]


def one(text: str, *objects: str) -> JointDef:
    """The only constraint of a text about some objects."""
    described = "".join(f"object {name} sphere 1; end " for name in objects)
    (joint,) = Scene.from_description(described + text).definition.constraints
    return joint


def test_every_statement_is_what_the_page_prints() -> None:
    alone = read_constraints_only(APPENDIX)
    assert alone is not None
    assert len(alone.definition.constraints) == len(PRINTED)
    for joint, (object1, object2, p1, p2, angle) in zip(alone.definition.constraints, PRINTED, strict=True):
        assert isinstance(joint, JointDef)
        assert (joint.body0, joint.body1) == (object1, object2)
        for got, wanted in ((joint.local_pos0, p1), (joint.local_pos1, p2)):
            assert got is None if wanted is None else np.array_equal(got, np.array(wanted, dtype=float))
        if angle is None:
            assert joint.angle is None
        else:
            assert np.array_equal(joint.angle.axis0, angle[0]) and np.array_equal(joint.angle.axis1, angle[1])
            assert (joint.angle.min, joint.angle.max) == (0.0, angle[2])  # no min: 0
        assert joint.given(("axial", "planar", "twist", "motor", "end", "anchor")) == []
        assert joint.enabled and joint.start == 0.0
    assert alone.needed == OBJECTS


def test_it_has_one_joint_more_than_section_5_3_3_counts() -> None:
    """The paper counts six of point and angle, two of points, three of angles. The file has one more of the first kind:
    the wheel on the body, which the text calls point to point and the file gives an angle."""
    graph = constraint_graph(read_constraints_only(APPENDIX).definition)
    assert Counter(edge.kind for edge in graph.edges) == {BOTH: 6 + 1, POINT: 2, ANGLE: 3}
    assert [edge.ends for edge in graph.edges if edge.kind == POINT] == [
        ("wheel", "left-foot"),
        ("wheel", "right-foot"),
    ]
    assert graph.nodes == [None, *OBJECTS]


def test_the_angle_of_9_is_warned_of_where_it_stands() -> None:
    alone = read_constraints_only(APPENDIX)
    (warning,) = alone.warnings
    line = APPENDIX.read_text().splitlines().index("angle 1 0 0 1 0 0 max 9; end") + 1
    assert warning.startswith(f"{APPENDIX}:{line}:19: joint 'right-leg.right-foot': angle max 9 rad")
    assert "limits nothing" in warning


@pytest.mark.parametrize(
    ("limits", "warned"),
    [("max 3.14159265358979", False), ("max 3.2", True), ("min 1 max 4", True), ("min 1", False), ("", False)],
)
def test_only_limits_above_pi_are_warned_of(limits: str, warned: bool, tmp_path: Path) -> None:
    file = tmp_path / "a.gascuel"
    file.write_text(f"constraint object2 a; angle 1 0 0 0 1 0 {limits}; end")
    assert bool(read_constraints_only(file).warnings) == warned


def test_constraints_without_names_are_called_after_their_objects() -> None:
    scene = Scene()
    for name in "ab":
        scene.add_rigid(name, sphere=1.0)
    text = "constraint object1 a; object2 b; hinge 0 0 0 0 0 0; {} end "
    again = Scene.from_description(
        "object a sphere 1; end object b sphere 1; end " + text.format("") * 2 + text.format("name a.b.2;")
    )
    assert [c.name for c in again.definition.constraints] == ["a.b", "a.b.3", "a.b.2"]


def test_included_in_a_scene_that_has_the_objects() -> None:
    scene = Scene("ride")
    for name in OBJECTS:
        scene.add_rigid(name, box=[0.1, 0.1, 0.1])
    scene.add_joint("ball", "body.wheel", body1="wheel", anchor=[0, 0, 0])  # a name that the file would have taken
    names = scene.include(APPENDIX)
    assert names[:3] == ["body.wheel.2", "world.body", "body.left-thigh"] and len(names) == 12
    assert [c.name for c in scene.definition.constraints] == ["body.wheel", *names]
    assert scene.definition.name == "ride"


def test_including_fails_where_an_object_lacks_and_changes_nothing(tmp_path: Path) -> None:
    scene = Scene()
    for name in OBJECTS[:-1]:
        scene.add_rigid(name, box=[0.1, 0.1, 0.1])
    before = scene.definition
    with pytest.raises(InputError) as caught:
        scene.include(APPENDIX)
    first = str(caught.value).splitlines()[0]
    line = APPENDIX.read_text().splitlines().index("object2 right-foot; hinge 0 0 1.4 0 0 -0.1;") + 1
    assert first.startswith(
        f"{APPENDIX}:{line}:1: constraint 'right-leg.right-foot', object2: there is no body 'right-foot'"
    )
    assert scene.definition is before


def test_loaded_alone_it_names_what_it_needs() -> None:
    with pytest.raises(
        InputError, match="describes constraints only; it needs the objects body, wheel, left-thigh"
    ) as e:
        Scene.load(APPENDIX)
    assert "\n" not in str(e.value)


def test_semicolons_and_lines_may_be_anywhere() -> None:
    text = APPENDIX.read_text()
    data = parse(text).data
    assert parse(text.replace(";", "")).data == data  # none at all
    assert parse(text.replace(";", " ;;\n")).data == data
    assert parse(" ".join(text.split())).data == data  # one line
    for end in ("\r\n", "\r"):
        changed = parse(text.replace("\n", end))
        assert changed.data == data and changed.places == parse(text).places
    assert parse(text.replace("end", "end;")).data == data


def test_defaults_of_the_grammar() -> None:
    """object1 is the world, no hinge, no translation, no angle, no twist; min of angle and planar is 0."""
    joint = one("constraint object2 a; planar 0 0 1; end", "a")
    assert joint.body0 is None and joint.has_no_place and joint.angle is None and joint.twist is None
    assert joint.planar.min == 0.0 and joint.planar.max is None
    joint = one("constraint object2 a; axial 0 0 1; end", "a")
    assert joint.axial.min is None and joint.axial.max is None
    joint = one("constraint object2 a; axial 0 0 1 min -inf max inf; end", "a")
    assert joint.axial.min is None and joint.axial.max is None


def test_the_world_may_be_named_and_so_may_an_object_called_world() -> None:
    assert one("constraint object1 world; object2 a; hinge 0 0 0 0 0 0; end", "a").body0 is None
    assert one('constraint object1 "world"; object2 a; hinge 0 0 0 0 0 0; end', "a", '"world"').body0 == "world"


def test_the_axis_is_that_of_object1() -> None:
    """The grammar writes u1, n1 and a1, b1: what has the number 1 is in object1, and the domain goes with it."""
    joint = one("constraint object1 a; object2 b; hinge 1 0 0  0 1 0; axial 0 0 2 min -1 max 3; end", "a", "b")
    assert (joint.body0, joint.body1) == ("a", "b")
    assert joint.local_pos0.tolist() == [1, 0, 0] and joint.local_pos1.tolist() == [0, 1, 0]
    assert joint.axial.axis.tolist() == [0, 0, 2] and (joint.axial.min, joint.axial.max) == (-1, 3)
    text = "constraint object1 a; object2 b; angle 1 0 0 0 1 0; twist 0 0 1 0 0 -1 min -1 max 1; end"
    joint = one(text, "a", "b")
    assert joint.angle.axis0.tolist() == [1, 0, 0] and joint.angle.axis1.tolist() == [0, 1, 0]
    assert joint.twist.vector0.tolist() == [0, 0, 1] and joint.twist.vector1.tolist() == [0, 0, -1]
    assert joint.twist.axis0 is None  # those of the angle


def test_a_twist_alone_says_its_axes() -> None:
    joint = one("constraint object2 a; twist 1 0 0 1 0 0 about 0 0 1 0 0 1 max .5; end", "a")
    assert joint.twist.axis0.tolist() == [0, 0, 1] and joint.twist.max == 0.5
    with pytest.raises(InputError, match="3:7: constraint 'world.a', twist axis1: needs axis1, for there is no angle"):
        Scene.from_description("object a sphere 1; end\nconstraint object2 a;\n      twist 1 0 0 1 0 0; end")


def test_in_which_interval_of_time_it_is_valid() -> None:
    joint = one("constraint object2 a; hinge 0 0 0 0 0 0; from .5; until 2; end", "a")
    assert (joint.start, joint.end) == (0.5, 2.0)
    with pytest.raises(InputError, match="1:73: constraint 'world.a', until: end must be later than start"):
        one("constraint object2 a; hinge 0 0 0 0 0 0; from 3; until 2; end", "a")


def test_names_that_are_words_of_the_language_stand_in_quotes() -> None:
    joint = one('constraint object1 "end"; object2 sphere; hinge 0 0 0 0 0 0; name "max"; end', '"end"', "sphere")
    assert (joint.body0, joint.body1, joint.name) == ("end", "sphere", "max")
    joint = one("constraint object1 axial; object2 min; hinge 0 0 0 0 0 0; name hinge; end", '"axial"', '"min"')
    assert (joint.body0, joint.body1, joint.name) == ("axial", "min", "hinge")  # before a ';' there is no doubt


def test_motors_soft_domains_breaking_and_radians() -> None:
    joint = one(
        "constraint object1 a; object2 b; angle 1 0 0 1 0 0 max 0; twist 0 1 0 0 1 0 stiffness 5 damping .1; "
        "motor twist target-velocity 3 max-force 2; break-force 100; break-torque 7; enabled no; end",
        "a",
        "b",
    )
    assert joint.motor.on == "twist" and joint.motor.target_velocity == 3.0 and joint.motor.max_force == 2.0
    assert (joint.break_force, joint.break_torque, joint.enabled) == (100.0, 7.0, False)
    assert (joint.twist.stiffness, joint.twist.damping) == (5.0, 0.1)
    assert one("constraint object2 a; angle 1 0 0 1 0 0 max 1.5; end", "a").angle.max < math.pi / 2
