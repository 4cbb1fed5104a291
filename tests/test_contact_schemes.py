"""Every integration scheme beside contact: its own order away from contact, the same rest and friction where it touches."""

from collections.abc import Callable

import numpy as np
import pytest

import turnbuckle
from turnbuckle.compute import host

EXPLICIT = ("explicit_euler", "euler_cromer", "midpoint", "rk2", "verlet", "velocity_verlet", "beeman", "rk4")
ALL = (*EXPLICIT, "implicit_euler", "newmark")
MU = 0.4


def sliding(integrator: str, dt: float = 2e-3, **contact: object) -> turnbuckle.Simulation:
    """A cloth that falls flat, and a rigid box thrown over the ground."""
    scene = turnbuckle.Scene(
        "sliding", dt=dt, integrator=integrator, contact={"delta": 4e-3, "friction": MU, **contact}
    )
    scene.add_obstacle("ground", plane=[4, 4])
    scene.add_cloth(
        "cloth", size=[0.4, 0.4], cells=[2, 2], position=[-0.5, -0.2, 0.01], density=0.5, structural_stiffness=50.0,
        shear_stiffness=20.0, damping=0.05,
    )  # fmt: skip
    scene.add_rigid("box", box=[0.2, 0.2, 0.05], position=[0.5, 0, 0.0292], density=500.0, velocity=[0.5, 0, 0])
    return turnbuckle.Simulation(scene)


@pytest.mark.parametrize("integrator", ALL)
def test_a_thrown_box_slides_as_far_as_friction_says(integrator: str) -> None:
    simulation = sliding(integrator)
    for _ in range(75):
        report = simulation.step()
        assert report.status == "ok", report.messages
        assert report.smallest_gap is None or report.smallest_gap > 0.0
    way = 0.5**2 / (2 * MU * 9.81)
    assert simulation.center("box")[0] - 0.5 == pytest.approx(way, rel=0.03)
    assert np.abs(np.concatenate(simulation.velocity("box"))).max() < 2e-3  # at rest: no scheme shows a false speed
    still = np.abs(simulation.velocities("cloth")).max()
    assert still < (
        0.6 * 9.81 * simulation.dt if integrator == "verlet" else 2e-3
    )  # v of Verlet is that of one step ago, as printed
    assert simulation.positions("cloth")[:, 2].min() > 3e-3


def test_a_scheme_is_left_alone_where_nothing_touches() -> None:
    """Away from contact, the same bits as without it."""

    def run(integrator: str, contact: bool) -> np.ndarray:
        options = {"contact": {"delta": 4e-3}} if contact else {}
        scene = turnbuckle.Scene("free", dt=2e-3, integrator=integrator, gravity=[0, 0, -1.0], **options)
        scene.add_cloth(
            "cloth", size=[0.4, 0.4], cells=[3, 3], density=0.5, structural_stiffness=30.0, shear_stiffness=10.0,
            damping=0.02,
        )  # fmt: skip
        scene.add_rigid("box", box=[0.3, 0.2, 0.1], position=[3, 0, 0], mass=1.0, angular_velocity=[1, 2, 0.5])
        scene.add_constraint("nail", "n", points=[{"body": "cloth", "index": 0}])
        simulation = turnbuckle.Simulation(scene)
        for _ in range(30):
            assert simulation.step().status == "ok"
        return np.concatenate([simulation.positions(), simulation.velocities()])

    for integrator in ("velocity_verlet", "verlet", "rk4", "beeman"):
        assert np.array_equal(run(integrator, True), run(integrator, False))


def _pendulum(integrator: str, dt: float, newton: int = 1, k: float = 2000.0) -> turnbuckle.Simulation:
    """A mass on a stiff spring at a nail, thrown sideways; a box that turns freely; both far from anything."""
    scene = turnbuckle.Scene("pendulum", dt=dt, integrator=integrator, contact={"delta": 1e-3, "newton": newton})
    scene.add_rope("rod", points=[[0, 0, 0], [0.5, 0, 0]], mass=2.0, stretch_stiffness=k)
    scene.add_rigid("box", box=[0.3, 0.2, 0.1], position=[5, 0, 0], mass=1.0, angular_velocity=[3, 1, 0.5])
    scene.add_constraint("nail", "n", points=[{"body": "rod", "index": 0}])
    return turnbuckle.Simulation(scene)


