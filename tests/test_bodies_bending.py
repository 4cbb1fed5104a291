"""Bending of cloth by the angles between its triangles: gradients, degenerate triangles, strips on cylinders, damping."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_bodies import force_jacobian, minus_gradient, model_of, random_rotation, take_apart
from laboratory import Run

from turnbuckle.bodies.hinge_hessian import bends
from turnbuckle.bodies.implicit_system import ImplicitSystem
from turnbuckle.bodies.stiffness import jacobians
from turnbuckle.data.model import Hinges, Model

PAIR = np.array([[0, 0, 0], [1, 0, 0], [0.4, 0.9, 0], [0.6, -1.1, 0]], dtype=float)
TRIANGLES = np.array([[0, 1, 2], [1, 0, 3]])
SHEET = {"structural_stiffness": 0.0, "shear_stiffness": 0.0, "bend_model": "hinges", "mass": 1.0}


def cloth(points: np.ndarray, triangles: np.ndarray, k: float = 0.7, k_d: float = 0.0, **more) -> dict:
    """Cloth that bends, and does nothing else."""
    mesh = {"vertices": points, "triangles": triangles}
    return {"type": "cloth", **mesh, **SHEET, "bend_stiffness": k, "bend_damping": k_d, **more}


def single(angle: float = 0.0, k_d: float = 0.0) -> Model:
    """One hinge with rest angle ``angle``."""
    model = model_of(cloth(PAIR, TRIANGLES, k_d=k_d))
    return replace(model, hinges=replace(model.hinges, angle=np.array([angle])))


def folded(angle: float) -> np.ndarray:
    """The pair with its second triangle turned down about the shared edge: the normals turn by ``angle``."""
    x = PAIR.copy()
    c, s = np.cos(angle), np.sin(angle)
    x[3, 1:] = [c * PAIR[3, 1], s * PAIR[3, 1]]
    return x


@pytest.mark.parametrize("rest", [0.0, 0.8, -2.0])
@pytest.mark.parametrize("angle", [-3.0, -1.2, -1e-9, 0.0, 0.5, 2.0, 3.1])
def test_energy_of_a_fold(rest, angle):
    system = ImplicitSystem(single(rest))
    x = folded(angle) @ random_rotation(1).T + [1.0, 2.0, 3.0]
    offset = angle - rest
    offset -= 2 * np.pi * np.round(offset / (2 * np.pi))
    assert take_apart(system, x).energy == pytest.approx(0.35 * offset**2, rel=1e-12, abs=1e-15)


def test_forces_are_minus_the_gradient_without_net_force_or_moment():
    rng = np.random.default_rng(2)
    system = ImplicitSystem(single(0.3))
    for _ in range(20):
        x = rng.standard_normal((4, 3))
        got = take_apart(system, x)
        scale = np.abs(got.elastic).max()
        assert np.abs(got.elastic - minus_gradient(system, x)).max() < 1e-6 * max(scale, 1.0)
        assert np.abs(got.elastic.sum(axis=0)).max() < 1e-13 * scale
        assert np.abs(np.cross(x, got.elastic).sum(axis=0)).max() < 1e-12 * scale


def test_jacobian_is_that_of_the_force_at_rest_and_semi_definite():
    rng = np.random.default_rng(3)
    x = rng.standard_normal((4, 3))
    bent = ImplicitSystem(single(float(bends(single(0.0).hinges, x).c[0]), k_d=0.2))
    at_rest = take_apart(bent, x)
    assert at_rest.energy < 1e-25
    exact = force_jacobian(bent, x, np.zeros_like(x), "x")
    assert np.abs(at_rest.k - exact).max() < 1e-6 * np.abs(exact).max()
    for _ in range(10):
        x, v = rng.standard_normal((4, 3)), rng.standard_normal((4, 3))
        got = take_apart(bent, x, v)
        for matrix in (got.k, got.d):
            assert np.abs(matrix - matrix.T).max() == 0.0
            assert np.linalg.eigvalsh(matrix).min() > -1e-12 * np.abs(matrix).max()
        assert np.abs(got.kv.ravel() + got.k @ v.ravel()).max() < 1e-12 * np.abs(got.k).max()
        assert np.abs(got.damping.ravel() + got.d @ v.ravel()).max() < 1e-12 * np.abs(got.d).max()
        assert got.power == pytest.approx(-np.sum(v * got.damping), rel=1e-10)
        exact = force_jacobian(bent, x, np.zeros_like(x), "v")
        assert np.abs(got.d - exact).max() < 1e-7 * np.abs(exact).max()


def test_second_derivatives_of_the_angle():
    rng = np.random.default_rng(4)
    model = single(-0.4)
    system = ImplicitSystem(model)
    for _ in range(5):
        x = rng.standard_normal((4, 3))
        k, _ = jacobians(bends(model.hinges, x), np.zeros_like(x), np.full(4, 1e30))
        order = model.hinges.points[0]
        where = (3 * order[:, None] + np.arange(3)).ravel()
        got = np.zeros((12, 12))
        got[np.ix_(where, where)] = -k[0]
        want = force_jacobian(system, x, np.zeros_like(x), "x")
        assert np.abs(got - want).max() < 1e-6 * np.abs(want).max()


@pytest.mark.parametrize("case", ["first flat", "both flat", "edge gone", "a point", "back to back", "nearly flat"])
def test_degenerate_triangles_push_with_bounded_forces(case):
    rng = np.random.default_rng(5)
    model = single(1.0, k_d=0.1)
    first, second = model.hinges.points[0, 2:]
    x = PAIR + 0.01 * rng.standard_normal(PAIR.shape)
    if case in ("first flat", "both flat"):
        x[first] = 0.3 * x[0] + 0.7 * x[1]
    if case == "both flat":
        x[second] = 1.2 * x[0] - 0.2 * x[1]
    if case == "nearly flat":
        x[first] = 0.3 * x[0] + 0.7 * x[1] + 1e-9 * rng.standard_normal(3)
    if case == "edge gone":
        x[1] = x[0]
    if case == "a point":
        x[:] = 2.0
    if case == "back to back":
        x[second] = x[first]
    system = ImplicitSystem(model)
    got = take_apart(system, x, rng.standard_normal(x.shape))
    largest = 4.0 * 0.7 * np.pi / 0.01  # k pi over the least height that counts
    for values in (got.elastic, got.damping, got.k, got.d, got.kv):
        assert np.isfinite(values).all()
    assert np.abs(got.elastic).max() < largest
    assert np.abs(got.elastic.sum(axis=0)).max() < 1e-12 * largest
    assert np.abs(np.cross(x, got.elastic).sum(axis=0)).max() < 1e-11 * largest


def strip(cells: int, rows: int, length: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat strip of right triangles along x."""
    u, w = np.meshgrid(np.linspace(0.0, length, cells + 1), np.linspace(0.0, width, rows + 1), indexing="ij")
    points = np.stack([u.ravel(), w.ravel(), np.zeros(u.size)], axis=1)
    i, j = np.meshgrid(np.arange(cells), np.arange(rows), indexing="ij")
    a = (i * (rows + 1) + j).ravel()
    b, c, d = a + rows + 1, a + rows + 2, a + 1
    return points, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def on_a_cylinder(points: np.ndarray, radius: float, cells: int, length: float) -> np.ndarray:
    """The strip with its points on a cylinder about y; its cells stay flat and keep their size."""
    turn = 2.0 * np.arcsin(0.5 * length / cells / radius)  # so that chords have the length of cells
    angle = np.round(points[:, 0] / length * cells) * turn
    return np.stack([radius * np.sin(angle), points[:, 1], radius * (1.0 - np.cos(angle))], axis=1)


