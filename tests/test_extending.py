"""What the page "Extending" shows whole works: a constraint, a force and an integrator of one's own, one file each."""

import itertools
import math
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import turnbuckle
from turnbuckle.integrators import SCHEMES

EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"add_{name}.py"))


def dumbbell(scheme: str, dt: float, response: str = "exact") -> turnbuckle.Simulation:
    """Two points of 1 kg, 0.4 m apart, thrown up with 3 m/s and 10 rad/s."""
    scene = turnbuckle.Scene("dumbbell", dt=dt, integrator=scheme, response=response)
    scene.add_rope("dumbbell", points=[[0, 0, 0], [0.4, 0, 0]], stretch_stiffness=0, mass=2)
    simulation = turnbuckle.Simulation(scene)
    rods = example("a_constraint")["Rods"]("rod", [[0, 1]], simulation.state.positions())
    simulation.stepper.add(rods)
    simulation.state.set_velocities(np.array([[0, 0, 1.0], [0, 0, 5.0]]))
    return simulation


@pytest.mark.parametrize(
    ("scheme", "order"), [("euler_cromer", 1), ("verlet", 2), ("velocity_verlet", 2), ("beeman", 2), ("midpoint", 1)]
)
def test_rods_hold_and_keep_the_order(scheme: str, order: int) -> None:
    end, errors = 0.3, []
    middle = np.array([0.2, 0.0, 3 * end - 0.5 * 9.81 * end**2])
    there = middle + 0.2 * np.array([math.cos(10 * end), 0.0, math.sin(10 * end)])
    for n in (60, 120):
        simulation = dumbbell(scheme, end / n)
        for _ in range(n):
            report = simulation.step()
            assert report.status == "ok", report.messages
            assert report.position_residual["rod"] <= 1e-12 and report.rate_residual["rod"] <= 1e-12
            assert report.momentum_error[0] < 1e-14
        errors.append(np.abs(simulation.positions("dumbbell")[1] - there).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_a_rod_takes_no_energy_and_pulls_with_the_force_of_the_turn() -> None:
    simulation = dumbbell("velocity_verlet", 1e-3)
    energies = []
    for _ in range(600):
        report = simulation.step()
        energies.append(report.energies["kinetic"] + report.energies["gravity"])
    assert np.ptp(energies) < 1e-11
    assert -float(simulation.stepper.scratch.own[0].force.numpy()[0]) == pytest.approx(0.2 * 10**2, rel=1e-3)


def test_rods_beside_the_librarys_constraints() -> None:
    """A chain of two rods hung up by points that are joined: neither kind disturbs the other."""
    scene = turnbuckle.Scene("chain", dt=1e-3)
    for name, x in (("a", 0.0), ("b", 0.3)):
        scene.add_rope(name, points=[[x, 0, 0], [x + 0.3, 0, 0]], stretch_stiffness=0, mass=1)
    scene.add_constraint("points_to_point", "joint", zip=[{"body": "a", "index": 1}, {"body": "b", "index": 0}])
    simulation = turnbuckle.Simulation(scene)
    with pytest.raises(turnbuckle.ConflictError, match="'rod' and 'joint' both hold point 1"):
        simulation.stepper.add(example("a_constraint")["Rods"]("rod", [[0, 1]], simulation.state.positions()))
    simulation.stepper.add(example("a_constraint")["Rods"]("rod", [[0, 3]], simulation.state.positions()))
    report = simulation.run(0.2)
    assert report.status == "ok" and set(report.position_residual) == {"points_to_point", "rod"}


def test_a_miss_is_told() -> None:
    """A constraint that does nothing is caught by its own measure: the step is degraded, and named."""
    simulation = dumbbell("verlet", 1e-3)
    (rods,) = simulation.stepper.scratch.own
    rods.land = rods.project = lambda *_: None
    report = simulation.step()
    assert report.status == "degraded" and any("'rod' is missed by" in m for m in report.messages)


@pytest.mark.parametrize(
    ("ends", "scheme", "message"),
    [
        ([[0, 1], [1, 2]], "verlet", "each point stands once"),
        ([[0, 9]], "verlet", "points must be from 0 to 2"),
        ([[0, 1]], "implicit_euler", "do not act under implicit_euler"),
        ([[0, 1]], "explicit_euler", "do not act under explicit_euler"),
    ],
)
def test_what_cannot_act_is_refused(ends: list, scheme: str, message: str) -> None:
    scene = turnbuckle.Scene("rope", integrator=scheme)
    scene.add_rope("rope", points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], stretch_stiffness=1, mass=1)
    simulation = turnbuckle.Simulation(scene)
    rods = example("a_constraint")["Rods"]("rod", [[0, 1]], simulation.state.positions())
    rods.points = np.ravel(ends)
    with pytest.raises(turnbuckle.InputError, match=message):
        simulation.stepper.add(rods)


def test_an_integrator_has_its_order_with_a_nail_and_keeps_energy() -> None:
    page = example("an_integrator")
    try:
        truth, _ = page["swing"](1600, "rk4")
        found = [page["swing"](n) for n in (50, 100, 200)]
    finally:
        SCHEMES.pop("leapfrog")
    errors = [np.abs(place - truth).max() for place, _ in found]
    for coarse, fine in itertools.pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(page["Leapfrog"].order, abs=0.1)


def test_a_force_is_the_gradient_of_its_energy_and_keeps_momenta() -> None:
    page = example("a_force")
    rng = np.random.default_rng(1)
    x, mass = rng.uniform(-1.0, 1.0, (5, 3)), rng.uniform(0.5, 2.0, 5)
    assert page["gradient_error"](x, mass) < 1e-14
    force = page["attraction"](x, np.zeros_like(x), 0.0, mass)
    assert np.abs(force.sum(axis=0)).max() < 1e-12 and np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-12