def _errors(make: Callable[[float], turnbuckle.Simulation], steps: tuple[int, ...], exact: int) -> np.ndarray:
    def end(n: int) -> np.ndarray:
        simulation = make(0.2 / n)
        for _ in range(n):
            assert simulation.step().status == "ok"
        place, q = simulation.pose("box")
        speeds = np.concatenate(simulation.velocity("box"))
        return np.concatenate([simulation.positions("rod")[1], simulation.velocities("rod")[1], place, q, speeds])

    reference = end(exact)
    return np.array([np.abs(end(n) - reference) for n in steps])


def test_newmark_is_of_order_two_for_points_and_bodies() -> None:
    first, second = _errors(lambda dt: _pendulum("newmark", dt, k=100.0), (40, 80), 640)
    slope = np.log2(first.max() / second.max())
    assert 1.8 < slope < 2.3
    assert 1.7 < np.log2(first[6:].max() / second[6:].max()) < 2.3  # of the body alone


def _chain(newton: int, k: float) -> turnbuckle.Simulation:
    scene = turnbuckle.Scene("chain", dt=0.03, integrator="implicit_euler", contact={"delta": 1e-3, "newton": newton})
    scene.add_rope("rod", points=[[0.5 * i, 0, 0] for i in range(4)], mass=3.0, stretch_stiffness=k)
    scene.add_rigid("far", box=[0.3, 0.2, 0.1], position=[9, 0, 0], motion="immobile")
    scene.add_constraint("nail", "n", points=[{"body": "rod", "index": 0}])
    return turnbuckle.Simulation(scene)


def _missed(simulation: turnbuckle.Simulation, v0: np.ndarray, k: float) -> float:
    """What the committed step leaves of ``M (v1 - v0) = h F(x1)`` [N s], of the points that are not nailed."""
    x, v, h = simulation.positions("rod"), simulation.velocities("rod"), simulation.dt
    mass = simulation.model.mass[: len(x), None]
    d = x[1:] - x[:-1]
    length = np.linalg.norm(d, axis=1)[:, None]
    pull = k * (length - 0.5) * d / length
    force = mass * np.array([0, 0, -9.81])
    force[:-1] += pull
    force[1:] -= pull
    return float(np.abs(mass * (v - v0) - h * force)[1:].max())


def test_newton_iterations_converge_quadratically(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turnbuckle.step.contact_gains.GAINED", np.inf)  # no more iterations than asked for
    k, left = 5000.0, []
    for newton in (1, 2, 3, 4, 5):
        simulation = _chain(newton, k)
        v = np.array(simulation.velocities())
        v[1:4] = [[0.0, 3.0, -2.0], [1.0, -4.0, 3.0], [4.0, 2.0, -6.0]]
        simulation.state.set_velocities(v)
        assert simulation.step().status == "ok"
        left.append(_missed(simulation, v[:4], k))
    assert left[0] > 1.0 and left[4] < 2e-6  # to what the solver of each iteration leaves
    assert all(b < a * a for a, b in zip(left[1:], left[2:], strict=False)), left


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 3e-2])
def test_springs_that_are_struck_gain_nothing(dt: float) -> None:
    """Cloth that lands on a ball, and a plate at 50 m/s in a net that is nailed: one linearisation from afar is not enough."""
    fall = turnbuckle.Scene("fall", dt=dt, contact={"friction": 0.3})
    fall.add_obstacle("ball", sphere=0.15, position=[0, 0, 0.16])
    springs = {"structural_stiffness": 500.0, "shear_stiffness": 500.0}
    fall.add_cloth("cloth", size=[0.7, 0.7], cells=[8, 8], position=[-0.35, -0.35, 0.33], **springs)
    hit = turnbuckle.Scene("hit", dt=dt, gravity=[0.0, 0.0, 0.0], contact={"friction": 0.3})
    springs = {"structural_stiffness": 5000.0, "shear_stiffness": 1000.0, "damping": 0.05}
    hit.add_cloth(
        "net", size=[0.6, 0.6], cells=[6, 6], position=[0.3, -0.3, -0.3], rotation=[0, -np.pi / 2, 0], **springs
    )
    hit.add_constraint("nail", "low", points={"body": "net", "side": "-z"})
    hit.add_constraint("nail", "high", points={"body": "net", "side": "+z"})
    hit.add_rigid(
        "plate", box=[0.2, 0.1, 0.002], mass=0.05, position=[-0.1, 0, 0], rotation=[0, 0.3, 0], velocity=[50, 0, 0]
    )
    for scene in (fall, hit):
        simulation = turnbuckle.Simulation(scene)
        reports = [simulation.step() for _ in range(25)]
        assert all(r.status == "ok" for r in reports)
        totals = [sum(r.energies[k] for k in ("kinetic", "elastic", "gravity")) - r.energies["work"] for r in reports]
        assert (np.diff(totals) <= 0.02 * (abs(totals[0]) + 1e-12)).all()


