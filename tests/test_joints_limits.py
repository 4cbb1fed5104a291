"""Limits: bounded exactly, hit at speed without gain of energy, both stops, restitution, rest on a stop with its reaction."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference import joint_rows

H = 1e-3
SPIN = np.array([4.0, 1.0, 6.0])


def slider(restitution: float = 0.0, speed: float = 1.0, gravity=ZERO, **limits) -> Mechanism:
    mechanism = Mechanism(gravity=gravity)
    mechanism.body("slider", ZERO, mass=2.0, v=speed * X)
    mechanism.joint("prismatic", "guide", "slider", axis=X, restitution=restitution, **limits)
    return mechanism


def watch(mechanism, name, duration, h=H):
    """Times, places or twists, speeds along x (or about z), energies after every step."""
    system = mechanism.system()
    simulation = mechanism.simulation()
    rows = []

    def each(report):
        state = mechanism.state_of(simulation)
        rows.append([report.time, mechanism.places(simulation)[0][0][0], mechanism.places(simulation)[0][2][0],
                     system.energy(state)])  # fmt: skip
        assert max(report.position_residual.values()) < 1e-10

    run(simulation, duration, round(duration / h), each)
    return simulation, np.array(rows)


def test_slider_stops_where_and_when_it_should():
    mechanism = slider(lower_limit=-0.3, upper_limit=0.25)
    simulation, (time, place, speed, energy) = _columns(watch(mechanism, "guide", 0.5))
    arrival = time[np.argmax(place > 0.25 - 1e-9)]
    assert arrival == pytest.approx(0.25, abs=2 * H)
    assert place.max() <= 0.25 + 1e-10
    assert speed[time < 0.25 - H] == pytest.approx(1.0, abs=1e-12)
    assert speed[time > 0.25 + 2 * H] == pytest.approx(0.0, abs=1e-10)
    assert np.diff(energy).max() < 1e-12
    assert simulation.coordinate("guide")["place"] == pytest.approx(0.25, abs=1e-10)


def _columns(seen):
    simulation, rows = seen
    return simulation, rows.T


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_slider_bounces_between_both_stops(restitution):
    mechanism = slider(restitution, speed=1.3, lower_limit=-0.2, upper_limit=0.25)
    _, (time, place, speed, energy) = _columns(watch(mechanism, "guide", 1.5))
    assert place.max() <= 0.25 + 1e-10 and place.min() >= -0.2 - 1e-10
    assert np.diff(energy).max() < 1e-12
    # speed is 1.3 e^k after k hits
    hits = np.flatnonzero(np.diff(np.sign(speed)))
    expected, way = [0.25 / 1.3], 1.3
    while True:
        way *= restitution
        if expected[-1] + 0.45 / way > 1.5:
            break
        expected.append(expected[-1] + 0.45 / way)
    assert len(hits) == len(expected) >= 2
    assert time[hits] == pytest.approx(expected, abs=3 * H * len(expected))
    for k, hit in enumerate(hits):
        assert abs(speed[hit + 2]) == pytest.approx(1.3 * restitution ** (k + 1), abs=1e-9)


def test_weight_rests_on_a_stop():
    mechanism = Mechanism()
    mechanism.body("weight", ZERO, mass=2.0)
    mechanism.joint("prismatic", "guide", "weight", axis=Z, lower_limit=-0.05)
    simulation = mechanism.simulation()
    run(simulation, 0.4, 400)
    assert mechanism.places(simulation)[0][0] == pytest.approx([0, 0, -0.05], abs=1e-10)
    assert mechanism.places(simulation)[0][2] == pytest.approx([0, 0, 0], abs=1e-10)
    force, _ = simulation.reaction("guide")
    assert force == pytest.approx([0, 0, 2.0 * 9.81], abs=1e-8)


def test_a_stop_pushes_and_never_pulls():
    mechanism = Mechanism()
    mechanism.body("weight", ZERO, mass=2.0)
    mechanism.joint("prismatic", "guide", "weight", axis=Z, lower_limit=-0.05)
    simulation = mechanism.simulation()
    run(simulation, 0.3, 300)
    simulation.push("weight", force=[0, 0, 2.0 * 9.81 + 4.0])
    run(simulation, 0.2, 200)
    assert mechanism.places(simulation)[0][0][2] == pytest.approx(-0.05 + 0.5 * 2.0 * 0.04, abs=1e-8)


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_pendulum_against_a_stop(restitution):
    """A rod falls from level onto a stop 0.5 rad before the lowest place."""
    mechanism = Mechanism()
    mechanism.body("rod", 0.4 * X, mass=1.0, inertia=(0.01, 0.05, 0.05))
    stop = np.pi / 2 - 0.5
    # turning about -y lets the rod fall with a growing angle... about +y z goes to x, x to -z
    mechanism.joint("revolute", "hinge", "rod", axis=Y, upper_limit=stop, lower_limit=-3.0, restitution=restitution)
    system = mechanism.system()
    simulation = mechanism.simulation()
    rows = []

    def each(report):
        state = mechanism.state_of(simulation)
        rows.append(
            (simulation.coordinate("hinge")["twist"], mechanism.places(simulation)[0][3][1], system.energy(state))
        )

    run(simulation, 0.6, 600, each)
    twist, rate, energy = np.array(rows).T
    about = 0.05 + 0.16
    impact = np.sqrt(2 * 9.81 * 0.4 * np.sin(stop) / about)
    assert twist.max() <= stop + 1e-10
    first = int(np.argmax(twist > stop - 1e-6)) if restitution == 0.0 else int(np.argmax(np.diff(rate) < -1.0))
    assert rate[: first + 1].max() == pytest.approx(impact, rel=4e-3)
    assert rate[first + 2] == pytest.approx(-restitution * impact, rel=5e-3, abs=1e-9)
    assert np.diff(energy[first + 2 :]).max() < 1e-4 and energy.max() < 1e-3
    if restitution == 0.0:
        force, torque = simulation.reaction("hinge")
        assert twist[-1] == pytest.approx(stop, abs=1e-10)
        assert torque == pytest.approx([0.0, -9.81 * 0.4 * np.cos(stop), 0.0], abs=1e-6)
        assert force == pytest.approx([0, 0, 9.81], abs=1e-6)


def test_rope_goes_taut_and_slack():
    """A ball thrown up on a rope of 0.5 m: free below, bounded at 0.5, no gain."""
    mechanism = Mechanism()
    mechanism.body("ball", 0.3 * X, v=[0.0, 1.0, 2.5], inertia=(0.01, 0.01, 0.01))
    mechanism.joint("distance", "rope", "ball", None, 0.3 * X, at_b=ZERO, known=False, max=0.5, rows=joint_rows.ball)
    system = mechanism.system()
    velocity = np.array([0.0, 1.0, 2.5])
    simulation = mechanism.simulation()
    lengths, energies, free = [], [], []

    def each(report):
        x, _, v, _ = mechanism.places(simulation)[0]
        lengths.append(np.linalg.norm(x))
        energies.append(system.energy(mechanism.state_of(simulation)))
        flown = 0.3 * X + velocity * report.time - 0.5 * 9.81 * Z * report.time**2
        if max(lengths) < 0.5 - 1e-6:
            free.append(np.linalg.norm(x - flown))

    run(simulation, 2.0, 1000, each)
    assert len(free) > 20 and max(free) < 1e-9
    assert max(lengths) <= 0.5 + 1e-10 and max(lengths) > 0.5 - 1e-9
    assert np.max(np.array(energies) - energies[0]) < 1e-3 * 9.81


def test_cone_and_twist_limits_hold_a_thrown_limb():
    mechanism = Mechanism()
    mechanism.body("limb", -0.2 * Z, mass=1.0, inertia=(0.02, 0.02, 0.004), w=SPIN, v=np.cross(SPIN, -0.2 * Z))
    cone = {"cone": 0.7, "lower_limit": -0.3, "upper_limit": 0.4}
    mechanism.joint("cone_twist", "shoulder", "limb", axis=-Z, rows=joint_rows.ball, **cone)
    system = mechanism.system()
    simulation = mechanism.simulation()
    angles, twists, energies = [], [], [system.energy(system.pack())]

    def each(report):
        c = simulation.coordinate("shoulder")
        angles.append(c["angle"])
        twists.append(c["twist"])
        axis = mechanism.places(simulation)[0][1] @ -Z
        assert c["angle"] == pytest.approx(np.arccos(np.clip(axis @ -Z, -1, 1)), abs=1e-7)
        energies.append(system.energy(mechanism.state_of(simulation)))

    run(simulation, 2.0, 1000, each)
    assert max(angles) <= 0.7 + 1e-10 and max(angles) > 0.69
    assert max(twists) <= 0.4 + 1e-10 and min(twists) >= -0.3 - 1e-10
    assert max(twists) > 0.39 or min(twists) < -0.29
    assert max(energies) < energies[0] + 2e-3


def test_ring_keeps_its_point_between_two_radii():
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("puck", 0.2 * X, v=[0.5, 1.0, 0.0], inertia=(0.01, 0.01, 0.01))
    mechanism.joint("point_to_ring", "ring", "puck", None, 0.2 * X, at_b=ZERO, axis=Z, rows=joint_rows.plane, min=0.15,
                    max=0.3, restitution=1.0)  # fmt: skip
    system = mechanism.system()
    simulation = mechanism.simulation()
    radii, energies = [], []

    def each(report):
        x = mechanism.places(simulation)[0][0]
        assert abs(x[2]) < 1e-10
        radii.append(np.hypot(x[0], x[1]))
        energies.append(system.energy(mechanism.state_of(simulation)))

    run(simulation, 2.0, 1000, each)
    assert max(radii) <= 0.3 + 1e-10 and min(radii) >= 0.15 - 1e-10
    assert max(radii) > 0.299
    start = system.energy(system.pack())
    assert max(energies) < start + 1e-9 and min(energies) > 0.98 * start
