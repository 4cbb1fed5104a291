"""Assembly with soft bodies tied by point constraints, alone and mixed with rigid ones: each moves as a whole."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle import Scene, assemble


def points(scene: Scene, name: str) -> np.ndarray:
    """All points of a body at the start."""
    model, state = scene.build()
    shape = model.shape(name)
    return np.array(state.positions()[shape.begin : shape.end])


def cube(scene: Scene, name: str, **place) -> None:
    scene.add_solid(name, box={"size": [1, 1, 1], "cells": [1, 1, 1]}, **place)


def test_soft_cubes_and_a_rigid_arm_in_one_chain() -> None:
    scene = Scene("mixed")
    scene.add_rigid("arm", box=[1.0, 0.1, 0.1], position=[2.0, 1.0, 0.5], markers=[[-0.5, 0, 0], [0.5, 0, 0]])
    cube(scene, "a", position=[0.3, 0.2, 0.0], rotation=[0.2, 0.1, 0.0])
    cube(scene, "b", position=[4.0, 0.0, 1.0], rotation=[0.0, 0.8, 0.0])
    scene.add_rope("rope", start=[6.0, 0, 0], end=[7.0, 0, 0], segments=4)
    scene.add_constraint("nail", "corner", points={"body": "a", "index": 0}, goal=[0.0, 0.0, 0.0])
    refs = [[("a", 7), ("arm", 0)], [("arm", 1), ("b", 0)], [("b", 7), ("rope", 0)]]
    groups = [[{"body": body, "index": i} for body, i in group] for group in refs]
    scene.add_constraint("points_to_point", "links", groups=groups)
    result, report = assemble(scene)
    assert report.closed and report.gap < 1e-10 and report.joints == 2
    np.testing.assert_allclose(points(result, "a")[0], [0, 0, 0], atol=1e-10)
    for (body0, i), (body1, k) in refs:
        np.testing.assert_allclose(points(result, body0)[i], points(result, body1)[k], atol=1e-9)
    for name in ("a", "b", "rope"):  # nothing was deformed
        old, new = points(scene, name), points(result, name)
        lengths = [np.linalg.norm(x[:, None] - x, axis=2) for x in (old, new)]
        np.testing.assert_allclose(lengths[0], lengths[1], atol=1e-12)


def test_closed_loop_of_soft_cubes() -> None:
    """Three cubes corner to corner in a ring."""
    scene = Scene("ring")
    for k in range(3):
        cube(scene, f"c{k}", position=[2.0 * k, 0.1 * k, 0.0], rotation=[0.1 * k, 0.2, 0.3 * k])
    groups = [[{"body": f"c{k}", "index": 7}, {"body": f"c{(k + 1) % 3}", "index": 0}] for k in range(3)]
    scene.add_constraint("points_to_point", "ring", groups=groups)
    result, report = assemble(scene)
    assert report.closed
    for k in range(3):
        np.testing.assert_allclose(points(result, f"c{k}")[7], points(result, f"c{(k + 1) % 3}")[0], atol=1e-9)


def test_what_would_need_a_soft_body_to_deform_is_reported() -> None:
    scene = Scene("stretched")
    cube(scene, "c")
    goals = [[-0.5, 0.0, 0.0], [1.5, 1.0, 1.0]]
    scene.add_constraint("nail", "hold", points={"body": "c", "indices": [0, 7]}, goal=goals)
    result, report = assemble(scene)
    assert not report.closed and [joint.name for joint in report.open] == ["hold"]
    apart = (np.sqrt(6.0) - np.sqrt(3.0)) / 2.0
    assert report.open[0].gap == pytest.approx(apart, rel=1e-2)
    assert np.isfinite(points(result, "c")).all()


def test_attached_and_sliding_points() -> None:
    scene = Scene("attached", conflicts="solve")
    cube(scene, "block")
    scene.add_rope("bead", start=[3.0, 0.4, 2.0], end=[4.0, 0.4, 2.0], segments=2)
    scene.add_rope("tail", start=[0.2, -3.0, 0.0], end=[0.2, -4.0, 0.0], segments=2)
    elements = points(scene, "block")
    top = [i for i in range(len(elements)) if elements[i, 2] == 1.0][:3]
    scene.add_constraint("attach", "glue", points={"body": "tail", "index": 0}, to={"body": "block", "elements": [top]},
                         weights=[[0.2, 0.3, 0.5]])  # fmt: skip
    scene.add_constraint("slide", "glide", points={"body": "bead", "index": 0}, on={"body": "block", "surface": True})
    scene.add_constraint("nail", "hold", points={"body": "block", "indices": [0, 1, 2]})
    result, report = assemble(scene)
    assert report.closed
    block, bead, tail = (points(result, name) for name in ("block", "bead", "tail"))
    np.testing.assert_allclose(tail[0], np.array([0.2, 0.3, 0.5]) @ block[top], atol=1e-9)
    np.testing.assert_allclose(block[:3], points(scene, "block")[:3], atol=1e-9)
    assert np.abs(bead[0] - np.clip(bead[0], 0.0, 1.0)).max() < 1e-9  # on the cube, which is the unit cube
    assert min(np.abs(bead[0]).min(), np.abs(bead[0] - 1.0).min()) < 1e-9  # on its surface


def test_selections_by_place_mean_the_same_points_afterwards() -> None:
    """`nearest`, `side`, `where`, `coincident` and a nail without a goal are said by where bodies lay at the start."""
    scene = Scene("selected")
    cube(scene, "c", position=[0.0, 0.0, 5.0])
    scene.add_rope("r", start=[0.0, 0.0, 0.0], end=[1.0, 0.0, 0.0], segments=2)
    scene.add_rope("s", start=[1.0, 0.0, 0.0], end=[2.0, 0.0, 0.0], segments=2)
    scene.add_rope("n", start=[0.0, 3.0, 0.0], end=[1.0, 3.0, 0.0], segments=2)
    corner = {"body": "c", "nearest": [0.0, 0.0, 5.0]}
    scene.add_constraint("points_to_point", "pull", join=[corner, {"body": "r", "nearest": [0.0, 0.0, 0.0]}])
    scene.add_constraint("points_to_point", "ends", coincident={"bodies": ["r", "s"]})
    scene.add_constraint("nail", "pin", points={"body": "n", "where": "x < 0.1"})
    scene.add_constraint("points_to_point", "far", join=[{"body": "n", "side": "+x"}, {"body": "s", "side": "+x"}])
    result, report = assemble(scene)
    assert report.closed and assemble(result)[1].iterations == 0
    before, after = scene.build()[1].groups, result.build()[1].groups
    for name in ("pull", "ends", "pin", "far"):
        np.testing.assert_array_equal(before[name].points, after[name].points)
    np.testing.assert_allclose(after["pin"].goal.position(0.0), [[0.0, 3.0, 0.0]], atol=1e-12)


def test_straight_rope_turns_without_an_inertia_about_its_own_line() -> None:
    scene = Scene("line")
    scene.add_rope("r", start=[0.0, 0, 0], end=[1.0, 0, 0], segments=5)
    scene.add_constraint("nail", "ends", points={"body": "r", "indices": [0, 5]}, goal=[[0, 0, 0], [0, 0, 1.0]])
    result, report = assemble(scene)
    assert report.closed
    np.testing.assert_allclose(points(result, "r")[5], [0, 0, 1.0], atol=1e-10)


def test_coatings_go_with_their_kernels() -> None:
    scene = Scene("coated")
    scene.add_rigid("a", box=[1.0, 0.2, 0.2], position=[0.8, 0.3, 0.0], rotation=[0.0, 0.0, 0.4])
    scene.add_coating("flesh", around="a", thickness=0.1)
    scene.add_joint("ball", "root", body1="a", local_pos0=[0, 0, 0], local_pos1=[-0.5, 0, 0])
    relative = []
    result, report = assemble(scene)
    assert report.closed and report.joints == 1
    for s in (scene, result):
        d = s.definition.bodies[0]
        turn = Rotation.from_rotvec(np.array(d.rotation))
        relative.append(turn.inv().apply(points(s, "flesh") - d.position))
    np.testing.assert_allclose(relative[0], relative[1], atol=1e-9)