@pytest.mark.parametrize("integrator", ["velocity_verlet", "newmark"])
def test_impacts_never_gain_energy(integrator: str) -> None:
    scene = turnbuckle.Scene("fall", dt=2e-3, integrator=integrator, contact={"delta": 4e-3, "friction": 0.3})
    scene.add_obstacle("ground", plane=[4, 4])
    scene.add_solid(
        "soft", box={"size": [0.2, 0.2, 0.2], "cells": [1, 1, 1]}, position=[0, 0, 0.1], youngs_modulus=1e4,
        poissons_ratio=0.3, density=300.0, rotation=[0.3, 0.2, 0], velocity=[0.3, 0, -0.5],
    )  # fmt: skip
    scene.add_rigid("ball", sphere=0.05, position=[1, 0, 0.08], density=500.0, velocity=[0.4, 0, -1.0])
    simulation = turnbuckle.Simulation(scene)
    totals = []
    for _ in range(120):
        report = simulation.step()
        assert report.status == "ok", report.messages
        totals.append(sum(report.energies[name] for name in ("kinetic", "elastic", "gravity")))
    assert max(totals[1:]) <= totals[0] * 1.002
    assert totals[-1] < 0.95 * totals[0]  # both have hit the ground


def test_joints_and_scripts_hold_beside_contact_under_an_explicit_scheme() -> None:
    """A hammer on a hinge falls on a platform that rises; the joint stays closed, the platform goes where it is told."""
    scene = turnbuckle.Scene("hammer", dt=2e-3, integrator="velocity_verlet", contact={"delta": 4e-3})
    keys = {"times": [0.0, 0.4], "positions": [[0, 0, -0.2], [0, 0, -0.1]], "interpolation": "linear"}
    scene.add_obstacle("platform", box=[0.6, 0.6, 0.1], trajectory=keys)
    scene.add_rigid("head", box=[0.1, 0.1, 0.1], position=[0.2, 0, 0], density=500.0)
    scene.add_constraint("revolute", "hinge", body1="head", anchor=[-0.2, 0, 0], axis=[0, 1, 0])
    simulation = turnbuckle.Simulation(scene)
    touched = 0
    for _ in range(150):
        report = simulation.step()
        assert report.status == "ok", report.messages
        assert report.position_residual["joint"] < 1e-9
        touched += report.touching > 0
    assert touched > 40
    top = simulation.positions("platform")[:, 2].max()
    assert top == pytest.approx(-0.15 + 0.1 * simulation.time / 0.4, abs=1e-12)


@pytest.mark.parametrize("dt", [0.01, 0.005])
def test_newmark_keeps_the_spin_of_a_cloth_that_touches_nothing(dt: float) -> None:
    """Each solve of a step is of the linearisation of that moment: a stale one takes nearly all angular momentum."""
    scene = turnbuckle.Scene("spin", dt=dt, gravity=[0.0, 0.0, 0.0], integrator="newmark", contact=True)
    scene.add_obstacle("table", plane=[1.0, 1.0], position=[0.0, 0.0, -1.0])
    x = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 5), indexing="ij"), axis=-1).reshape(
        -1, 2
    )
    scene.add_cloth("cloth", size=[0.2, 0.2], cells=[4, 4], position=[-0.1, -0.1, 0.0], mass=0.02)
    simulation = turnbuckle.Simulation(scene)
    state, model = simulation.state, simulation.model
    points = model.mass > 0.0
    place = state.positions()
    v = np.zeros_like(place)
    v[points] = 10.0 * np.cross([0.0, 0.0, 1.0], place[points])
    state.now.v.assign(v)

    def spin() -> float:
        here, speed = simulation.state.positions(), host(simulation.state.now.v)
        return float((model.mass[points, None] * np.cross(here[points], speed[points])).sum(axis=0)[2])

    before = spin()
    assert before > 1e-4 and len(x) == points.sum()
    for _ in range(round(0.2 / dt)):
        assert simulation.step().status == "ok"
    assert spin() == pytest.approx(before, rel=0.1)
