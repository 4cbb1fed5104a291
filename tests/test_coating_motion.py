"""Coated bodies in motion: the material holds on its kernel exactly, both ways, whatever the kernel does."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation

SOFT = {name: 0.5 for name in ("k_distance", "k_area", "k_volume")}
DAMPED = {name: 1e-3 for name in ("damping_distance", "damping_area", "damping_volume")}


def coated(scene_fields: dict, material: dict, **kernel: object) -> Simulation:
    scene = Scene("coated", **scene_fields)
    scene.add_rigid("bone", capsule={"radius": 0.04, "length": 0.2}, **kernel)
    scene.add_coating("flesh", around="bone", thickness=0.04, **material)
    scene.add_skin("skin", bodies=["flesh"])
    return Simulation(scene)


def gap(simulation: Simulation) -> float:
    pairs = simulation.state.groups["flesh.kernel"].points.reshape(-1, 2)
    x = simulation.state.positions()
    return float(np.abs(x[pairs[:, 0]] - x[pairs[:, 1]]).max())


def test_a_free_coated_body_keeps_its_momentum_and_its_coat() -> None:
    simulation = coated(
        {"dt": 1e-3, "gravity": (0, 0, 0), "integrator": "velocity_verlet"},
        SOFT,
        velocity=(0.3, -0.1, 0.0),
        angular_velocity=(2.0, 5.0, 1.0),
    )
    model = simulation.model
    bone = model.rigid.names.index("bone")

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        x, v, m = simulation.state.positions(), simulation.state.now.v.numpy(), model.mass[:, None]
        center, (velocity, spin) = simulation.center("bone"), simulation.velocity("bone")
        turn = Rotation.from_quat(simulation.state.rigid.q.numpy()[bone]).as_matrix()
        own = turn @ np.diag(model.rigid.inertia[bone]) @ turn.T @ spin
        mass = model.rigid.mass[bone]
        return (m * v).sum(axis=0) + mass * velocity, (m * np.cross(x, v)).sum(axis=0) + own + mass * np.cross(
            center, velocity
        )

    linear, angular = momenta()
    flesh = model.shape("flesh")
    start = simulation.state.positions()[flesh.begin : flesh.end].copy()
    for _ in range(150):
        report = simulation.step()
        assert report.status == "ok"
    assert gap(simulation) < 2e-12
    after = momenta()
    np.testing.assert_allclose(after[0], linear, atol=1e-12 * np.linalg.norm(linear))
    np.testing.assert_allclose(after[1], angular, rtol=1e-9)
    # it has turned by more than a radian, and the coat went along, bent outwards
    moved = simulation.state.positions()[flesh.begin : flesh.end]
    assert np.linalg.norm(moved - moved.mean(axis=0) - start + start.mean(axis=0), axis=1).max() > 0.05


def test_material_starts_with_the_motion_of_its_kernel() -> None:
    simulation = coated({}, SOFT, position=(1.0, 2.0, 3.0), velocity=(0.3, 0.0, 0.0), angular_velocity=(0.0, 0.0, 5.0))
    flesh = simulation.model.shape("flesh")
    x, v = simulation.state.positions(), simulation.state.now.v.numpy()
    own = slice(flesh.begin, flesh.end)
    wanted = (0.3, 0.0, 0.0) + np.cross((0.0, 0.0, 5.0), x[own] - (1.0, 2.0, 3.0))
    np.testing.assert_allclose(v[own], wanted, atol=1e-13)


def test_on_an_immobile_kernel_the_material_sags_and_comes_to_rest() -> None:
    simulation = coated({"dt": 1e-3}, {**SOFT, **DAMPED}, motion="immobile", rotation=(0.0, np.pi / 2, 0.0))
    start = simulation.state.positions().copy()
    for _ in range(900):
        simulation.step()
    flesh = simulation.model.shape("flesh")
    sag = (simulation.state.positions() - start)[flesh.begin : flesh.end, 2]
    assert gap(simulation) < 2e-12
    assert sag.min() < -1e-4 and sag.max() < 1e-4
    assert np.abs(simulation.state.now.v.numpy()[flesh.begin : flesh.end]).max() < 2e-3


def test_material_follows_a_kernel_on_a_trajectory() -> None:
    keys = {"times": [0.0, 0.5, 1.0], "positions": [[1, 0, 0], [1, 0.3, 0], [1, 0.3, 0.2]]}
    keys["rotations"] = [[0, 0, 0.5], [0.3, 0, 0.5], [1.0, 0, 0]]
    simulation = coated({"dt": 2e-3}, {**SOFT, **DAMPED}, trajectory=keys)
    assert gap(simulation) < 1e-14  # the coat starts where the trajectory does
    skin = simulation.model.shape("skin").skin
    for _ in range(300):
        assert simulation.step().status == "ok"
        assert gap(simulation) < 2e-12
    flesh = simulation.model.shape("flesh")
    x = simulation.state.positions()
    position, _ = simulation.pose("bone")
    assert np.linalg.norm(x[flesh.begin : flesh.end].mean(axis=0) - position) < 5e-3
    assert np.linalg.norm(skin.positions(x).mean(axis=0) - position) < 5e-3


@pytest.mark.parametrize("joint", ["ball", "revolute"])
def test_a_joint_carries_kernel_and_material(joint: str) -> None:
    """At rest the reaction is the weight of both."""
    scene = Scene("hanging", dt=2e-3)
    scene.add_rigid("bone", capsule={"radius": 0.04, "length": 0.2}, linear_damping=3.0, angular_damping=3.0)
    scene.add_coating("flesh", around="bone", thickness=0.04, **SOFT, **DAMPED)
    axis = {} if joint == "ball" else {"axis": (0, 1, 0)}
    scene.add_joint(joint, "hook", body1="bone", anchor=(0.0, 0.0, 0.1), **axis)
    simulation = Simulation(scene)
    for _ in range(800):
        report = simulation.step()
        assert report.status == "ok", report.messages
    weight = 9.81 * (simulation.model.mass.sum() + simulation.model.rigid.mass[1])
    force, _ = simulation.reaction("hook")
    np.testing.assert_allclose(force, (0.0, 0.0, weight), rtol=1e-3, atol=1e-3 * weight)
    assert gap(simulation) < 2e-12