def test_energy_of_a_strip_on_a_cylinder():
    cells, rows, length, radius, k = 24, 3, 1.2, 0.3, 0.02
    points, triangles = strip(cells, rows, length, 0.3)
    x = on_a_cylinder(points, radius, cells, length)
    system = ImplicitSystem(model_of(cloth(points, triangles, k)))
    turn = 2.0 * np.arcsin(0.5 * length / cells / radius)
    # Each of the `cells - 1` inner generators has `rows` edges; diagonals and edges along the strip stay flat.
    assert take_apart(system, x).energy == pytest.approx((cells - 1) * rows * 0.5 * k * turn**2, rel=1e-12)
    # Forces, by principle of virtual work: rolling it tighter costs what the closed form says.
    tighter = on_a_cylinder(points, radius * (1 - 1e-6), cells, length)
    work = -np.sum(take_apart(system, x).elastic * (tighter - x))
    turn_tighter = 2.0 * np.arcsin(0.5 * length / cells / (radius * (1 - 1e-6)))
    assert work == pytest.approx((cells - 1) * rows * k * turn * (turn_tighter - turn), rel=1e-4)


def test_a_strip_that_starts_bent_stays_bent():
    points, triangles = strip(8, 2, 1.0, 0.2)
    x = on_a_cylinder(points, 0.4, 8, 1.0)
    got = take_apart(ImplicitSystem(model_of(cloth(x, triangles))), x)
    assert got.energy < 1e-28 and np.abs(got.elastic).max() < 1e-13


