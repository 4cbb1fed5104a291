"""Bodies that stand or follow a trajectory carry others; what they feel is what the reference says."""

import itertools
import math

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference.multibody import turn

RATE = 2.5


def swing(t):
    """Pose of the arm: it shakes along x and turns about z."""
    return 0.1 * np.sin(4 * t) * X, RATE * t * Z


def swing_of_reference(t):
    x, v, a = 0.1 * np.sin(4 * t) * X, 0.4 * np.cos(4 * t) * X, -1.6 * np.sin(4 * t) * X
    return x, turn(RATE * t * Z), v, RATE * Z, a, ZERO


def passenger(**motion) -> Mechanism:
    mechanism = Mechanism()
    mechanism.body("arm", ZERO, v=0.4 * X, w=RATE * Z, drive=swing_of_reference, **motion)
    mechanism.body("guest", 0.6 * X, mass=2.0, inertia=(0.02, 0.03, 0.04), center=[0.05, 0.02, 0.0])
    mechanism.joint("revolute", "hinge", "guest", "arm", 0.3 * X, axis=Y)
    return mechanism


def test_passenger_on_a_callable_trajectory():
    mechanism = passenger(trajectory=swing)
    system = mechanism.system()
    end = 0.4
    truth = system.simulate([end], 1e-11, 1e-12)[-1]
    errors = []
    for n in (40, 80, 160):
        simulation = mechanism.simulation()
        run(simulation, end, n)
        errors.append(mechanism.errors(simulation, truth, end, system))
        place, rotation = swing(end)
        position, q = simulation.pose("arm")
        assert position == pytest.approx(place, abs=1e-12)
        assert 2 * np.arctan2(q[2], q[3]) == pytest.approx(rotation[2], abs=1e-12)
    for what in ("place", "speed", "force", "torque"):
        for coarse, fine in itertools.pairwise([e[what] for e in errors]):
            assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.35), (what, errors)


def test_constant_turning_gives_the_centripetal_force():
    """A guest welded to a table that turns at a constant rate by straight keyframes."""
    keys = {"times": [0.0, 1.0], "positions": [ZERO, ZERO], "rotations": [ZERO, 3.0 * Z], "interpolation": "linear"}

    def drive(t):
        return ZERO, turn(3.0 * t * Z), ZERO, 3.0 * Z, ZERO, ZERO

    mechanism = Mechanism()
    mechanism.body("table", ZERO, w=3.0 * Z, drive=drive, trajectory=keys)
    mechanism.body("guest", 0.5 * X, mass=2.0)
    mechanism.joint("weld", "seat", "guest", "table", 0.5 * X)
    simulation = mechanism.simulation()
    run(simulation, 0.4, 400)
    x, r, v, w = mechanism.places(simulation)[1]
    radial = turn(1.2 * Z) @ X
    assert x == pytest.approx(0.5 * radial, abs=1e-10)
    assert w == pytest.approx(3.0 * Z, abs=1e-9)
    force, torque = simulation.reaction("seat")
    assert force == pytest.approx(-2.0 * 9.0 * 0.5 * radial + 2.0 * 9.81 * Z, abs=1e-4)
    assert torque == pytest.approx(ZERO, abs=1e-4)


def test_smooth_keyframes_are_reached_and_held():
    keys = {"times": [0.0, 0.5, 1.0], "positions": [ZERO, 0.3 * X, 0.3 * X + 0.2 * Y], "rotations": [ZERO, Z, 0.5 * Z]}
    mechanism = Mechanism()
    mechanism.body("hand", ZERO, drive=lambda t: (ZERO, np.eye(3), ZERO, ZERO, ZERO, ZERO), trajectory=keys)
    simulation = mechanism.simulation()
    for time, place, angle in ((0.5, 0.3 * X, 1.0), (1.0, 0.3 * X + 0.2 * Y, 0.5), (1.3, 0.3 * X + 0.2 * Y, 0.5)):
        run(simulation, time - simulation.time, 20)
        position, q = simulation.pose("hand")
        assert position == pytest.approx(place, abs=1e-12)
        assert 2 * np.arctan2(q[2], q[3]) == pytest.approx(angle, abs=1e-12)
    assert simulation.velocity("hand")[0] == pytest.approx(ZERO, abs=1e-12)


def test_immobile_body_is_like_the_world():
    def build(immobile: bool):
        mechanism = Mechanism()
        stand = {"drive": lambda t: (ZERO, np.eye(3), ZERO, ZERO, ZERO, ZERO), "motion": "immobile"}
        if immobile:
            mechanism.body("stand", ZERO, **stand)
        mechanism.body("bob", 0.4 * X, mass=2.0, w=[1.0, 0.5, 2.0])
        mechanism.joint("ball", "pivot", "bob", "stand" if immobile else None)
        simulation = mechanism.simulation()
        run(simulation, 0.3, 60)
        return mechanism.places(simulation)[-1], simulation.reaction("pivot")

    (one, reaction), (two, same) = build(True), build(False)
    for a, b in zip(one, two, strict=True):
        assert a == pytest.approx(b, abs=1e-13)
    assert reaction[0] == pytest.approx(same[0], abs=1e-10)
