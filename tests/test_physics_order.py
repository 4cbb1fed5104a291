"""With constraints active every scheme follows the constrained reference, keeps its order, and treats energy as it
does without them."""

import itertools
import math
from functools import cache

import numpy as np
import pendulum
import pytest
from laboratory import Run, nail, rope
from reference import closed_forms, energies, schemes

END = 0.32  # [s]
COUNTS = (32, 64, 128)


@cache
def truth(damping: float) -> tuple[np.ndarray, np.ndarray]:
    """(x, v) of the soft pendulum at END by the fine classical Runge-Kutta reference."""
    p = pendulum.build("rk4", 60.0, damping)
    return schemes.run("rk4", p.x, p.v, p.force, p.run.m, [END / 480] * 480, p.rows)


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_follows_the_constrained_reference_step_by_step(name):
    p = pendulum.build(name, stiffness=200.0, damping=0.5)
    sizes = [4e-3] * 25 + [2.5e-3] * 20 + [6e-3] * 15
    p.run.steps(sizes)
    x, v = schemes.run(name, p.x, p.v, p.force, p.run.m, sizes, p.rows)
    assert np.abs(x - p.x).max() > 0.1  # it has moved
    assert np.abs(p.run.x - x).max() < 1e-10
    assert np.abs(p.run.v - v).max() < 1e-9


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_order_with_constraints_active(name):
    damping = 0.0 if name == "verlet" else 0.2  # the velocity of (2) lags, so that damping costs it an order
    x, v = truth(damping)
    errors = []
    for n in COUNTS:
        p = pendulum.build(name, 60.0, damping)
        p.run.steps([END / n] * n)
        error = np.abs(p.run.x - x).max()
        errors.append(error if name == "verlet" else max(error, np.abs(p.run.v - v).max()))
    for coarse, fine in itertools.pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(schemes.ORDER[name], abs=0.3), errors


ENERGY = {  # largest |energy change| / swing of the potential energy allowed
    "euler_cromer": 0.05,
    "midpoint": 0.02,
    "rk2": 0.02,
    "verlet": 0.05,
    "velocity_verlet": 1e-3,
    "beeman": 2e-3,
    "rk4": 1e-6,
    "newmark": 1e-3,
}


def energy_of(p: pendulum.Pendulum) -> float:
    x, v, m = p.run.x, p.run.v, p.run.m
    elastic = float(energies.energy(p.springs, x))
    return elastic + closed_forms.kinetic_energy(v, m) + closed_forms.gravity_energy(x, m, pendulum.GRAVITY)


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_energy_with_constraints_active(name):
    p = pendulum.build(name, stiffness=80.0, damping=0.0)
    swing = float(p.run.m.sum() * 9.81 * 1.0)
    h, n = (5e-3, 400) if name in schemes.IMPLICIT else (2e-3, 2000)
    start, seen = energy_of(p), []
    for _ in range(n // 20):
        p.run.steps([h] * 20)
        seen.append(energy_of(p) - start)
    seen = np.array(seen) / swing
    if name == "explicit_euler":
        assert seen[-1] > 0.05 and np.all(np.diff(seen[::25]) > 0)  # gains
    elif name == "implicit_euler":
        assert seen[-1] < -0.02 and np.all(np.diff(seen[::25]) < 0)  # loses
    else:
        assert np.abs(seen).max() < ENERGY[name]
    for held in p.held:
        gap, rate = held.residual(p.run.x, p.run.v)
        assert gap < 1e-12 * 2 and rate < 1e-12 * 2


@pytest.mark.parametrize("name", ["verlet", "velocity_verlet", "beeman", "rk2", "midpoint", "rk4"])
def test_period_of_a_stiff_pendulum(name):
    """One heavy bob on one stiff spring is a rigid pendulum of the length of the stretched spring, nearly."""
    length, amplitude, stiffness = 0.5, 1.0, 2e5
    bob = length * np.array([math.sin(amplitude), 0.0, -math.cos(amplitude)])
    scene = {
        "integrator": name,
        "gravity": [0, 0, -9.81],
        "bodies": [rope("rod", np.array([[0, 0, 0], bob]), 2.0, stiffness, 40.0)],
        "constraints": [nail("nail", "rod", 0)],
    }
    run = Run(scene)
    period = closed_forms.pendulum_period(length, 9.81, amplitude)
    n = 2000
    run.steps([period / n] * n)
    assert run.x[1] == pytest.approx(bob, abs=2e-3 * length)
    assert closed_forms.kinetic_energy(run.v, run.m) < 1e-4 * 9.81 * length
