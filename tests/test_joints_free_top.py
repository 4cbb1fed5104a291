"""Torque-free tumbling against the elliptic solution, and tops and gyroscopes under gravity."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, Y, Z, run
from reference import rigid_forms
from reference.free_top import FreeTop
from reference.multibody import angle_between

INERTIA = np.array([0.02, 0.035, 0.05])


def tumble(w, turns: int, steps_a_turn: int = 100) -> None:
    w = np.asarray(w, dtype=float)
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("top", ZERO, inertia=INERTIA, w=w)
    system = mechanism.system()
    top = FreeTop(INERTIA, w)
    turn = 2 * np.pi / np.linalg.norm(w)
    energy = system.energy(system.pack())
    momentum = system.momentum(system.pack())[1]
    simulation = mechanism.simulation()
    for _ in range(10):
        run(simulation, turn * turns / 10, steps_a_turn * turns // 10)
        state = mechanism.state_of(simulation)
        assert system.energy(state) == pytest.approx(energy, rel=1e-6)
        assert np.linalg.norm(system.momentum(state)[1] - momentum) < 1e-6 * np.linalg.norm(momentum)
        (_, r, _, _) = mechanism.places(simulation)[0]
        assert angle_between(r, top.attitude(simulation.time)) < 1e-6


@pytest.mark.parametrize("w", [(0.2, 3.0, 0.1), (2.0, 1.0, 3.0), (0.05, 0.02, 4.0)])
def test_tumbling_follows_the_elliptic_solution(w):
    tumble(w, 20)


@pytest.mark.slow
@pytest.mark.parametrize("w", [(0.2, 3.0, 0.1), (2.0, 1.0, 3.0)])
def test_a_thousand_turns(w):
    tumble(w, 1000)


@pytest.mark.parametrize("fast", [0, 1])
def test_heavy_top_precesses_steadily(fast):
    mass, arm, axial, across, spin, lean = 1.5, 0.2, 0.01, 0.006, 120.0, 0.7
    rate = rigid_forms.steady_precession(spin, lean, axial, across + mass * arm**2, mass, arm, 9.81)[fast]
    axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
    w = rate * Z + (spin - rate * np.cos(lean)) * axis
    mechanism = Mechanism()
    mechanism.body("top", arm * axis, lean * Y, mass, (across, across, axial), w=w, v=np.cross(w, arm * axis))
    mechanism.joint("ball", "point", "top")
    end, errors = 0.25, []
    place = arm * (np.cos(rate * end) * np.array([axis[0], 0, 0]) + np.sin(rate * end) * np.array([0, axis[0], 0]))
    place[2] = arm * axis[2]
    for n in (500, 1000):
        simulation = mechanism.simulation()
        run(simulation, end, n)
        errors.append(np.linalg.norm(mechanism.places(simulation)[0][0] - place))
    assert errors[1] < 2e-3 * arm
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8)


def test_gyroscope_in_a_frame_holds_its_direction():
    """A wheel that spins in a frame on a ball joint through its centre: what the frame does, the axle barely follows."""
    mechanism = Mechanism()
    mechanism.body("frame", ZERO, mass=0.5, inertia=(2e-4, 2e-4, 2e-4))
    mechanism.body("wheel", ZERO, mass=1.0, inertia=(1e-3, 1e-3, 2e-3), w=300.0 * Z)
    mechanism.joint("ball", "stand", "frame")
    mechanism.joint("revolute", "axle", "wheel", "frame")
    system = mechanism.system()
    simulation = mechanism.simulation()
    run(simulation, 0.5, 1000)
    assert mechanism.places(simulation)[1][1][:, 2] == pytest.approx([0, 0, 1], abs=1e-9)
    before = system.momentum(mechanism.state_of(simulation))[1]
    simulation.push("frame", torque=[0.5, 0.0, 0.0])
    run(simulation, 0.2, 1000)
    after = system.momentum(mechanism.state_of(simulation))[1]
    assert after - before == pytest.approx([0.1, 0.0, 0.0], abs=1e-6)
    # the axle leans the way of the torque and nutates about it by no more than torque / (L nutation rate)
    axle = mechanism.places(simulation)[1][1][:, 2]
    assert axle[0] == pytest.approx(0.1 / 0.6, rel=0.05)
    assert abs(axle[1]) < 0.02
