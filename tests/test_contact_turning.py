"""Free rigid bodies beside contact under backward Euler: angular momentum is kept, energy never grows."""

import numpy as np
import pytest

import turnbuckle
from turnbuckle.step.contact_turning import implicit_turn


@pytest.mark.parametrize("h", [1e-3, 1e-2, 5e-2])
def test_the_turn_keeps_angular_momentum(h: float) -> None:
    """R(h w) I w = L, in the frame at the start, for bodies of any shape; one that does not tumble keeps its velocity."""
    rng = np.random.default_rng(1)
    inertia = rng.uniform(1.0, 1.9, (40, 3)) * [0.02, 1.0, 1.0]
    w = rng.normal(size=(40, 3)) * 10.0
    w[0] = [0.0, 20.0, 0.0]
    free = implicit_turn(inertia, w, h)
    for k in range(40):
        angle = h * np.linalg.norm(free[k])
        axis = free[k] / np.linalg.norm(free[k])
        x = inertia[k] * free[k]
        turned = x * np.cos(angle) + np.cross(axis, x) * np.sin(angle) + axis * (axis @ x) * (1.0 - np.cos(angle))
        np.testing.assert_allclose(turned, inertia[k] * w[k], atol=1e-12 * np.linalg.norm(inertia[k] * w[k]))
    np.testing.assert_allclose(free[0], w[0], rtol=1e-12)
    assert (np.einsum("bi,bi->b", inertia, free**2) <= np.einsum("bi,bi->b", inertia, w**2) * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.03])
@pytest.mark.parametrize("speed", [[5.0, 10.0, 0.0], [40.0, 20.0, 0.0], [400.0, 300.0, 10.0]])
def test_a_stick_that_tumbles_free_gains_nothing(dt: float, speed: list[float]) -> None:
    scene = turnbuckle.Scene("stick", dt=dt, gravity=[0.0, 0.0, 0.0], contact=True)
    scene.add_obstacle("floor", plane=[1.0, 1.0], position=[0.0, 0.0, -50.0])
    scene.add_rigid("stick", box=[0.3, 0.03, 0.03], mass=1.0, angular_velocity=speed)
    sim = turnbuckle.Simulation(scene)
    energy = [sim.step().energies["kinetic"] for _ in range(100)]
    slow = dt * np.linalg.norm(speed) < 1.0
    assert max(energy) <= energy[0] * (1.0 + 1e-9 if slow else 60.0)  # fast ones: within the ratio of their moments
    if slow:
        assert energy[-1] > 0.5 * energy[0]


def test_a_spinning_stick_that_is_dropped_comes_to_rest() -> None:
    scene = turnbuckle.Scene("drop", dt=0.01, contact={"friction": 0.4})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    scene.add_rigid("stick", box=[0.3, 0.03, 0.03], mass=1.0, position=[0, 0, 0.4], angular_velocity=[5.0, 10.0, 3.0])
    sim = turnbuckle.Simulation(scene)
    reports = [sim.step() for _ in range(150)]
    assert all(r.status == "ok" and r.intersections == 0 for r in reports)
    total = [sum(r.energies[k] for k in ("kinetic", "elastic", "gravity")) for r in reports]
    assert max(total) <= total[0] * (1.0 + 1e-9) and reports[-1].energies["kinetic"] < 1e-6
