"""Joints that are added, removed, switched, driven and asked between two steps."""

import numpy as np
import pytest
from rigid_scene_example import ball, box, chain, mixed

import turnbuckle

DT = 1e-3


def wheel(motor: dict, kind: str = "revolute", **fields: object) -> turnbuckle.Simulation:
    joint = {"type": kind, "name": "axle", "body1": "b", "anchor": [0, 0, 0], "axis": [0, 0, 1], "motor": motor}
    return turnbuckle.Simulation(
        turnbuckle.Scene("wheel", dt=DT, gravity=[0, 0, 0], bodies=[box("b", [0, 0, 0])], constraints=[joint], **fields)
    )


def test_a_motor_takes_another_speed_at_once() -> None:
    simulation = wheel({"on": "twist", "target_velocity": 3.0})
    simulation.run(0.01)
    assert simulation.velocity("b")[1] == pytest.approx([0, 0, 3.0], abs=1e-10)
    simulation.retarget("axle", -7)
    simulation.step()
    assert simulation.velocity("b")[1] == pytest.approx([0, 0, -7.0], abs=1e-10)
    before = simulation.coordinate("axle")["twist"]
    simulation.run(0.01)
    assert simulation.coordinate("axle")["twist"] - before == pytest.approx(-0.07, abs=1e-10)


def test_a_weak_motor_reaches_its_new_speed_with_its_torque() -> None:
    simulation = wheel({"on": "twist", "target_velocity": 0.0, "max_force": 0.5})
    simulation.run(0.01)
    simulation.retarget("axle", np.float64(100.0))
    simulation.run(0.05)
    inertia = (0.2**2 + 0.1**2) / 12
    assert simulation.velocity("b")[1][2] == pytest.approx(0.5 / inertia * 0.05, rel=1e-9)


def test_a_motor_takes_another_place() -> None:
    for kind, on, name in (("revolute", "twist", "twist"), ("prismatic", "axial", "place")):
        simulation = wheel({"on": on, "target_position": 0.0, "time_constant": 0.01}, kind)
        simulation.run(0.02)
        assert simulation.coordinate("axle")[name] == pytest.approx(0.0, abs=1e-12)
        for goal in (0.4, -0.2):
            simulation.retarget("axle", goal)
            simulation.run(0.25)
            assert simulation.coordinate("axle")[name] == pytest.approx(goal, abs=1e-9)


def test_what_is_no_target_is_refused() -> None:
    simulation = wheel({"on": "twist", "target_velocity": 3.0})
    for wrong in ("fast", [1.0, 2.0], None, True, {"times": [0], "positions": [[0, 0, 0]]}, lambda t: t):
        with pytest.raises(turnbuckle.InputError, match="'axle'.*one number"):
            simulation.retarget("axle", wrong)
    with pytest.raises(turnbuckle.InputError, match="'axle'.*not finite"):
        simulation.retarget("axle", np.nan)
    hanging = turnbuckle.Simulation(chain(1))
    with pytest.raises(turnbuckle.InputError, match="'j0' has no motor"):
        hanging.retarget("j0", 1.0)


def test_a_joint_added_in_the_run_holds_from_the_next_step() -> None:
    simulation = turnbuckle.Simulation(chain(3))
    simulation.run(0.02)
    place = simulation.center("b2").copy()
    simulation.add_constraint("ball", "pin", body1="b2", anchor=place)
    assert simulation.joint_residual("pin") == (0.0, 0.0), "nothing is measured yet"
    for _ in range(20):
        assert simulation.step().status == "ok"
        assert np.linalg.norm(simulation.center("b2") - place) < 1e-10
    assert simulation.residuals("pin")[0] < 1e-10
    simulation.remove_constraint("pin")
    assert "pin" not in simulation.state.joints
    simulation.run(0.02)
    assert np.linalg.norm(simulation.center("b2") - place) > 1e-3
    simulation.add_constraint("weld", "pin", body1="b2", anchor=simulation.center("b2"))
    turn = simulation.pose("b2")[1]
    simulation.run(0.02)
    assert abs(simulation.pose("b2")[1] @ turn) == pytest.approx(1.0, abs=1e-10)


def test_a_joint_on_a_curve_can_be_switched() -> None:
    wire = {"points": [[-1, 0, 0], [0, 0, 0], [1, 0.2, 0], [2, 0, 0]], "interpolation": "spline"}
    joint = {
        "type": "joint",
        "name": "wire",
        "body1": "b",
        "local_pos0": [0, 0, 0],
        "local_pos1": [0, 0, 0],
        "curve": wire,
    }
    scene = turnbuckle.Scene("bead", dt=DT, bodies=[box("b", [0, 0, 0], velocity=[1, 0, 0])], constraints=[joint])
    simulation = turnbuckle.Simulation(scene)
    for _ in range(20):
        assert simulation.step().status == "ok"
    simulation.switch("wire", False)
    v = simulation.velocity("b")[0]
    for _ in range(20):
        report = simulation.step()
        assert report.status == "ok" and report.position_residual.get("joint", 0.0) == 0.0
    assert simulation.velocity("b")[0] == pytest.approx(v + [0, 0, -9.81 * 0.02], abs=1e-10)


