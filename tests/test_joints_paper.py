"""The printed motion of rigid bodies by its name, and steps that go back in time where a body turns too far."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, run
from reference import paper_rigid
from reference.free_top import FreeTop
from reference.multibody import angle_between

INERTIA = np.array([0.02, 0.035, 0.05])


def test_paper_mode_is_equations_one_to_four():
    """Gravity, a steady torque and a spin; step by step to round-off."""
    mechanism = Mechanism()
    mechanism.body("top", [0.1, 0.2, 0.3], [0.3, 0.4, 0.5], 1.3, INERTIA, v=[1.0, 2.0, 3.0], w=[2.0, 1.0, 3.0])
    simulation = mechanism.simulation(rigid_motion="paper")
    torque, force = np.array([0.01, -0.02, 0.03]), np.array([0.3, 0.0, -0.2])
    simulation.push("top", force=force, torque=torque)
    part = mechanism.parts[0]
    x, r, v, w = part.x, part.R, part.v, part.w
    for h in [0.01] * 40 + [0.005] * 20:
        report = simulation.step(h)
        assert report.halvings == 0
        x, r, v, w = paper_rigid.step(
            x, r, v, w, force + 1.3 * np.array([0, 0, -9.81]), torque, 1.3, np.diag(INERTIA), h
        )
        for mine, theirs in zip((x, r, v, w), mechanism.places(simulation)[0], strict=True):
            assert theirs == pytest.approx(mine, abs=1e-11)


def test_paper_mode_is_of_first_order_and_the_default_is_not():
    top = FreeTop(INERTIA, (0.3, 2.0, 0.4))
    errors = {"paper": [], "rotor": []}
    for motion in errors:
        for n in (100, 200):
            mechanism = Mechanism(gravity=ZERO)
            mechanism.body("top", ZERO, inertia=INERTIA, w=[0.3, 2.0, 0.4])
            simulation = mechanism.simulation(rigid_motion=motion)
            run(simulation, 1.0, n)
            errors[motion].append(angle_between(mechanism.places(simulation)[0][1], top.attitude(1.0)))
    assert errors["paper"][0] / errors["paper"][1] == pytest.approx(2.0, abs=0.3)
    assert max(errors["rotor"]) < 1e-9


@pytest.mark.parametrize("motion", ["rotor", "paper"])
def test_a_step_that_turns_too_far_is_halved(motion):
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("top", ZERO, inertia=INERTIA, w=[0.0, 0.0, 30.0])
    simulation = mechanism.simulation(rigid_motion=motion, max_rotation=0.1)
    report = simulation.step(0.01)  # 0.3 rad: two halvings of 0.075 rad each
    assert report.status == "ok" and report.halvings >= 2
    assert simulation.time == pytest.approx(0.01, abs=1e-15)
    # four steps of 0.0025 s are what the user could have taken himself
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("top", ZERO, inertia=INERTIA, w=[0.0, 0.0, 30.0])
    same = mechanism.simulation(rigid_motion=motion, max_rotation=10.0)
    run(same, 0.01, 4)
    assert mechanism.places(simulation)[0][1] == pytest.approx(mechanism.places(same)[0][1], abs=1e-12)


def test_halving_keeps_joints_closed():
    mechanism = Mechanism()
    spin = np.array([10.0, 20.0, 30.0])
    mechanism.body("bob", 0.3 * X, inertia=INERTIA, w=spin, v=np.cross(spin, 0.3 * X))
    mechanism.joint("ball", "pivot", "bob")
    simulation = mechanism.simulation(max_rotation=0.1)
    halvings = 0
    for _ in range(20):
        report = simulation.step(0.01)
        assert report.status == "ok", report.messages
        assert max(report.position_residual.values()) < 1e-10
        halvings += report.halvings
    assert halvings > 20
    x, r, _, _ = mechanism.places(simulation)[0]
    assert x - r @ (0.3 * X) == pytest.approx(ZERO, abs=1e-10)
