"""Without constraints, every scheme gives the exact discrete state of a harmonic oscillator."""

import numpy as np
import pytest
from laboratory import Run, rope
from reference import oscillator, schemes

TIMES = [(0.01, 70), (0.004, 33), (0.02, 40)]  # the step changes twice
SIZES = [h for h, count in TIMES for _ in range(count)]


@pytest.mark.parametrize("damping", [0.0, 0.9])
@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_two_points_and_a_spring(name, damping):
    """Along its axis a spring is linear: the distance swings with omega^2 = s / mu, the centre flies straight."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    rest, mass, stiffness = 0.8, 3.0, 40.0
    centre, drift, stretch, speed = np.array([0.3, 0.1, -0.4]), np.array([1.0, 2.0, -0.5]), 0.2, -0.7
    points = np.array([0.0 * axis, rest * axis])
    x = centre + np.array([-0.5, 0.5])[:, None] * (rest + stretch) * axis
    v = drift + np.array([-0.5, 0.5])[:, None] * speed * axis
    run = Run({"integrator": name, "bodies": [rope("spring", points, mass, stiffness, damping)]}, x, v)
    assert run.m == pytest.approx([mass / 2, mass / 2], rel=1e-15)
    run.steps(SIZES)
    mu = mass / 4
    want = oscillator.states(name, stretch, speed, stiffness / mu, damping / mu, TIMES)
    got_x, got_v = run.x, run.v
    assert got_x[1] - got_x[0] == pytest.approx((rest + want[0]) * axis, abs=1e-12)
    assert got_v[1] - got_v[0] == pytest.approx(want[1] * axis, abs=1e-11)  # omega = 7 times the digits of x
    assert got_x.mean(0) == pytest.approx(centre + drift * sum(SIZES), abs=1e-12)
    assert got_v.mean(0) == pytest.approx(drift, abs=1e-12)


@pytest.mark.parametrize("name", schemes.EXPLICIT)
def test_a_force_field(name):
    """Three different oscillators along the axes, by a callable, on points of different mass."""
    omega2, gamma = np.array([20.0, 5.0, 60.0]), np.array([0.5, 0.0, 1.0])

    def field(x, v, t, mass):
        return -mass[:, None] * (omega2 * x + gamma * v)

    x = np.array([[0.1, 0.5, -0.3], [0.2, 0.1, 0.7], [-0.4, 0.6, 0.2]])
    v = np.array([[1.0, -2.0, 0.3], [0.0, 0.4, -1.0], [0.5, 0.5, 0.5]])
    bodies = [rope("dust", x, mass=2.0)]
    run = Run({"integrator": name, "bodies": bodies, "forces": [{"callable": field}]}, v=v)
    run.steps(SIZES)
    for i in range(3):
        for axis in range(3):
            want = oscillator.states(name, x[i, axis], v[i, axis], omega2[axis], gamma[axis], TIMES)
            assert run.x[i, axis] == pytest.approx(want[0], abs=1e-12)
            assert run.v[i, axis] == pytest.approx(want[1], abs=1e-11)


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_a_flight_under_gravity(name):
    """Second order and more: the parabola itself. First order: off by h g t / 2, to the side known of each."""
    gravity, v0, h, n = np.array([0.0, -9.81, 0.0]), np.array([3.0, 4.0, -1.0]), 0.01, 100
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    run = Run({"integrator": name, "gravity": gravity, "bodies": [rope("stone", points, 2.0, 1.0)]}, v=[v0, v0])
    run.steps([h] * n)
    t = n * h
    off = {"explicit_euler": -0.5, "euler_cromer": 0.5, "implicit_euler": 0.5}.get(name, 0.0) * h * t * gravity
    assert run.x == pytest.approx(points + v0 * t + gravity * t**2 / 2 + off, abs=1e-12)
    lag = h * gravity if name == "verlet" else 0.0  # the central difference of (2) belongs to the time before
    assert run.v == pytest.approx(np.array([v0 + gravity * t - lag] * 2), abs=2e-12)