def test_what_has_broken_stays_off() -> None:
    simulation = turnbuckle.Simulation(chain(1))
    simulation.state.joints["j0"].break_force = 1.0
    broken = [name for _ in range(3) for name in simulation.step().broken]
    assert broken == ["j0"]
    simulation.switch("j0", False)
    simulation.switch("j0", True)
    v = simulation.velocity("b0")[0]
    simulation.run(0.01)
    assert simulation.velocity("b0")[0] == pytest.approx(v + [0, 0, -0.0981], abs=1e-10)


def test_forces_and_residuals_of_joints() -> None:
    simulation = turnbuckle.Simulation(
        turnbuckle.Scene("hung", bodies=[box("b", [0, 0, -0.1])], constraints=[ball("pin", None, "b", [0, 0, 0])])
    )
    simulation.run(0.01)
    assert simulation.forces("pin") == pytest.approx(np.array([[0, 0, 9.81]]), abs=1e-8)
    assert simulation.forces("pin")[0] == pytest.approx(simulation.reaction("pin")[0], abs=0)
    assert simulation.residuals("pin").shape == (2,) and simulation.residuals("pin").max() < 1e-10


def test_names_of_joints_in_errors() -> None:
    simulation = turnbuckle.Simulation(mixed())
    for call in (simulation.forces, simulation.residuals, simulation.remove_constraint):
        with pytest.raises(turnbuckle.InputError, match="no constraint 'lonk'; known are: .*corner.*link.*tie"):
            call("lonk")
    with pytest.raises(turnbuckle.InputError, match="no joint 'tie'; known are: link"):
        simulation.reaction("tie")
    with pytest.raises(turnbuckle.InputError, match="'link' already"):
        simulation.add_constraint("nail", "link", points=[{"body": "rope", "index": 2}])
    with pytest.raises(turnbuckle.InputError, match="'tie' already"):
        simulation.add_constraint("ball", "tie", body1="a", anchor=[0, 0, 0])
    with pytest.raises(turnbuckle.InputError, match="'rope' is no rigid body"):
        simulation.add_constraint("ball", "new", body1="rope", anchor=[0, 0, 0])
    assert "new" not in simulation.state.joints
    assert simulation.step().status == "ok"


def test_steps_that_are_halved_count_as_one() -> None:
    scene = turnbuckle.Scene("top", dt=0.01, bodies=[box("b", [0, 0, 0], angular_velocity=[0, 0, 120.0])])
    simulation = turnbuckle.Simulation(scene)
    for n in range(1, 6):
        assert simulation.step().halvings == 3
        assert simulation.state.steps == n and simulation.time == pytest.approx(0.01 * n)


def test_a_step_taken_back_leaves_soft_bodies_as_they_were() -> None:
    """What the scheme remembers is carried over to a step size once, however often the step is halved."""
    rope = {"type": "rope", "name": "r", "start": [0, 0, 5], "end": [1, 0, 5], "segments": 4, "mass": 0.1,
            "stretch_stiffness": 100.0}  # fmt: skip
    ends = []
    for spin, steps in ((120.0, 10), (0.0, 40)):
        top = box("b", [0, 0, 0], angular_velocity=[0, 0, spin])
        simulation = turnbuckle.Simulation(turnbuckle.Scene("both", dt=0.1 / steps, bodies=[top, rope]))
        for _ in range(steps):
            report = simulation.step()
        assert report.halvings == (3 if spin else 0)
        ends.append(simulation.positions("r").copy())
    assert ends[0] == pytest.approx(ends[1], abs=1e-10), "falls as with the small step"


@pytest.mark.parametrize("solver", ["equality", "displacement"])
def test_joints_come_and_go_under_both_solvers(solver: str) -> None:
    near = 1e-7 if solver == "equality" else 1e-4  # a straight loop is slow to close in displacements
    simulation = turnbuckle.Simulation(chain(4, solver=solver, displacement={"tolerance": 1e-9}))
    simulation.run(0.005)
    simulation.remove_constraint("j1")
    simulation.run(0.005)
    simulation.add_constraint("ball", "a", body1="b1", anchor=simulation.center("b1"))
    simulation.add_constraint("weld", "b", body1="b3", anchor=simulation.center("b3"))
    places = {name: simulation.center(name).copy() for name in ("b1", "b3")}
    for _ in range(20):
        assert simulation.step().status != "failed"
        for name, place in places.items():
            assert np.linalg.norm(simulation.center(name) - place) < near
    simulation.remove_constraint("a")
    simulation.run(0.02)
    assert np.linalg.norm(simulation.center("b1") - places["b1"]) > 1e-4
    for name in ("j0", "j2", "j3", "b"):
        assert simulation.residuals(name).max() < near
