"""Pendulums: energy, path, period and reaction at three step sizes; closed forms where there are some."""

import itertools
import math

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference import joint_rows, rigid_forms


def orders(values) -> list[float]:
    return [math.log2(a / b) for a, b in itertools.pairwise(values)]


def spherical(center_out: float = 0.4) -> Mechanism:
    mechanism = Mechanism()
    mechanism.body("bob", [0.4, 0.0, -0.2], [0.2, 0.1, 0.5], 1.2, (0.02, 0.025, 0.01), v=[0.0, 1.4, 0.2], w=2.0 * Z)
    mechanism.joint("ball", "pivot", "bob")
    return mechanism


def double() -> Mechanism:
    """Two rods on hinges in one plane, let go level: chaotic later, smooth for the first second."""
    mechanism = Mechanism()
    for i in range(2):
        mechanism.body(f"rod{i}", [0.5 * (i + 0.5), 0.0, 0.0], mass=1.0, inertia=(0.001, 0.5**2 / 12, 0.5**2 / 12))
    mechanism.joint("revolute", "first", "rod0", axis=Y)
    mechanism.joint("revolute", "second", "rod1", "rod0", 0.5 * X, axis=Y)
    return mechanism


@pytest.mark.parametrize("build, end", [(spherical, 1.0), (double, 0.8)])
def test_energy_and_path_are_of_second_order(build, end):
    mechanism = build()
    system = mechanism.system()
    truth = system.simulate([end], 1e-10, 1e-11)[-1]
    start = system.energy(system.pack())
    swing = system.mass @ np.abs(system.unpack(truth)[0] - system.unpack(system.pack())[0])[:, 2] * 9.81
    path, drift = [], []
    for n in (60, 120, 240):
        simulation = mechanism.simulation()
        worst = [0.0]

        def watch(report, worst=worst, simulation=simulation):
            worst[0] = max(worst[0], abs(system.energy(mechanism.state_of(simulation)) - start))

        run(simulation, end, n, watch)
        path.append(mechanism.errors(simulation, truth, end, system)["place"])
        drift.append(worst[0])
    assert orders(path) == pytest.approx([2.0, 2.0], abs=0.3), path
    assert orders(drift) == pytest.approx([2.4, 2.4], abs=0.8), drift
    assert drift[-1] < 1e-3 * swing


def test_energy_does_not_drift_over_many_swings():
    mechanism = spherical()
    system = mechanism.system()
    start = system.energy(system.pack())
    simulation = mechanism.simulation()
    seen = []
    for _ in range(15):
        run(simulation, 1.0, 100)
        seen.append(system.energy(mechanism.state_of(simulation)) - start)
    seen = np.array(seen)
    assert np.abs(seen).max() < 4e-3  # 0.1 % of the swing, as in the first second
    assert abs(seen[10:].mean() - seen[:5].mean()) < 1e-3
    x, _, v, w = system.unpack(mechanism.state_of(simulation))
    about_vertical = system.momentum(mechanism.state_of(simulation))[1][2]
    assert about_vertical == pytest.approx(system.momentum(system.pack())[1][2], abs=1e-10)


def test_physical_pendulum_against_elliptic_functions():
    arm, inertia, mass, start = 0.4, 0.13, 2.0, 2.2
    rate = rigid_forms.physical_pendulum_rate(mass, arm, inertia, 9.81)
    mechanism = Mechanism()
    place = arm * np.array([np.sin(start), 0.0, -np.cos(start)])
    mechanism.body("rod", place, -start * Y, mass, (0.11, inertia, 0.05))
    mechanism.joint("revolute", "hinge", "rod", axis=Y)
    end = 1.3
    angle, speed = rigid_forms.pendulum(end, start, rate)
    closed = rigid_forms.physical_pendulum_reaction(angle, speed, mass, arm, inertia, 9.81)
    places, forces = [], []
    for n in (100, 200, 400):
        simulation = mechanism.simulation()
        run(simulation, end, n)
        x = mechanism.places(simulation)[0][0]
        force, _ = simulation.reaction("hinge")
        places.append(np.linalg.norm(x - arm * np.array([np.sin(angle), 0.0, -np.cos(angle)])))
        forces.append(np.linalg.norm(force - [closed[0], 0.0, closed[1]]))
    assert orders(places) == pytest.approx([2.0, 2.0], abs=0.2), places
    assert orders(forces) == pytest.approx([2.0, 2.0], abs=0.3), forces


def test_point_pendulum_of_the_benchmark_collection():
    """A01: 1 kg on a rod of 1 m, let go level, 10 s of 9.81 m/s^2."""
    mechanism = Mechanism()
    mechanism.body("mass", -X)
    mechanism.joint("distance", "rod", "mass", None, -X, at_b=ZERO, rows=joint_rows.distance(1.0), min=1.0, max=1.0)
    simulation = mechanism.simulation()
    run(simulation, 10.0, 2000)
    angle, _ = rigid_forms.pendulum(10.0, np.pi / 2, np.sqrt(9.81))
    place = np.array([-np.sin(angle), 0.0, -np.cos(angle)])
    assert mechanism.places(simulation)[0][0] == pytest.approx(place, abs=2e-3)
    assert abs(mechanism.system().energy(mechanism.state_of(simulation))) < 1e-3


def test_conical_pendulum_goes_round_evenly():
    length, lean = 0.8, 0.6
    rate = rigid_forms.conical_rate(length, lean, 9.81)
    out = length * np.array([np.sin(lean), 0.0, -np.cos(lean)])
    mechanism = Mechanism()
    mechanism.body("mass", out, mass=1.5, v=np.cross(rate * Z, out))
    mechanism.joint("distance", "rod", "mass", None, out, at_b=ZERO, rows=joint_rows.distance(length), max=length)
    mechanism.links[0].fields["min"] = length
    simulation = mechanism.simulation()
    run(simulation, 2.0, 800)
    x = mechanism.places(simulation)[0][0]
    assert x[2] == pytest.approx(out[2], abs=1e-5)
    force, _ = simulation.reaction("rod")
    assert np.linalg.norm(force) == pytest.approx(1.5 * 9.81 / np.cos(lean), rel=1e-4)


@pytest.mark.parametrize("ratio", [1e4, 1e-4])
def test_mass_ratio_of_ten_thousand(ratio):
    mechanism = Mechanism()
    mechanism.body("upper", 0.25 * X, mass=1.0, inertia=(0.02, 0.02, 0.02))
    mechanism.body("lower", 0.75 * X, mass=ratio, inertia=ratio * np.array([0.02, 0.02, 0.02]))
    mechanism.joint("ball", "first", "upper")
    mechanism.joint("ball", "second", "lower", "upper", 0.5 * X)
    system = mechanism.system()
    end = 0.3
    truth = system.simulate([end], 1e-10, 1e-12)[-1]
    seen = []
    for n in (60, 120):
        simulation = mechanism.simulation()

        def held(report):
            assert max(report.position_residual.values()) < 1e-10
            assert max(report.rate_residual.values()) < 1e-10

        run(simulation, end, n, held)
        seen.append(mechanism.errors(simulation, truth, end, system)["place"])
    assert orders(seen) == pytest.approx([2.0], abs=0.4), seen
