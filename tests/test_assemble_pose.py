"""Posing by dragged points: targets within reach are met, others come near; joints and limits hold (3.1.4, 6)."""

import warnings

import numpy as np
import pytest
from assembly_scenes import frames, largest_gap, place
from scipy.spatial.transform import Rotation

from turnbuckle import InputError, Scene, pose


def arm(links: int = 4, **joint) -> Scene:
    """Rods of 1 m along x from the origin, on ball joints."""
    scene = Scene("arm")
    for i in range(links):
        scene.add_rigid(f"a{i}", box=[1.0, 0.1, 0.1], position=[i + 0.5, 0.0, 0.0], velocity=[0.0, 0, i])
        first = {} if i == 0 else {"body0": f"a{i - 1}"}
        near = [0.0, 0, 0] if i == 0 else [0.5, 0, 0]
        kind = "joint" if joint else "ball"
        scene.add_joint(kind, f"j{i}", **first, body1=f"a{i}", local_pos0=near, local_pos1=[-0.5, 0, 0], **joint)
    return scene


TIP = ("a3", (0.5, 0.0, 0.0))


@pytest.mark.parametrize("target", [(1.0, 1.0, 1.0), (2.0, 2.0, 0.5), (-1.5, 0.5, 0.0), (0.0, 0.0, 0.0)])
def test_target_within_reach(target: tuple[float, float, float]) -> None:
    """The last one is straight back along the stretched arm, where no pull bends it."""
    scene = arm()
    result = pose(scene, {TIP: target})
    np.testing.assert_allclose(place(result, *TIP), target, atol=1e-7)
    assert largest_gap(result) < 1e-8
    assert [d.velocity.tolist() for d in result.definition.bodies] == [[0, 0, i] for i in range(4)]


def test_target_out_of_reach_comes_as_near_as_possible() -> None:
    result = pose(arm(), {TIP: (10.0, 3.0, 0.0)})
    direction = np.array([10.0, 3.0, 0.0]) / np.hypot(10.0, 3.0)
    np.testing.assert_allclose(place(result, *TIP), 4.0 * direction, atol=1e-3)
    assert largest_gap(result) < 1e-8


def test_limits_hold() -> None:
    cone = {"axis0": [1, 0, 0], "axis1": [1, 0, 0], "max": 0.3}
    result = pose(arm(angle=cone), {TIP: (0.0, 0.0, 2.0)})
    at = frames(result)
    names = [None, "a0", "a1", "a2", "a3"]
    bends = []
    for body0, body1 in zip(names[:-1], names[1:], strict=True):
        a, b = at[body0][1].apply([1, 0, 0]), at[body1][1].apply([1, 0, 0])
        bends.append(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    assert max(bends) < 0.3 + 1e-8
    assert max(bends) > 0.29  # the pull is against the limits
    assert largest_gap(result) < 1e-8


def test_two_drags_and_a_whole_body() -> None:
    result = pose(arm(), {("a1", (0.5, 0, 0)): (1.0, 1.0, 0.0), "a3": (2.0, 1.5, 1.0)})
    np.testing.assert_allclose(place(result, "a1", (0.5, 0, 0)), (1.0, 1.0, 0.0), atol=1e-7)
    np.testing.assert_allclose(place(result, "a3", (0.0, 0, 0)), (2.0, 1.5, 1.0), atol=1e-7)
    assert largest_gap(result) < 1e-8


def test_contradictory_drags_share() -> None:
    scene = Scene("pulled")
    scene.add_rigid("ball", sphere=0.5)
    result = pose(scene, {("ball", (-0.5, 0, 0)): (-1.5, 0, 0), ("ball", (0.5, 0, 0)): (1.5, 0, 0)})
    np.testing.assert_allclose(result.definition.bodies[0].position, 0.0, atol=1e-6)


def test_ability_to_rotate_decides_between_turning_and_moving() -> None:
    ways = []
    for ability in (0.1, 100.0):
        scene = Scene("free")
        scene.add_rigid("rod", box=[2.0, 0.1, 0.1], ability_to_rotate=ability)
        result = pose(scene, {("rod", (1.0, 0, 0)): (1.0, 0.3, 0.0)})
        np.testing.assert_allclose(place(result, "rod", (1.0, 0, 0)), (1.0, 0.3, 0.0), atol=1e-8)
        ways.append(float(np.linalg.norm(result.definition.bodies[0].position)))
    assert ways[0] > 0.25 and ways[1] < 0.06


def test_soft_bodies_are_dragged_too() -> None:
    scene = Scene("soft")
    scene.add_solid("cube", box={"size": [1, 1, 1], "cells": [1, 1, 1]}, position=[1.0, 0, 0])
    scene.add_constraint("nail", "corner", points={"body": "cube", "index": 0})
    result = pose(scene, {("cube", (1.0, 1.0, 1.0)): (1.0, 0.0, np.sqrt(3.0))})
    model, state = result.build()
    np.testing.assert_allclose(state.positions()[0], [1.0, 0, 0], atol=1e-8)
    d = result.definition.bodies[0]
    assert place_of(d, (1.0, 1.0, 1.0)) == pytest.approx(np.array([1.0, 0.0, np.sqrt(3.0)]), abs=1e-7)


def place_of(d, local) -> np.ndarray:
    return d.position + Rotation.from_rotvec(np.array(d.rotation)).apply(local)


def test_wrong_drags_and_open_joints_are_told() -> None:
    with pytest.raises(InputError, match="no body 'a9' to drag"):
        pose(arm(), {"a9": (0, 0, 0)})
    with pytest.raises(InputError, match="target of 'a1' must be three finite numbers"):
        pose(arm(), {"a1": (0, 0)})
    scene = arm()
    scene.add_rigid("wall", box=[1.0, 1, 1], motion="immobile")
    with pytest.raises(InputError, match="'wall' is not dynamic"):
        pose(scene, {"wall": (0, 0, 0)})
    scene.add_joint("ball", "far", body1="a0", local_pos0=[9.0, 0, 0], local_pos1=[-0.5, 0, 0])
    with pytest.warns(UserWarning, match="joints cannot close, .*'far'"):
        pose(scene, {"a3": (1.0, 1, 1)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pose(arm(), {"a3": (1.0, 1, 1)})
