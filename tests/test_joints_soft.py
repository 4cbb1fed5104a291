"""Soft domains against the damped oscillator, in metres and in radians, and motors with limited force."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference import joint_rows, rigid_forms

import turnbuckle


def lone(gravity=ZERO, **body) -> turnbuckle.Scene:
    scene = turnbuckle.Scene("soft", gravity=gravity)
    scene.add_rigid("body", **{"box": [0.1, 0.1, 0.1], "mass": 2.0, "inertia": [0.03, 0.04, 0.05], **body})
    return scene


def twist_of(simulation) -> float:
    q = simulation.pose("body")[1]
    return 2 * np.arctan2(q[2], q[3])


MASS, STIFFNESS, DAMPING, END = 2.0, 180.0, 3.0, 1.0


def spring_scene(way: str) -> turnbuckle.Scene:
    if way == "distance":
        scene = lone(position=[0.6, 0, 0])
        scene.add_joint("distance", "spring", body1="body", local_pos0=ZERO, local_pos1=ZERO, min=0.5, max=0.5,
                        stiffness=STIFFNESS, damping=DAMPING)  # fmt: skip
    else:
        scene = lone(position=[0.6, 0, 0])
        axial = {"axis": X, "min": 0.5, "max": 0.5, "stiffness": STIFFNESS, "damping": DAMPING}
        scene.add_joint(
            "joint", "spring", body1="body", local_pos0=ZERO, local_pos1=ZERO, axial=axial, fixed_rotation=True
        )
    return scene


@pytest.mark.parametrize("way", ["distance", "axial"])
def test_linear_spring_and_damper(way):
    x, v = rigid_forms.oscillator(END, 0.1, 0.0, MASS, STIFFNESS, DAMPING)
    errors = []
    for n in (100, 200):
        simulation = turnbuckle.Simulation(spring_scene(way))
        run(simulation, END, n)
        errors.append(
            max(abs(simulation.pose("body")[0][0] - 0.5 - x), abs(simulation.velocity("body")[0][0] - v) / 9.5)
        )
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8), errors


def test_torsional_spring_and_damper():
    inertia, stiffness, damping = 0.05, 4.0, 0.06
    x, v = rigid_forms.oscillator(END, 0.4, 0.0, inertia, stiffness, damping)
    errors = []
    for n in (100, 200):
        scene = lone(rotation=0.4 * Z)
        twist = {"vector0": X, "vector1": X, "min": 0.0, "max": 0.0, "stiffness": stiffness, "damping": damping}
        angle = {"axis0": Z, "axis1": Z, "min": 0.0, "max": 0.0}
        scene.add_joint("joint", "hinge", body1="body", local_pos0=ZERO, local_pos1=ZERO, angle=angle, twist=twist)
        simulation = turnbuckle.Simulation(scene)
        run(simulation, END, n)
        errors.append(max(abs(twist_of(simulation) - x), abs(simulation.velocity("body")[1][2] - v) / 9.0))
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8), errors


def test_soft_cone_swings_back():
    """A preferred angle: the axis of the body swings about z in one plane like a torsional pendulum outside the cone."""
    inertia, stiffness = 0.04, 3.0
    scene = lone(rotation=0.5 * Y)
    scene.add_joint("joint", "cone", body1="body", local_pos0=ZERO, local_pos1=ZERO,
                    angle={"axis0": Z, "axis1": Z, "min": 0.0, "max": 0.2, "stiffness": stiffness})  # fmt: skip
    simulation = turnbuckle.Simulation(scene)
    rate = np.sqrt(stiffness / inertia)
    end = 0.9 * np.pi / 2 / rate
    run(simulation, end, 200)
    assert simulation.coordinate("cone")["angle"] == pytest.approx(0.2 + 0.3 * np.cos(rate * end), abs=1e-4)
    run(simulation, 0.1 * np.pi / 2 / rate + 0.2 / (0.3 * rate), 200)  # then freely through the cone
    assert simulation.velocity("body")[1][1] == pytest.approx(-0.3 * rate, rel=2e-3)


def test_stiff_spring_is_stable_at_a_large_step():
    """A step as long as the period of the spring: no gain, and it settles on what the spring holds."""
    stiffness = 2e5
    scene = lone(gravity=[0, 0, -9.81], position=[0, 0, -0.5])
    scene.add_joint("distance", "spring", body1="body", local_pos0=ZERO, local_pos1=ZERO, min=0.5, max=0.5,
                    stiffness=stiffness, damping=632.0)  # fmt: skip
    simulation = turnbuckle.Simulation(scene)
    run(simulation, 2.0, 100)
    assert simulation.pose("body")[0] == pytest.approx([0, 0, -0.5 - 2 * 9.81 / stiffness], abs=1e-9)
    force, _ = simulation.reaction("spring")
    assert force == pytest.approx([0, 0, 2 * 9.81], abs=1e-5)


def motor_scene(**motor) -> turnbuckle.Scene:
    scene = lone()
    scene.add_joint("revolute", "axle", body1="body", anchor=ZERO, axis=Z, motor={"on": "twist", **motor})
    return scene


def test_motor_with_limited_torque_accelerates_evenly_to_its_rate():
    simulation = turnbuckle.Simulation(motor_scene(target_velocity=3.0, max_force=0.5))
    run(simulation, 0.2, 100)
    assert simulation.velocity("body")[1] == pytest.approx([0, 0, 0.5 * 0.2 / 0.05], abs=1e-9)
    assert simulation.reaction("axle")[1] == pytest.approx([0, 0, 0.5], abs=1e-9)
    run(simulation, 0.2, 100)
    assert simulation.velocity("body")[1] == pytest.approx([0, 0, 3.0], abs=1e-9)
    assert simulation.reaction("axle")[1] == pytest.approx([0, 0, 0.0], abs=1e-9)
    simulation.push("body", torque=[0, 0, -0.3])
    run(simulation, 0.1, 50)
    assert simulation.velocity("body")[1] == pytest.approx([0, 0, 3.0], abs=1e-9)
    assert simulation.reaction("axle")[1] == pytest.approx([0, 0, 0.3], abs=1e-9)
    simulation.push("body", torque=[0, 0, -0.7])  # more than it has
    run(simulation, 0.1, 50)
    assert simulation.velocity("body")[1] == pytest.approx([0, 0, 3.0 - 0.2 * 0.1 / 0.05], abs=1e-9)


def test_motor_without_limit_keeps_its_rate_from_the_start():
    simulation = turnbuckle.Simulation(motor_scene(target_velocity=3.0))
    run(simulation, 0.1, 50)
    assert simulation.velocity("body")[1] == pytest.approx([0, 0, 3.0], abs=1e-10)
    run(simulation, 0.1, 50)
    before = twist_of(simulation)
    run(simulation, 0.1, 50)
    assert twist_of(simulation) - before == pytest.approx(0.3, abs=1e-9)


def test_motor_reaches_a_wanted_angle():
    simulation = turnbuckle.Simulation(motor_scene(target_position=1.2, time_constant=0.05))
    run(simulation, 1.0, 500)
    assert twist_of(simulation) == pytest.approx(1.2, abs=1e-6)
    assert simulation.coordinate("axle")["twist"] == pytest.approx(1.2, abs=1e-6)


def test_motor_along_a_line_lifts_a_weight():
    scene = lone(gravity=[0, 0, -9.81])
    scene.add_joint("prismatic", "lift", body1="body", anchor=ZERO, axis=Z,
                    motor={"on": "axial", "target_velocity": 0.5, "max_force": 2 * 9.81 + 4.0})  # fmt: skip
    simulation = turnbuckle.Simulation(scene)
    run(simulation, 0.1, 100)
    assert simulation.velocity("body")[0] == pytest.approx([0, 0, 2.0 * 0.1], abs=1e-9)
    run(simulation, 0.4, 400)
    assert simulation.velocity("body")[0] == pytest.approx([0, 0, 0.5], abs=1e-9)
    assert simulation.reaction("lift")[0] == pytest.approx([0, 0, 2 * 9.81], abs=1e-7)


def test_spring_in_a_mechanism_is_of_second_order():
    """A pendulum on a hinge, pulled by a spring off its centre of mass, against the reference with the spring as a load."""
    rest, stiffness, anchor, local = 0.3, 60.0, np.array([0.5, 0.2, -0.6]), np.array([0.1, 0.05, 0.0])

    def loads(t, x, r, v, w):
        arm = r[0] @ local
        way = x[0] + arm - anchor
        length = np.linalg.norm(way)
        force = -stiffness * (length - rest) * way / length
        return force[None], np.cross(arm, force)[None]

    mechanism = Mechanism(loads=loads)
    mechanism.body("rod", 0.4 * X, mass=1.0, inertia=(0.01, 0.05, 0.05), w=[0.0, 1.0, 0.0])
    mechanism.joint("ball", "pivot", "rod", rows=joint_rows.ball)
    system = mechanism.system()
    end = 0.4
    truth = system.simulate([end], 1e-11, 1e-12)[-1]
    errors = []
    for n in (40, 80, 160):
        scene = mechanism.scene()
        scene.add_joint("distance", "spring", body1="rod", local_pos0=anchor, local_pos1=local, min=rest, max=rest,
                        stiffness=stiffness)  # fmt: skip
        simulation = turnbuckle.Simulation(scene)
        run(simulation, end, n)
        errors.append(mechanism.errors(simulation, truth, end, system))
    for what in ("place", "speed", "force"):
        values = [e[what] for e in errors]
        assert values[0] / values[1] == pytest.approx(4.0, abs=0.8), (what, values)
        assert values[1] / values[2] == pytest.approx(4.0, abs=0.8), (what, values)
