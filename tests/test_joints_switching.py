"""Joints that come and go: switched by hand, by time windows, by breaking; what is not there does nothing."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run

H = 2e-3


def pendulum(**fields) -> Mechanism:
    mechanism = Mechanism()
    mechanism.body("bob", 0.5 * X, mass=2.0, inertia=(0.02, 0.03, 0.04))
    mechanism.joint("ball", "pivot", "bob", **fields)
    return mechanism


def flies_freely(mechanism, simulation, duration=0.1) -> None:
    """From now on a parabola, and the angular momentum stays."""
    x, r, v, w = mechanism.places(simulation)[0]
    spin = r @ np.diag([0.02, 0.03, 0.04]) @ r.T @ w
    run(simulation, duration, round(duration / H))
    x1, r1, v1, w1 = mechanism.places(simulation)[0]
    assert x1 == pytest.approx(x + duration * v - 0.5 * 9.81 * duration**2 * Z, abs=1e-9)
    assert v1 == pytest.approx(v - 9.81 * duration * Z, abs=1e-9)
    assert r1 @ np.diag([0.02, 0.03, 0.04]) @ r1.T @ w1 == pytest.approx(spin, abs=1e-9)
    force, torque = simulation.reaction("pivot")
    assert np.abs(force).max() == 0.0 and np.abs(torque).max() == 0.0


def test_switched_off_in_mid_swing():
    mechanism = pendulum()
    simulation = mechanism.simulation()
    run(simulation, 0.2, 100)
    assert np.linalg.norm(mechanism.places(simulation)[0][0]) == pytest.approx(0.5, abs=1e-10)
    simulation.switch("pivot", False)
    flies_freely(mechanism, simulation)


def test_time_window_ends():
    mechanism = pendulum(end=0.2)
    simulation = mechanism.simulation()
    run(simulation, 0.2, 100)
    assert np.linalg.norm(mechanism.places(simulation)[0][0]) == pytest.approx(0.5, abs=1e-10)
    flies_freely(mechanism, simulation)


def test_time_window_begins():
    """Thrown sideways through the pivot's reach: before the window it flies, at its start the joint holds where it is met."""
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("bob", ZERO, mass=2.0, inertia=(0.02, 0.03, 0.04), v=0.0 * X, w=[0.0, 0.0, 2.0])
    simulation_fields = {"start": 0.1}
    mechanism.joint("ball", "pivot", "bob", **simulation_fields)
    simulation = mechanism.simulation()
    run(simulation, 0.1, 50)
    assert simulation.reaction("pivot")[0] == pytest.approx(ZERO, abs=0.0)
    simulation.push("bob", force=[3.0, 0.0, 0.0])
    run(simulation, 0.1, 50)
    assert mechanism.places(simulation)[0][0] == pytest.approx(ZERO, abs=1e-10)
    assert simulation.reaction("pivot")[0] == pytest.approx([-3.0, 0.0, 0.0], abs=1e-9)


def test_breaks_at_its_force():
    """The reaction of a pendulum let go level grows to 3 m g at the bottom (a point): it breaks at 2 m g on the way."""
    mechanism = Mechanism()
    mechanism.body("bob", 0.5 * X, mass=2.0, inertia=(1e-4, 1e-4, 1e-4))
    mechanism.joint("ball", "pivot", "bob", break_force=2 * 2.0 * 9.81)
    simulation = mechanism.simulation()
    broken = []
    for _ in range(400):
        report = simulation.step(H)
        if report.broken:
            broken.append((report.broken, simulation.time))
            break
    assert broken and broken[0][0] == ["pivot"]
    # |reaction|^2 = (3 m g sin a)^2 radially: it breaks where sin a = 2/3 below level
    x = mechanism.places(simulation)[0][0]
    assert -x[2] / np.linalg.norm(x) == pytest.approx(2.0 / 3.0, abs=0.03)
    mechanism_free = mechanism.places(simulation)[0]
    v = mechanism_free[2]
    run(simulation, 0.1, 50)
    assert mechanism.places(simulation)[0][2] == pytest.approx(v - 9.81 * 0.1 * Z, abs=1e-6)
    simulation_time = simulation.time
    assert simulation_time > broken[0][1]


def test_breaks_at_its_torque():
    mechanism = Mechanism()
    mechanism.body("beam", 0.5 * X, mass=2.0, inertia=(0.02, 0.03, 0.04))
    mechanism.joint("weld", "root", "beam", break_torque=12.0)
    simulation = mechanism.simulation()
    run(simulation, 0.1, 50)
    assert simulation.reaction("root")[1] == pytest.approx([0.0, -0.5 * 2.0 * 9.81, 0.0], abs=1e-7)
    simulation.push("beam", force=[0.0, 0.0, -5.0])  # 12.3 N m
    reports = [simulation.step(H) for _ in range(5)]
    assert any("root" in r.broken for r in reports)
    run(simulation, 0.05, 25)
    assert mechanism.places(simulation)[0][0][2] < -0.01


def test_switching_a_joint_of_a_chain_keeps_the_others():
    mechanism = Mechanism()
    for i in range(3):
        mechanism.body(f"b{i}", (0.2 + 0.4 * i) * X, inertia=(0.01, 0.02, 0.02))
    for i in range(3):
        mechanism.joint("revolute", f"j{i}", f"b{i}", f"b{i - 1}" if i else None, 0.4 * i * X, axis=Y)
    simulation = mechanism.simulation()
    run(simulation, 0.2, 100)
    simulation.switch("j1", False)

    def held(report):
        assert max(report.position_residual.values()) < 1e-10

    run(simulation, 0.2, 100, held)
    assert max(simulation.joint_residual("j0")) < 1e-10 and max(simulation.joint_residual("j2")) < 1e-10
    x = [p[0] for p in mechanism.places(simulation)]
    r = [p[1] for p in mechanism.places(simulation)]
    gap = (x[0] + r[0] @ (0.2 * X)) - (x[1] - r[1] @ (0.2 * X))
    assert np.linalg.norm(gap) > 0.05
