"""The ready scenes, small, run: they move as they should, and every constraint holds on the way."""

import importlib.util

import numpy as np
import pytest

from turnbuckle.meshes.shapes import box_tetrahedra
from turnbuckle.scenes import REGISTRY
from turnbuckle.scenes.curtain_geometry import curtain_geometry
from turnbuckle.step.simulation import Simulation


def run(simulation: Simulation, seconds: float) -> None:
    """Steps for `seconds`; each must be finite, exact, and `ok` unless a ramp is under way."""
    for _ in range(round(seconds / simulation.dt)):
        report = simulation.step()
        assert report.status == "ok" or (report.status == "degraded" and report.ramping > 0), report.messages
        assert report.worst_residual <= 1e-12 * simulation.model.size


def closest_on_triangles(p: np.ndarray, corners: np.ndarray) -> float:
    """Distance [m] of a point to triangles (n, 3, 3): to the planes where the foot is inside, else to the edges."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("ij,ij->i", p - a, normal)
    foot = p - height[:, None] * normal
    inside = np.ones(len(a), dtype=bool)
    nearest = np.inf
    for u, v in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(v - u, foot - u), normal) >= 0.0
        t = np.clip(np.einsum("ij,ij->i", p - u, v - u) / np.einsum("ij,ij->i", v - u, v - u), 0.0, 1.0)
        nearest = min(nearest, np.linalg.norm(u + t[:, None] * (v - u) - p, axis=1).min())
    return min(nearest, np.abs(height[inside]).min(initial=np.inf))


def fit(x: np.ndarray, y: np.ndarray) -> float:
    """Root mean square distance [m] of points x from y after the best rigid motion (Kabsch)."""
    a, b = x - x.mean(axis=0), y - y.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return float(np.sqrt(((a @ u @ turn @ vt - b) ** 2).sum(axis=1).mean()))


def test_curtain_sways_then_falls_apart() -> None:
    geometry = curtain_geometry(4, 8)
    simulation = Simulation(REGISTRY["curtain"](m=4, rows=8, release_at=0.6))
    start = simulation.positions().copy()
    hem = start[:, 1] < start[:, 1].min() + 1e-9
    run(simulation, 0.3)
    assert (simulation.positions() - start)[hem, 2].mean() > 0.1  # swung out along z
    assert geometry.worst_gap(simulation.positions()) < 1e-12
    run(simulation, 0.7)
    fallen = simulation.positions()
    assert fallen[:, 1].max() < start[:, 1].max() - 0.4  # free fall for 0.4 s, the top is 0.78 m down
    # The cubes have come apart, and each is a cube again.
    assert np.linalg.norm(fallen[geometry.pairs[:, 0]] - fallen[geometry.pairs[:, 1]], axis=1).max() > 0.01
    edges = np.linalg.norm(fallen.reshape(-1, 8, 3)[:, 1] - fallen.reshape(-1, 8, 3)[:, 0], axis=1)
    assert np.allclose(edges, 0.1, rtol=0.1)


def test_robot_slides_along_the_ropes() -> None:
    simulation = Simulation(REGISTRY["robot_on_ropes"](dt=1.2e-4))
    shapes = {shape.name: shape for shape in simulation.model.shapes}
    constraints = simulation.scene.definition.constraints
    index = next(c for c in constraints if c.name == "left_hand").points[0].index
    start = simulation.positions("left_forearm")[index].copy()
    rope = shapes["left_rope"]
    for _ in range(4):
        run(simulation, 0.24)
        at = simulation.positions("left_forearm")[index]
        corners = simulation.positions("left_rope")[rope.triangles]
        assert closest_on_triangles(at, corners) < 1e-12
    moved = at - start
    assert moved[1] > 1.0 and moved[2] < -0.2  # forwards and down
    head, torso = simulation.positions("head"), simulation.positions("torso")
    assert np.linalg.norm(head.mean(axis=0) - torso.mean(axis=0)) == pytest.approx(0.35, rel=0.1)  # in one piece


def test_a_mesh_slides_in_place_of_the_robot(tmp_path) -> None:
    meshio = pytest.importorskip("meshio")
    points, cells = box_tetrahedra((0.5, 0.3, 1.0), (2, 2, 3))
    meshio.write_points_cells(tmp_path / "box.vtk", points, [("tetra", cells)])
    simulation = Simulation(REGISTRY["robot_on_ropes"](mesh=str(tmp_path / "box.vtk"), dt=1.2e-4))
    start = simulation.positions("robot").copy()
    run(simulation, 0.7)
    assert (simulation.positions("robot") - start)[:, 1].mean() > 0.2


def test_net_becomes_a_bridge() -> None:
    scene = REGISTRY["net_to_bridge"](columns=12, lanes=4, change_at=0.4, closing=0.5)
    simulation = Simulation(scene)
    start = simulation.positions().copy()
    run(simulation, 0.39)
    sag = start - simulation.positions()
    assert sag[:, 2].max() > 0.05  # the net hangs
    run(simulation, 0.9)
    x = simulation.positions()
    cubes = x.reshape(12, 4, 8, 3).mean(axis=2)
    assert np.ptp(cubes[..., 1]) == pytest.approx(0.3, abs=0.05)  # four lanes side by side
    assert np.ptp(cubes[..., 0]) > 0.9
    along = np.linalg.norm(np.diff(cubes, axis=0), axis=2)
    assert along.max() < 0.16  # every cube next to the one before
    assert simulation.step().active == {"nail": 2 * 4 * 4, "points_to_point": 2 * 11 * 4 + 2 * (2 * 2 + 1)}


@pytest.mark.parametrize("mode", ["closing", "paper"])
def test_parts_gather_into_a_ball(mode: str) -> None:
    options = {"divisions": 1, "start": 0.1, "gathering": 0.3, "mode": mode}
    simulation = Simulation(REGISTRY["self_assembly"](**options))
    ball = Simulation(REGISTRY["self_assembly"](**options, spread=0.0, tumble=0.0)).positions()
    start = simulation.positions().copy()
    assert fit(start, ball) > 0.3
    run(simulation, 0.09)
    assert np.linalg.norm(simulation.positions() - start, axis=1).mean() > 0.02  # flying
    run(simulation, 1.4)
    report = simulation.step()
    assert report.status == "ok" and report.active["points_to_point"] == simulation.residuals("seams").shape[0]
    assert fit(simulation.positions(), ball) < (0.06 if mode == "closing" else 0.5)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_soft_mesh_hangs_alike_at_every_size(scale: float) -> None:
    scene = REGISTRY["soft_mesh"](scale=scale)
    simulation = Simulation(scene)
    start = simulation.positions().copy()
    held = start[:, 0] < start[:, 0].min() + 0.08 * scale
    for _ in range(round(0.12 * scene.definition.duration / simulation.dt)):
        report = simulation.step()
        assert report.status == "ok"
    moved = (simulation.positions() - start) / scale
    assert np.abs(moved[held]).max() < 1e-14
    assert -0.6 < moved[:, 2].min() < -0.1
    assert simulation.time / scene.definition.duration == pytest.approx(0.12, rel=0.01)


def test_soft_mesh_takes_a_surface(tmp_path) -> None:
    trimesh = pytest.importorskip("trimesh")
    if importlib.util.find_spec("pytetwild") is None:
        pytest.skip("needs pytetwild")
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.4)
    ball.export(tmp_path / "ball.stl")
    scene = REGISTRY["soft_mesh"](mesh=str(tmp_path / "ball.stl"), thickness=0.3)
    simulation = Simulation(scene)
    assert simulation.model.shapes[0].skin is not None
    start = simulation.positions().copy()
    for _ in range(400):
        assert simulation.step().status == "ok"
    assert (simulation.positions() - start)[:, 2].min() < -1e-3
