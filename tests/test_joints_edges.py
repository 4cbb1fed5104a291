"""Limits and motors where they are easily wrong: open at the start, past pi, against each other; turns above one a step."""

import numpy as np
import pytest

import turnbuckle

X, Z, ORIGIN = [1, 0, 0], [0, 0, 1], [0, 0, 0]


def lone(gravity=(0, 0, 0), **body) -> turnbuckle.Scene:
    scene = turnbuckle.Scene("lone", gravity=list(gravity))
    scene.add_rigid("body", box=[0.1] * 3, mass=1, **body)
    return scene


def place(scene: turnbuckle.Scene, **fields) -> turnbuckle.Simulation:
    scene.add_joint("joint", "joint", body1="body", local_pos0=ORIGIN, local_pos1=ORIGIN, **fields)
    return turnbuckle.Simulation(scene)


def test_limit_open_at_the_start_closes_and_stops():
    simulation = place(lone(), axial={"axis": X, "min": 0.1}, fixed_rotation=True)
    for _ in range(5):
        report = simulation.step(1e-3)
    assert report.status == "ok"
    assert simulation.pose("body")[0] == pytest.approx([0.1, 0, 0], abs=1e-10)
    assert np.abs(simulation.velocity("body")[0]).max() < 1e-10


def test_twist_open_at_the_start_closes_and_stops():
    twist = {"axis0": Z, "axis1": Z, "vector0": X, "vector1": X, "min": 0.5}
    simulation = place(lone(), twist=twist)
    for _ in range(5):
        simulation.step(1e-3)
    assert simulation.coordinate("joint")["twist"] == pytest.approx(0.5, abs=1e-10)
    assert np.abs(simulation.velocity("body")[1]).max() < 1e-9


def test_limit_switched_on_outside_of_its_domain_does_not_throw():
    scene = lone()
    scene.add_joint("prismatic", "rail", body1="body", anchor=ORIGIN, axis=X, upper_limit=0.1)
    simulation = turnbuckle.Simulation(scene)
    simulation.step(1e-3)
    simulation.switch("rail", False)
    simulation.step(1e-3)
    simulation.set_pose("body", [0.3, 0, 0], [0, 0, 0, 1])
    simulation.switch("rail", True)
    for _ in range(3):
        simulation.step(1e-3)
    assert np.abs(simulation.velocity("body")[0]).max() < 1e-9
    assert simulation.coordinate("rail")["place"] <= 0.1 + 1e-10


def test_twist_limits_hold_near_pi():
    scene = lone(angular_velocity=[0, 0, 30])
    scene.add_joint("revolute", "axle", body1="body", anchor=ORIGIN, axis=Z, lower_limit=-3.1, upper_limit=3.1)
    simulation = turnbuckle.Simulation(scene)
    for _ in range(40):
        assert simulation.step(0.01).status == "ok"
        assert abs(simulation.coordinate("axle")["twist"]) <= 3.1 + 1e-10
    assert np.abs(simulation.velocity("body")[1]).max() < 1e-9


def test_window_of_twist_at_pi_is_reached_the_short_way():
    angle = {"axis0": Z, "axis1": Z, "max": 0}
    twist = {"vector0": X, "vector1": X, "min": 3.1, "max": 3.14}
    simulation = place(lone(rotation=[0, 0, np.pi]), angle=angle, twist=twist)
    simulation.step(0.01)
    assert simulation.coordinate("joint")["twist"] == pytest.approx(3.14, abs=1e-10)
    assert np.abs(simulation.velocity("body")[1]).max() < 1e-9


@pytest.mark.parametrize("max_force", [50.0, 2.0, None])
def test_motor_rests_against_its_limit(max_force):
    motor = {"on": "axial", "target_velocity": 1.0}
    if max_force is not None:
        motor["max_force"] = max_force
    scene = lone()
    scene.add_joint("prismatic", "rail", body1="body", anchor=ORIGIN, axis=X, upper_limit=0.1, motor=motor)
    simulation = turnbuckle.Simulation(scene)
    for _ in range(600):
        assert simulation.step(1e-3).status == "ok"
    assert simulation.coordinate("rail")["place"] == pytest.approx(0.1, abs=1e-10)


def test_turns_of_more_than_one_in_a_step_are_halved():
    simulation = turnbuckle.Simulation(lone(angular_velocity=[0, 0, 200 * np.pi]))
    assert simulation.step(0.01).halvings == 15  # 2 pi, in sixteen parts of less than half a radian


def test_reaction_is_there_before_the_first_step():
    scene = lone(gravity=[0, 0, -9.81])
    scene.add_joint("ball", "hook", body1="body", anchor=[0, 0, 0.05])
    assert turnbuckle.Simulation(scene).reaction("hook")[0] == pytest.approx([0, 0, 9.81])


def test_work_and_dissipation_balance_the_energy():
    scene = lone(linear_damping=1.0)
    scene.add_force("pull", body="body", expression=["1", "0", "0"])
    energies = turnbuckle.Simulation(scene).run(1.0, 1e-3).energies
    assert energies["work"] > 0.3
    assert energies["kinetic"] + energies["dissipation"] == pytest.approx(energies["work"], abs=1e-6)
