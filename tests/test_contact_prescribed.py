"""Contacts between nails and what is scripted: nothing can push there, and nothing needs to."""

import numpy as np
import pytest
from contact_measures import step_well

import turnbuckle
from turnbuckle.step.simulation import Simulation


def skirt_on_a_post(down: float) -> Simulation:
    """A cloth nailed at one edge so near to a post that both are within contact's reach; the nails move by `down` [m]."""
    scene = turnbuckle.Scene("held", dt=4e-3, contact={"friction": 0.3, "delta": 4e-3})
    scene.add_obstacle("post", box=[0.1, 0.6, 0.1], position=[-0.053, 0.0, 0.0])
    turned = {"position": [0.0, -0.2, -0.2], "rotation": [0.0, -0.5 * np.pi, 0.0]}  # in the plane x = 0, 3 mm off
    scene.add_cloth("cloth", size=[0.2, 0.4], cells=[4, 8], density=0.3, **turned)
    goal = {"times": [0.0, 0.2], "offsets": [[0.0] * 3, [0.0, 0.0, -down]], "interpolation": "linear"}
    scene.add_constraint("nail", "edge", points={"body": "cloth", "side": "+z", "thickness": 0.005}, goal=goal)
    return Simulation(scene)


@pytest.mark.parametrize("down", [0.0, 0.05])
def test_nails_near_an_obstacle(down: float) -> None:
    sim = skirt_on_a_post(down)
    start = sim.positions("cloth").copy()
    for report in step_well(sim, 50):
        assert report.status == "ok", report.messages
        assert np.isfinite(list(report.contact_residual.values())).all()
    held = start[:, 2] > -0.001
    assert held.sum() == 9
    np.testing.assert_allclose(sim.positions("cloth")[held], start[held] - [0.0, 0.0, down], atol=1e-12)
    assert sim.positions("cloth")[:, 0].min() > -0.003


def test_nails_that_are_driven_into_an_obstacle_are_named() -> None:
    scene = turnbuckle.Scene("driven", dt=4e-3, contact=True)
    scene.add_obstacle("floor", plane=[1.0, 1.0])
    scene.add_cloth("cloth", size=[0.2, 0.2], cells=[4, 4], position=[-0.1, -0.1, 0.02])
    goal = {"times": [0.0, 0.1], "offsets": [[0.0] * 3, [0.0, 0.0, -0.1]]}
    scene.add_constraint("nail", "all", points={"body": "cloth", "all": True}, goal=goal)
    sim = Simulation(scene)
    for _ in range(25):
        report = sim.step()
        if report.status == "failed":
            break
    assert report.status == "failed"
    assert "'floor'" in report.messages[0] and "'cloth'" in report.messages[0]
    assert sim.positions("cloth")[:, 2].min() > 0.0


@pytest.mark.parametrize("nearest", [1e-3, 3e-4])
def test_scripts_may_come_as_near_as_they_like_but_not_cross(nearest: float) -> None:
    """A nailed edge that an obstacle passes at a quarter of delta, and at less than a tenth, is no contradiction."""
    scene = turnbuckle.Scene("passing", dt=4e-3, contact={"friction": 0.3, "delta": 4e-3})
    way = {"times": [0.0, 0.1, 0.2], "positions": [[-0.1, 0, 0], [-0.05 - nearest, 0, 0], [-0.1, 0, 0]]}
    scene.add_obstacle("arm", box=[0.1, 0.1, 0.04], trajectory=way)
    turned = {"position": [0.0, -0.2, -0.2], "rotation": [0.0, -0.5 * np.pi, 0.0]}
    scene.add_cloth("cloth", size=[0.2, 0.4], cells=[4, 8], density=0.3, **turned)
    scene.add_constraint("nail", "edge", points={"body": "cloth", "side": "+z", "thickness": 0.005})
    sim = Simulation(scene)
    reports = step_well(sim, 50)
    gaps = [report.smallest_gap for report in reports if report.smallest_gap is not None]
    assert 0.0 < min(gaps) < 4e-3
    assert sum(report.last_resorts for report in reports) == 0
    assert all(report.intersections == 0 for report in reports)


def cloth_in_a_press(room: float, **contact: object) -> turnbuckle.Simulation:
    """Cloth on a floor, and a plate that comes down at 0.1 m/s until there are ``room`` times delta between both."""
    delta, speed = 1e-3, 0.1
    scene = turnbuckle.Scene("press", dt=2e-3, contact={"friction": 0.3, "delta": delta, **contact})
    scene.add_obstacle("floor", plane=[0.4, 0.4])
    plate = np.array([[-0.2, -0.2, 0.0], [0.2, -0.2, 0.0], [0.2, 0.2, 0.0], [-0.2, 0.2, 0.0]])
    ends = np.array([4.0, room]) * delta
    frames = plate + ends[:, None, None] * np.array([0.0, 0.0, 1.0])
    times = [0.0, (ends[0] - ends[1]) / speed]
    scene.add_obstacle("plate", frames=frames, triangles=[[0, 2, 1], [0, 3, 2]], times=times)
    at = {"size": [0.1, 0.1], "cells": [4, 4], "position": [0.0, 0.0, 1.5 * delta]}
    scene.add_cloth("cloth", density=0.2, structural_stiffness=100.0, **at)
    return turnbuckle.Simulation(scene)


def test_what_is_pressed_gives_way_as_far_as_is_certified() -> None:
    """Rows ask for the distances at the start, which a press takes from both sides at once."""
    sim = cloth_in_a_press(1.2)
    for _ in range(22):
        report = sim.step()
        assert report.status == "ok", report.messages
        assert report.intersections == 0 and report.halvings == 0
    z = sim.positions("cloth")[:, 2]
    assert 0.2e-3 < z.min() and z.max() < 1.0e-3
    assert np.abs(sim.velocities()).max() < 0.1


def test_what_is_pressed_beyond_is_named() -> None:
    sim = cloth_in_a_press(0.1)
    for _ in range(40):
        report = sim.step()
        if report.status == "failed":
            break
        assert report.intersections == 0
    assert report.status == "failed"
    assert "'floor' and 'cloth'" in report.messages[0] and "press them together" in report.messages[0]
    z = sim.positions("cloth")[:, 2]
    assert 0.0 < z.min() and np.isfinite(sim.velocities()).all()


def test_a_press_may_wait_for_what_it_presses() -> None:
    sim = cloth_in_a_press(0.1, on_impossible="stall")
    reports = [sim.step() for _ in range(20)]
    assert all(r.status != "failed" and r.intersections == 0 for r in reports)
    assert "scripts wait" in reports[-1].messages[-1] and "'cloth'" in reports[-1].messages[-1]
