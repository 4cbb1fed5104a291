"""Corotational tetrahedra: rotations, forces, Jacobians, against finite elements of others, and the mechanics of solids."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse.linalg as spla
import warp as wp
from elastic_bodies import (
    force_jacobian,
    minus_gradient,
    model_of,
    random_rotation,
    solid,
    take_apart,
    wobbly_box,
)  # fmt: skip
from laboratory import Run
from reference import fem_tetrahedra

from turnbuckle.bodies.corotational_stiffness import corotational_jacobians, corotational_rows
from turnbuckle.bodies.implicit_system import ImplicitSystem
from turnbuckle.bodies.polar import nearest_rotation
from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import box_tetrahedra

REST = np.array([[0, 0, 0], [1, 0, 0], [0.2, 1.1, 0], [0.3, 0.2, 0.9]], dtype=float)
ONE = np.array([[0, 1, 2, 3]])


@wp.kernel(module="unique", enable_backward=False)
def rotations(f: wp.array(dtype=wp.mat33d), r_out: wp.array(dtype=wp.mat33d)):
    """The rotation nearest to each matrix."""
    i = wp.tid()
    r_out[i] = nearest_rotation(f[i])


def rotations_of(f: np.ndarray) -> np.ndarray:
    out = wp.zeros(len(f), dtype=wp.mat33d)
    wp.launch(rotations, len(f), inputs=[wp.array(f, dtype=wp.mat33d), out])
    return out.numpy()


def test_rotations_are_the_nearest_and_have_determinant_one():
    rng = np.random.default_rng(0)
    f = np.concatenate([rng.standard_normal((2000, 3, 3)), np.eye(3) + 0.2 * rng.standard_normal((2000, 3, 3))])
    f[2000:] = random_rotation(1) @ f[2000:]
    inverted = np.linalg.det(f) < 0
    assert 900 < inverted.sum() < 1200
    r = rotations_of(f)
    assert np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(r) - 1.0).max() < 1e-14
    s = np.linalg.svd(f, compute_uv=False)
    s[inverted, 2] *= -1.0
    reached = np.einsum("nij,nij->n", r, f)
    assert np.abs(reached - s.sum(axis=1)).max() < 1e-14 * s.max()  # the largest R : F that there is
    clear = s[:, 1] + s[:, 2] > 0.1 * s[:, 0]
    want = np.array([fem_tetrahedra.rotation(a) for a in f[clear]])
    assert np.abs(r[clear] - want).max() < 1e-12


def test_rotations_of_degenerate_matrices():
    flat = [np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 0.5, -1e-12]), np.diag([2.0, 1e-9, 1e-12])]
    line, nothing = np.diag([1.0, 0.0, 0.0]), np.zeros((3, 3))
    f = np.array([*flat, line, nothing, -np.eye(3), 1e-150 * np.eye(3), 1e100 * np.eye(3)])
    f = np.concatenate([f, random_rotation(2) @ f])
    r = rotations_of(f)
    assert np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(r) - 1.0).max() < 1e-14
    for k in (0, 1, 2, 4, 6, 7):  # those with one nearest rotation, or nothing at all
        assert np.abs(r[k] - np.eye(3)).max() < 1e-12
    for k in (0, 1, 6, 7):
        assert np.abs(r[8 + k] - random_rotation(2)).max() < 1e-12
    assert np.trace(-r[5]) == pytest.approx(1.0)  # diag(-1, -1, 1) or one like it


@pytest.mark.parametrize("inverted", [False, True])
def test_forces_are_minus_the_gradient_of_the_energy(inverted):
    rng = np.random.default_rng(3)
    system = ImplicitSystem(model_of(solid(REST, ONE)))
    for _ in range(5):
        x = REST + 0.4 * rng.standard_normal(REST.shape)
        if inverted:
            x[3, 2] -= 2.0
        energy, force, _ = fem_tetrahedra.element(REST, x, 100.0, 0.3)
        got = take_apart(system, x)
        assert got.energy == pytest.approx(energy, rel=1e-12)
        assert np.abs(got.elastic - force).max() < 1e-12 * np.abs(force).max()
        assert np.abs(got.elastic - minus_gradient(system, x)).max() < 1e-7 * np.abs(force).max()
        assert np.abs(got.elastic.sum(axis=0)).max() < 1e-13 * np.abs(force).max()
        assert np.abs(np.cross(x, got.elastic).sum(axis=0)).max() < 1e-12 * np.abs(force).max()


def test_a_rigid_motion_costs_nothing_and_a_small_strain_after_it_is_linear():
    rest, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (2, 2, 2))
    system = ImplicitSystem(model_of(solid(rest, tetrahedra)))
    turn = random_rotation(4)
    placed = rest @ turn.T + [3.0, -2.0, 5.0]
    at_rest = take_apart(system, rest)
    scale = np.abs(at_rest.k).max()
    assert np.abs(take_apart(system, placed).elastic).max() < 1e-13 * scale
    u = 1e-6 * np.random.default_rng(5).standard_normal(rest.shape)
    got = take_apart(system, placed + u @ turn.T).elastic @ turn
    want = -(at_rest.k @ u.ravel()).reshape(-1, 3)
    assert np.abs(got - want).max() < 1e-5 * np.abs(want).max()
    big = np.kron(np.eye(len(rest)), turn)
    assert np.abs(take_apart(system, placed).k - big @ at_rest.k @ big.T).max() < 1e-12 * scale


def test_assembled_system_is_that_of_the_reference():
    rest, tetrahedra = wobbly_box((1.0, 0.8, 0.6), (2, 2, 1))
    model = model_of(solid(rest, tetrahedra, damping=0.05))
    assert np.abs(model.mass - fem_tetrahedra.lumped_mass(rest, tetrahedra, 1.0)).max() < 1e-14
    rng = np.random.default_rng(6)
    x, v = rest @ random_rotation(6).T + 0.03 * rng.standard_normal(rest.shape), rng.standard_normal(rest.shape)
    energy, force, k = fem_tetrahedra.assembled(rest, tetrahedra, x, 100.0, 0.3)
    got = take_apart(ImplicitSystem(model, stretched=False), x, v)
    assert got.energy == pytest.approx(energy, rel=1e-12)
    assert np.abs(got.elastic - force).max() < 1e-11 * np.abs(force).max()
    assert np.abs(got.k - k).max() < 1e-12 * np.abs(k).max()
    assert np.abs(got.kv.ravel() + k @ v.ravel()).max() < 1e-11 * np.abs(k).max()
    rested = take_apart(ImplicitSystem(model), rest)
    assert np.abs(rested.d - 0.05 * rested.k).max() < 1e-14 * np.abs(rested.k).max()


def test_stiffness_and_mass_of_another_finite_element_code():
    skfem = pytest.importorskip("skfem")
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    rest, tetrahedra = wobbly_box((1.0, 0.7, 0.5), (3, 2, 2))
    e, nu, density = 3e5, 0.35, 1100.0
    lam, mu = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    mesh = skfem.MeshTet(np.ascontiguousarray(rest.T), np.ascontiguousarray(tetrahedra.T))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))

    @skfem.BilinearForm
    def elasticity(u, v, _):
        strain = sym_grad(u)
        return ddot(2.0 * mu * strain + lam * eye(trace(strain), 3), sym_grad(v))

    @skfem.BilinearForm
    def inertia(u, v, _):
        return density * dot(u, v)

    order = basis.nodal_dofs.T.ravel()  # theirs, in the order of our points
    stiffness = elasticity.assemble(basis).toarray()[np.ix_(order, order)]
    mass = inertia.assemble(basis).toarray()[np.ix_(order, order)]
    model = model_of(solid(rest, tetrahedra, e, nu, density=density))
    got = take_apart(ImplicitSystem(model), rest)
    assert np.abs(got.k - stiffness).max() < 1e-10 * np.abs(stiffness).max()
    assert np.abs(np.repeat(model.mass, 3) - mass.sum(axis=1)).max() < 1e-10 * model.mass.max()  # ours is lumped
    h = 0.03
    a = ImplicitSystem(model).assemble(rest, np.zeros_like(rest), h).toarray()[: rest.size, : rest.size]
    assert np.abs(a - np.diag(mass.sum(axis=1)) - h * h * stiffness).max() < 1e-10 * np.abs(a).max()


@pytest.mark.parametrize("case", ["at ease", "torn", "inverted", "flat", "a line", "a point"])
def test_jacobians_are_positive_semi_definite_and_finite(case):
    rng = np.random.default_rng(7)
    system = ImplicitSystem(model_of(solid(REST, ONE, damping=0.1)))
    for _ in range(10):
        x = REST + 0.1 * rng.standard_normal(REST.shape)
        if case == "torn":
            x *= [3.0, 1.0, 0.3]
        if case == "inverted":
            x[3] = x[3] * [1.0, 1.0, -1.0]
        if case == "flat":
            x[:, 2] = 0.0
        if case == "a line":
            x[:, 1:] = 0.0
        if case == "a point":
            x[:] = 1.0
        v = rng.standard_normal(x.shape)
        got = take_apart(system, x, v)
        for matrix in (got.k, got.d):
            assert np.isfinite(matrix).all() and np.abs(matrix - matrix.T).max() == 0.0
            assert np.linalg.eigvalsh(matrix).min() > -1e-12 * np.abs(matrix).max()
        assert np.isfinite(got.elastic).all() and np.isfinite(got.damping).all()
        assert np.abs(got.kv.ravel() + got.k @ v.ravel()).max() < 1e-12 * np.abs(got.k).max()
        assert np.abs(got.damping.ravel() + got.d @ v.ravel()).max() < 1e-12 * np.abs(got.d).max()
        assert got.power == pytest.approx(-np.sum(v * got.damping), rel=1e-10)
        assert np.abs(got.damping.sum(axis=0)).max() < 1e-12 * np.abs(got.d).max()
        if case in ("at ease", "torn"):  # damping does not see a rotation, and has no moment
            assert np.abs(np.cross(x, got.damping).sum(axis=0)).max() < 1e-12 * np.abs(got.d).max()
            spin = np.cross(rng.standard_normal(3), x)
            assert np.abs(got.d @ spin.ravel()).max() < 1e-12 * np.abs(got.d).max()


def test_stiffness_is_exact_at_rest_and_whole_in_tension():
    system, paper = (ImplicitSystem(model_of(solid(REST, ONE)), stretched=s) for s in (True, False))
    still = np.zeros_like(REST)
    exact = force_jacobian(system, REST, still, "x")
    assert np.abs(take_apart(system, REST).k - exact).max() < 1e-6 * np.abs(exact).max()
    x = REST * 1.6  # stretched alike in all directions: nothing has to be left out
    exact = force_jacobian(system, x, still, "x")
    assert np.abs(take_apart(system, x).k - exact).max() < 1e-6 * np.abs(exact).max()
    assert np.abs(take_apart(paper, x).k - exact).max() > 0.2 * np.abs(exact).max()


def test_dense_jacobians_are_exact():
    rest, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (1, 1, 1))
    model = model_of(solid(rest, tetrahedra, damping=0.2))
    system = ImplicitSystem(model)
    x = rest @ random_rotation(8).T + 0.1 * np.random.default_rng(8).standard_normal(rest.shape)
    parts = corotational_jacobians(model.corotational, x, np.full(len(x), 1e30))
    for by, blocks in zip(("x", "v"), parts, strict=True):
        want = force_jacobian(system, x, np.zeros_like(x), by)
        got = np.zeros_like(want)
        for corners, block in zip(model.corotational.corners, -blocks, strict=True):
            where = (3 * corners[:, None] + np.arange(3)).ravel()
            got[np.ix_(where, where)] += block
        assert np.abs(got - want).max() < 1e-7 * np.abs(want).max()


def test_rows_of_strains_make_the_stiffness():
    rest, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (1, 2, 1))
    model = model_of(solid(rest, tetrahedra, damping=0.2))
    x = rest @ random_rotation(10).T + 0.1 * np.random.default_rng(10).standard_normal(rest.shape)
    want = take_apart(ImplicitSystem(model, stretched=False), x).k
    corners, gradients, k, k_d = corotational_rows(model.corotational, x)
    got = np.zeros_like(want)
    for points, g, stiff in zip(corners, gradients, k, strict=True):
        where = (3 * points[:, None] + np.arange(3)).ravel()
        got[np.ix_(where, where)] += stiff * np.outer(g, g)
    assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()
    assert np.abs(k_d - 0.2 * k).max() == 0.0


@pytest.mark.parametrize("height", [0.0, -0.5])
def test_an_element_without_volume_at_rest_is_named(height):
    model = model_of(solid(REST, ONE))
    rest = model.corotational.rest.copy()
    rest[0, 3, 2] = height
    broken = replace(model, corotational=replace(model.corotational, rest=rest))
    with pytest.raises(
        InputError, match="tetrahedron 0 of corotational solids, of points 0, 1, 2, 3, is flat or inside out"
    ):
        ImplicitSystem(broken)


def test_uniaxial_patch():
    rest, tetrahedra = wobbly_box((1.0, 0.5, 0.5), (4, 3, 3))
    e, nu, strain = 2e4, 0.3, 0.25
    system = ImplicitSystem(model_of(solid(rest, tetrahedra, e, nu)))
    x = rest * [1.0 + strain, 1.0 - nu * strain, 1.0 - nu * strain]
    turn = random_rotation(9)
    force = take_apart(system, x @ turn.T).elastic @ turn
    end = rest[:, 0] == 1.0
    inner = ~end & (rest[:, 0] > 0.0)
    pull = e * strain * 0.25
    assert np.abs(force[inner]).max() < 1e-11 * pull
    assert force[end].sum(axis=0) == pytest.approx([-pull, 0.0, 0.0], abs=1e-11 * pull)
    assert take_apart(system, x).energy == pytest.approx(0.5 * e * strain**2 * 0.25, rel=1e-12)


def test_cantilever_bends_as_beams_do():
    length, side, e, load = 1.0, 0.2, 1e6, 1e-3
    found = []
    for cells in (4, 8):
        rest, tetrahedra = box_tetrahedra((length, side, side), (4 * cells, cells, cells))
        system = ImplicitSystem(model_of(solid(rest, tetrahedra, e, 0.0)))
        n = len(rest)
        a = system.assemble(rest, np.zeros_like(rest), 1.0, alpha=0.0)
        k = a.tocsc()[: 3 * n, : 3 * n]
        free = np.repeat(rest[:, 0] > 0.0, 3)
        force = np.zeros((n, 3))
        tip = rest[:, 0] == length
        force[tip, 2] = -load / tip.sum()
        u = np.zeros(3 * n)
        u[free] = spla.spsolve(k[free][:, free], force.ravel()[free])  # masses of 1e-3 kg are nothing beside 1e6 N/m
        found.append(u.reshape(-1, 3)[tip, 2].mean())
    area, inertia, shear = side**2, side**4 / 12.0, 0.5 * e
    want = -load * (length**3 / (3.0 * e * inertia) + length / (5.0 / 6.0 * shear * area))  # Timoshenko
    assert abs(found[1] / want - 1.0) < 0.35 * abs(found[0] / want - 1.0)  # order two in the size of cells
    assert found[1] == pytest.approx(want, rel=0.06)
    assert (4.0 * found[1] - found[0]) / 3.0 == pytest.approx(want, rel=0.015)


def spinning_cube(scheme: str, damping: float) -> Run:
    rest, tetrahedra = wobbly_box((0.2, 0.2, 0.2), (2, 2, 2))
    body = solid(rest, tetrahedra, 1e5, 0.3, density=1000.0, damping=damping)
    spin = np.array([3.0, -4.0, 12.0])
    return Run({"integrator": scheme, "bodies": [{"name": "cube", **body}]}, None, np.cross(spin, rest - 0.1))


@pytest.mark.parametrize("damping", [0.0, 1e-3])
def test_a_spinning_cube_keeps_momentum_and_volume(damping):
    run = spinning_cube("velocity_verlet", damping)
    corners = run.model.corotational.corners

    def moments() -> np.ndarray:
        p = run.m[:, None] * run.v
        return np.r_[p.sum(axis=0), np.cross(run.x, p).sum(axis=0)]

    def volume() -> float:
        a, b, c = (run.x[corners[:, k]] - run.x[corners[:, 0]] for k in (1, 2, 3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    before, start = moments(), volume()
    run.steps([5e-4] * 1000)  # one turn
    assert np.abs(moments() - before).max() < 1e-11 * np.abs(before).max()
    assert start < volume() < 1.03 * start  # it widens by its own weight: rho (omega r)^2 / E is 0.02


@pytest.mark.parametrize("scheme", ["newmark", "implicit_euler"])
def test_implicit_steps_keep_a_spinning_cube(scheme):
    run = spinning_cube(scheme, 0.0)
    energy = []
    for _ in range(40):
        run.step(5e-3)
        energy.append(run.report.energies["kinetic"] + run.report.energies["elastic"])
    if scheme == "newmark":
        assert abs(energy[-1] / energy[0] - 1.0) < 5e-3
    else:
        assert all(b < a * (1.0 + 1e-12) for a, b in zip(energy, energy[1:], strict=False))
    p = run.m[:, None] * run.v
    assert np.abs(p.sum(axis=0)).max() < 1e-11 * np.abs(p).sum()


@pytest.mark.parametrize("scheme", ["velocity_verlet", "newmark", "implicit_euler"])
def test_an_inverted_tetrahedron_recovers_under_every_kind_of_scheme(scheme):
    x = REST.copy()
    x[3, 2] = -0.5
    body = solid(REST, ONE, 100.0, 0.3, damping=0.05)
    run = Run({"integrator": scheme, "bodies": [{"name": "one", **body}]}, x)
    run.steps([1e-3] * 4000 if scheme == "velocity_verlet" else [2e-2] * 200)
    energy, _, _ = fem_tetrahedra.element(REST, run.x, 100.0, 0.3)
    assert energy < 1e-4
    assert fem_tetrahedra.shape_gradients(run.x)[1] == pytest.approx(fem_tetrahedra.shape_gradients(REST)[1], rel=1e-2)
