"""`Scene` in Python: each call validates at once, and `apply_set` changes one field."""

import numpy as np
import pytest
from pydantic import ValidationError

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene


def small() -> Scene:
    scene = Scene("s", dt=1e-3)
    scene.add_rope("rope.a", points=np.eye(3), lines=[[0, 1], [1, 2]], density=0.2)
    scene.add_solid("box", box={"size": [1, 1, 1], "cells": [1, 1, 1]})
    scene.add_constraint("nail", "hold", points={"body": "box", "index": 0})
    return scene


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: Scene(dtt=1), "dtt: unknown field, did you mean 'dt'"),
        (lambda s: Scene(dt=float("nan")), "dt: expected a finite number"),
        (lambda s: Scene(name=3), "name: expected text"),
        (lambda s: s.add_rope("r", start=[0, 0, 0], end=[1, 0, 0], segmants=3), "rope 'r', segmants: .*'segments'"),
        (lambda s: s.add_rope("r", points=np.eye(3) * np.nan), "rope 'r', points.0..0.: expected finite"),
        (lambda s: s.add_rope("r", points=np.eye(2)), r"shape \(n, 3\), got one of shape \(2, 2\)"),
        (lambda s: s.add_rope("r", points=np.array([["a"] * 3] * 2)), "expected an array of numbers"),
        (lambda s: s.add_rope("r", points=np.eye(3), lines=[[0, 3]]), "names point 3, but the body has 3 points"),
        (lambda s: s.add_rope("r", points=np.eye(3), lines=[[0.0, 1.0]]), "whole numbers"),
        (lambda s: s.add_rope("box", points=np.eye(3)), "already one of this name"),
        (lambda s: s.add_rope("r", mesh="none.obj"), "rope 'r', mesh: there is no file 'none.obj'"),
        (lambda s: s.add_cloth("c", vertices=np.eye(3), triangles=[[0, 1, 2]], mass=np.inf), "mass: expected a finite"),
        (lambda s: s.add_net("n", size=[1, 1]), "net 'n': 'size' needs 'cells' beside it"),
        (lambda s: s.add_solid("x", box={"size": [1, 1, 1]}), "solid 'x', box.cells: this field is needed"),
        (lambda s: s.add_solid("x", cylinder={"radius": 1, "length": 1, "around": 2}), "around: .* at least 3"),
        (lambda s: s.add_force("f", body="bx", expression=[0, 0, 0]), "force 'f', body: there is no body 'bx', .*'box'"),
        (lambda s: s.add_force("f"), "force 'f': gives no force; give an expression, a callable or a pull"),
        (lambda s: s.add_force("f", callable=3), "callable: expected a Python callable"),
        (lambda s: s.add_constraint("nali", "n"), "unknown type 'nali', did you mean 'nail'"),
        (lambda s: s.add_constraint("nail", "n", points={"body": "bax", "index": 0}), r"points\[0\].body.*'box'|points.body"),
        (lambda s: s.add_constraint("nail", "hold", points={"body": "box", "index": 0}), "already"),
        (lambda s: s.add_constraint("nail", "n", points={"body": "box", "index": True}), "whole number, got true"),
        (lambda s: s.add_constraint("nail", "n", points=[]), "at least 1 item"),
        (lambda s: s.add_constraint("nail", "n", points={"body": "box", "index": 0}, goal="x"), "goal: expected an array"),
        (lambda s: Scene.from_dict({"bodies": [{"type": "rope", "name": "r", "pts": 3}]}), "bodies.0..pts: unknown"),
    ],
)  # fmt: skip
def test_wrong_calls_name_the_object_and_the_field(call: object, words: str) -> None:
    scene = small()
    before = scene.to_yaml()
    with pytest.raises(InputError, match=words):
        call(scene)
    assert scene.to_yaml() == before


def test_arrays_are_copied_and_constant() -> None:
    points = np.eye(3)
    scene = Scene()
    scene.add_rope("r", points=points)
    points[0, 0] = 7.0
    rope = scene.definition.bodies[0]
    assert rope.points[0, 0] == 1.0 and rope.points.dtype == np.float64
    with pytest.raises(ValueError):
        rope.points[0, 0] = 3.0
    with pytest.raises(ValidationError):
        rope.damping = 3.0


def test_defaults_that_depend_on_others() -> None:
    scene = small()
    rope, box = scene.definition.bodies
    assert rope.density == 0.2 and box.density == 1000.0 and box.mass is None
    scene.add_net("n", size=[1, 1], cells=[1, 1], mass=3)
    net = scene.definition.bodies[2]
    assert net.density is None and net.shear_stiffness == 0.0
    np.testing.assert_array_equal(Scene(up_axis="Y").definition.gravity_vector(), [0, -9.81, 0])
    np.testing.assert_array_equal(Scene(gravity=[0, 0, 0]).definition.gravity_vector(), 0.0)


@pytest.mark.parametrize(
    ("assignment", "get", "value"),
    [
        ("dt=1e-5", lambda d: d.dt, 1e-5),
        ("gravity=[1, 2, 3]", lambda d: d.gravity.tolist(), [1, 2, 3]),
        ("gravity[2]=-1", None, None),
        ("bodies[0].density=3", lambda d: d.bodies[0].density, 3.0),
        ("bodies.rope.a.density=3", lambda d: d.bodies[0].density, 3.0),
        ("bodies.box.box.cells=[2, 3, 4]", lambda d: d.bodies[1].box.cells.tolist(), [2, 3, 4]),
        ("bodies.box.box.size[1]=0.5", lambda d: d.bodies[1].box.size.tolist(), [1, 0.5, 1]),
        ("constraints.hold.ramp.steps=7", lambda d: d.constraints[0].ramp.steps, 7),
        ("constraints.hold.points.index=3", lambda d: d.constraints[0].points[0].index, 3),
        ("constraints[0].goal=[0, 0, 2]", lambda d: d.constraints[0].goal.tolist(), [0, 0, 2]),
        ("constraints.hold.enabled=false", lambda d: d.constraints[0].enabled, False),
        ("name=other", lambda d: d.name, "other"),
        ("bodies.rope.b=3", None, None),
        ("bodies.box.mass=-1", None, None),
        ("bodies.rope.a.mass=1", None, None),
        ("bodies[2].mass=1", None, None),
        ("bodies.mass=1", None, None),
        ("dt", None, None),
        ("=3", None, None),
        ("dt=", None, None),
        ("dt=[1", None, None),
        ("dt.x=3", None, None),
        ("bodies=3", None, None),
        ("[0]=3", None, None),
        ("a..b=3", None, None),
        ("constraints.hold.points.body=bax", None, None),
        ("dt=!!python/name:os.system", None, None),
    ],
)
def test_apply_set(assignment: str, get: object, value: object) -> None:
    scene = small()
    before = scene.definition
    if get is None:
        with pytest.raises(InputError, match="--set"):
            scene.apply_set(assignment)
        assert scene.definition is before
    else:
        scene.apply_set(assignment)
        assert get(scene.definition) == value
        assert scene.definition != before
        assert Scene.loads(scene.to_yaml()).definition == scene.definition