@pytest.mark.parametrize("scheme", ["velocity_verlet", "newmark"])
def test_a_bent_strip_swings_for_ever_without_damping(scheme):
    points, triangles = strip(6, 1, 0.6, 0.1)
    body = cloth(points, triangles, 0.05, structural_stiffness=50.0)
    x = on_a_cylinder(points, 0.6, 6, 0.6)
    run = Run({"integrator": scheme, "bodies": [{"name": "strip", **body}]}, x)
    energy, bent = [], []
    for _ in range(60):
        run.steps([1e-3] * 10 if scheme == "velocity_verlet" else [1e-2])
        energy.append(run.report.energies["kinetic"] + run.report.energies["elastic"])
        bent.append(run.report.energies["elastic"])
    assert min(bent) < 0.2 * max(bent)
    assert energy[-1] == pytest.approx(energy[0], rel=2e-3)
    if scheme == "velocity_verlet":
        assert np.abs(np.cross(run.x, run.m[:, None] * run.v).sum(axis=0)).max() < 1e-13


def test_damping_takes_what_its_power_says():
    points, triangles = strip(6, 1, 0.6, 0.1)
    body = cloth(points, triangles, 0.05, 2e-2, structural_stiffness=50.0)
    run = Run(
        {"integrator": "velocity_verlet", "bodies": [{"name": "strip", **body}]}, on_a_cylinder(points, 0.6, 6, 0.6)
    )
    system = ImplicitSystem(run.model)
    power, energy = [], []
    for _ in range(1001):
        system.assemble(run.x, run.v, 1e-3)
        power.append(system.dissipation_power())
        energy.append(system.elastic_energy() + 0.5 * np.sum(run.m[:, None] * run.v**2))
        run.step(1e-3)
    assert min(power) >= 0.0 and energy[-1] < 0.1 * energy[0]
    assert energy[0] - energy[-1] == pytest.approx(1e-3 * np.trapezoid(power), rel=5e-3)


def test_hinges_need_not_be_of_one_orientation():
    """A hinge is the same whichever of its triangles, or ends, comes first; only the sign of its angle may turn."""
    rng = np.random.default_rng(8)
    x = rng.standard_normal((4, 3))
    model = single()
    forces = []
    for order in ([0, 1, 2, 3], [1, 0, 3, 2], [0, 1, 3, 2], [1, 0, 2, 3]):
        points = np.array([order], dtype=np.int32)
        hinges = Hinges(points, np.zeros(1), np.full(1, 0.7), np.zeros(1))
        forces.append(take_apart(ImplicitSystem(replace(model, hinges=hinges)), x).elastic)
    for other in forces[1:]:
        assert np.abs(other - forces[0]).max() < 1e-13 * np.abs(forces[0]).max()
