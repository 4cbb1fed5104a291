"""The assembled system of an implicit step: all kinds of elements together, rigid bodies, points without mass, orders."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse.linalg as spla
import warp as wp
from elastic_bodies import force_jacobian, minus_gradient, model_of, random_rotation, solid, take_apart, wobbly_box
from laboratory import Run
from reference import energies
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import turnbuckle
from turnbuckle.bodies.implicit_system import ImplicitSystem
from turnbuckle.compute import Program
from turnbuckle.data.model import Model
from turnbuckle.linalg.block_matrix import block_multiply, diagonal_blocks, invert_diagonal

K, K_D = (3.0, 2.0, 5.0), (0.06, 0.04, 0.1)
CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


def teschner(vertices: np.ndarray, tetrahedra: np.ndarray) -> dict:
    names = ("distance", "area", "volume")
    stiffness = {f"k_{name}": value for name, value in zip(names, K, strict=True)}
    damping = {f"damping_{name}": value for name, value in zip(names, K_D, strict=True)}
    return {"type": "solid", "vertices": vertices, "tetrahedra": tetrahedra, "mass": 2.0, **stiffness, **damping}


def rope(k: float = 50.0, c: float = 0.4) -> dict:
    points = np.cumsum(np.random.default_rng(1).uniform(0.1, 0.5, (6, 3)), axis=0)
    return {"type": "rope", "points": points, "mass": 1.0, "stretch_stiffness": k, "damping": c}


def crowd() -> Model:
    """One of each: a rope, cloth with hinges, a Teschner solid, a corotational solid, two rigid bodies, the world."""
    vertices, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (1, 2, 1))
    sheet = {"type": "cloth", "size": [1.0, 0.7], "cells": [3, 2], "mass": 1.0, "structural_stiffness": 40.0}
    sheet |= {
        "shear_stiffness": 9.0,
        "damping": 0.1,
        "bend_model": "hinges",
        "bend_stiffness": 0.3,
        "bend_damping": 0.02,
    }
    box = {"type": "rigid", "vertices": CUBE * [0.2, 0.3, 0.5], "triangles": _box_triangles(), "mass": 3.0}
    bodies = [
        {"name": "rope", **rope()},
        {"name": "cloth", **sheet},
        {"name": "box", **box, "linear_damping": 0.5, "angular_damping": 0.8},
        {"name": "soft", **teschner(vertices, tetrahedra)},
        {"name": "wall", **box, "motion": "immobile"},
        {"name": "solid", **solid(vertices, tetrahedra, damping=0.05)},
    ]
    return turnbuckle.Simulation(turnbuckle.Scene("crowd", gravity=[0.0, 0.0, 0.0], bodies=bodies)).model


def _box_triangles() -> np.ndarray:
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


@pytest.mark.parametrize("kind", ["rope", "teschner"])
def test_forces_and_damping_of_the_reference(kind):
    if kind == "rope":
        body = rope()
        rest = body["points"]
        lengths = np.linalg.norm(np.diff(rest, axis=0), axis=1)
        elements = [energies.spring(i, i + 1, float(lengths[i]), 50.0, 0.4) for i in range(5)]
    else:
        rest, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (2, 1, 1))
        body = teschner(rest, tetrahedra)
        elements = energies.solid(rest, tetrahedra, K, K_D)
    rng = np.random.default_rng(2)
    system = ImplicitSystem(model_of(body))
    x, v = rest + 0.15 * rng.standard_normal(rest.shape), rng.standard_normal(rest.shape)
    got = take_apart(system, x, v)
    want = energies.forces(elements, x, v)
    assert np.abs(got.elastic + got.damping - want).max() < 1e-12 * np.abs(want).max()
    assert np.abs(got.elastic - minus_gradient(system, x)).max() < 1e-7 * np.abs(want).max()
    exact = force_jacobian(system, x, v, "v")
    assert np.abs(got.d - exact).max() < 1e-7 * np.abs(exact).max()
    at_rest = take_apart(system, rest)
    exact = force_jacobian(system, rest, np.zeros_like(rest), "x")
    assert np.abs(at_rest.k - exact).max() < 1e-5 * np.abs(exact).max()


def test_explicit_schemes_see_the_same_forces():
    vertices, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (1, 2, 1))
    sheet = {
        "type": "cloth",
        "size": [1.0, 0.7],
        "cells": [4, 3],
        "mass": 1.0,
        "structural_stiffness": 40.0,
        "damping": 0.1,
    }
    sheet |= {"bend_model": "hinges", "bend_stiffness": 0.3, "bend_damping": 0.02}
    soft = {"name": "soft", **teschner(vertices, tetrahedra)}
    bodies = [{"name": "cloth", **sheet}, soft, {"name": "solid", **solid(vertices, tetrahedra, damping=0.05)}]
    rng = np.random.default_rng(13)
    model = turnbuckle.Simulation(turnbuckle.Scene("same", bodies=bodies)).model
    x, v = model.rest + 0.1 * rng.standard_normal((model.points, 3)), rng.standard_normal((model.points, 3))
    run = Run({"integrator": "explicit_euler", "bodies": bodies}, x, v)
    run.step(1e-3)
    system = ImplicitSystem(model)
    system.assemble(x, v, 1.0)
    got = run.m[:, None] * (run.v - v) / 1e-3
    assert np.abs(got - system.force[: model.points]).max() < 1e-11 * np.abs(system.force).max()
    system.assemble(run.x, run.v, 1.0)
    assert run.report.energies["elastic"] == pytest.approx(system.elastic_energy(), rel=1e-12)


def test_a_taut_triangle_resists_leaving_its_plane_as_much_as_it_does():
    """Normal displacements see the whole second derivative of a stretched area; of a slack one, nothing is kept."""
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 1.1, 0], [0.3, 0.2, 0.9]])
    model = model_of(teschner(rest, np.array([[0, 1, 2, 3]])) | {"k_distance": 0.0, "k_volume": 0.0})
    t = model.tetrahedra
    one = replace(
        t, triangles=t.triangles[:1], triangle_area=t.triangle_area[:1], triangle_material=t.triangle_material[:1]
    )
    system = ImplicitSystem(replace(model, tetrahedra=one))
    corners = t.triangles[0]
    for factor in (1.5, 0.6):
        x = factor * rest @ random_rotation(12).T
        a, b, c = x[corners]
        normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
        out = np.zeros((12, 3))
        for k, corner in enumerate(corners):
            out[3 * corner : 3 * corner + 3, k] = normal
        exact = out.T @ force_jacobian(system, x, np.zeros_like(x), "x") @ out
        got = take_apart(system, x).k
        assert np.linalg.eigvalsh(got).min() > -1e-12 * np.abs(got).max()
        want = exact if factor > 1.0 else np.zeros((3, 3))
        assert np.abs(exact).max() > 0.1
        assert np.abs(out.T @ got @ out - want).max() < 1e-6 * np.abs(exact).max()


def test_springs_in_tension_are_exact_and_in_compression_semi_definite():
    body = rope()
    system = ImplicitSystem(model_of(body))
    for factor in (1.7, 0.4, 0.0):
        x = factor * body["points"] @ random_rotation(3).T
        got = take_apart(system, x)
        assert np.linalg.eigvalsh(got.k).min() >= -1e-12 * np.abs(got.k).max()
        exact = force_jacobian(system, x, np.zeros_like(x), "x") if factor else None
        if factor > 1.0:
            assert np.abs(got.k - exact).max() < 1e-7 * np.abs(exact).max()
        elif factor > 0.0:
            assert np.linalg.eigvalsh(exact).min() < -10.0  # what is left out
        assert np.isfinite(got.k).all() and np.isfinite(got.elastic).all()


@pytest.mark.parametrize("amount", [0.02, 0.5])
def test_the_matrix_of_a_crowd(amount):
    model = crowd()
    n, bodies = model.points, model.rigid.count
    system = ImplicitSystem(model)
    rng = np.random.default_rng(4)
    x, v = model.rest + amount * rng.standard_normal((n, 3)), rng.standard_normal((n, 3))
    q = rng.standard_normal((bodies, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    velocity, spin = rng.standard_normal((2, bodies, 3))
    h, gravity = 0.02, np.array([0.3, -0.2, -9.81])
    parts = take_apart(system, x, v)
    a = system.assemble(x, v, h, 0.5, 0.25, gravity, q, velocity, spin)
    assert a.blocksize == (3, 3) and a.shape == (3 * (n + 2 * bodies),) * 2 and a.has_sorted_indices
    dense = a.toarray()
    assert np.abs(dense - dense.T).max() == 0.0
    assert np.linalg.eigvalsh(dense).min() > 0.0
    mass = np.diag(np.repeat(np.where(model.mass > 0, model.mass, 1.0), 3))
    want = mass + 0.5 * h * parts.d + 0.25 * h * h * parts.k
    assert np.abs(dense[: 3 * n, : 3 * n] - want).max() < 1e-13 * np.abs(want).max()
    of_bodies = np.flatnonzero(model.mass == 0.0)
    assert len(of_bodies) == 16
    rows = (3 * of_bodies[:, None] + np.arange(3)).ravel()
    assert (dense[rows] == np.eye(len(dense))[rows]).all()
    assert (system.force[of_bodies] == 0.0).all()
    own = model.mass[:, None] * gravity
    assert np.abs(system.force[:n] - parts.elastic - parts.damping - own).max() < 1e-12 * np.abs(parts.elastic).max()
    for b in range(bodies):
        block = dense[3 * (n + 2 * b) : 3 * (n + 2 * b) + 6, 3 * n :]
        block = block[:, 6 * b : 6 * b + 6]
        force = system.force[n + 2 * b : n + 2 * b + 2]
        if model.rigid.names[b] != "box":
            assert (block == np.eye(6)).all() and (force == 0.0).all()
            continue
        turn = Rotation.from_quat(q[b]).as_matrix()
        inertia = turn @ np.diag(model.rigid.inertia[b]) @ turn.T
        assert np.abs(block[:3, :3] - 3.0 * (1 + 0.5 * h * 0.5) * np.eye(3)).max() < 1e-13
        assert np.abs(block[3:, 3:] - (1 + 0.5 * h * 0.8) * inertia).max() < 1e-13
        assert np.abs(block[:3, 3:]).max() == 0.0
        assert np.abs(force[0] - 3.0 * (gravity - 0.5 * velocity[b])).max() < 1e-12
        assert np.abs(force[1] + 0.8 * inertia @ spin[b]).max() < 1e-12


def test_no_number_depends_on_the_number_of_threads():
    vertices, tetrahedra = wobbly_box((1.0, 1.0, 1.0), (4, 4, 4))
    sheet = {"type": "cloth", "size": [1.0, 1.0], "cells": [24, 24], "mass": 1.0, "bend_model": "hinges"}
    soft = {"name": "soft", **teschner(vertices, tetrahedra)}
    bodies = [{"name": "cloth", **sheet}, soft, {"name": "solid", **solid(vertices, tetrahedra, damping=0.1)}]
    model = turnbuckle.Simulation(turnbuckle.Scene("threads", gravity=[0.0, 0.0, 0.0], bodies=bodies)).model
    x, v = model.rest + 0.1 * np.random.default_rng(5).standard_normal((2, model.points, 3))
    results = []
    for threads in (1, 2, 3):
        system = ImplicitSystem(model, threads, parallel_from=0)
        assert system.threads == threads
        a = system.assemble(x, v, 0.01)
        results.append((a.data.copy(), system.force.copy(), system.push.copy(), system.elastic_energy()))
    for other in results[1:]:
        assert all(np.array_equal(p, q) for p, q in zip(results[0], other, strict=True))


def test_springs_to_points_without_mass_hold_without_a_row():
    """What hangs on a scripted point feels it, and the point's own row stays the identity."""
    model = model_of(rope(c=0.7))
    held = replace(model, mass=np.r_[0.0, model.mass[1:]])
    rng = np.random.default_rng(6)
    x, v = 1.5 * model.rest + 0.05 * rng.standard_normal((6, 3)), rng.standard_normal((6, 3))
    free, cut = ImplicitSystem(model), ImplicitSystem(held)
    want, got = free.assemble(x, v, 0.1).toarray(), cut.assemble(x, v, 0.1).toarray()
    assert (got[:3] == np.eye(len(got))[:3]).all() and (got[:, :3] == np.eye(len(got))[:, :3]).all()
    assert np.abs(got[3:, 3:] - want[3:, 3:]).max() < 1e-14 * np.abs(want).max()
    assert np.abs(cut.force[1:] - free.force[1:]).max() == 0.0
    assert np.abs(cut.push[1:] - free.push[1:]).max() == 0.0
    assert (cut.force[0] == 0.0).all()


def pendulum() -> tuple[Model, np.ndarray, np.ndarray, Callable]:
    """A damped double pendulum of springs from a point that is held, and its exact motion."""
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.8, 0, 0.3]])
    model = model_of({"type": "rope", "points": points, "mass": 1.2, "stretch_stiffness": 60.0, "damping": 0.5})
    model = replace(model, mass=np.r_[0.0, model.mass[1:]])
    v = np.array([[0.0, 0, 0], [0, 1.0, 0], [0, 2.0, -1.0]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    elements = [energies.spring(i, i + 1, float(lengths[i]), 60.0, 0.5) for i in range(2)]
    weight = np.array([0, 0, -9.81])

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        x, w = y.reshape(2, 3, 3)
        a = energies.forces(elements, x, w) / np.where(model.mass > 0, model.mass, np.inf)[:, None] + weight
        a[0] = 0.0
        return np.r_[w.ravel(), a.ravel()]

    def exact(time: float) -> np.ndarray:
        y = solve_ivp(rate, (0.0, time), np.r_[points.ravel(), v.ravel()], method="DOP853", rtol=1e-11, atol=1e-12)
        return y.y[:, -1].reshape(2, 3, 3)

    return model, points, v, exact


def march(model: Model, x: np.ndarray, v: np.ndarray, scheme: str, steps: int, time: float) -> np.ndarray:
    """``steps`` steps of backward Euler as Contact has it, or of Newmark with Newton's iterations."""
    system, h, g = ImplicitSystem(model), time / steps, (0.0, 0.0, -9.81)
    n = len(x)

    def solved(a: object, b: np.ndarray) -> np.ndarray:
        b = b.reshape(-1, 3).copy()
        b[0] = 0.0  # held
        return spla.spsolve(a.tocsc(), b.ravel())[: 3 * n].reshape(-1, 3)

    def force(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        system.assemble(x, v, h, gravity=g)
        return system.force[:n].copy()

    inverse = np.where(model.mass > 0, 1.0 / np.where(model.mass > 0, model.mass, 1.0), 0.0)[:, None]
    acceleration = force(x, v) * inverse
    for _ in range(steps):
        if scheme == "euler":
            a = system.assemble(x, v, h, gravity=g)
            v = v + solved(a, system.right_side(h))
            x = x + h * v
            continue
        x_free, v_free = x + h * v + 0.25 * h * h * acceleration, v + 0.5 * h * acceleration
        new = acceleration
        for _ in range(6):
            x, v = x_free + 0.25 * h * h * new, v_free + 0.5 * h * new
            a = system.assemble(x, v, h, 0.5, 0.25, g)
            left = system.force.copy()
            left[:n] -= model.mass[:, None] * new
            new = new + solved(a, left)
        acceleration = new
        x, v = x_free + 0.25 * h * h * new, v_free + 0.5 * h * new
    return np.stack([x, v])


@pytest.mark.parametrize(("scheme", "order"), [("euler", 1), ("newmark", 2)])
def test_order_of_schemes_made_with_the_system(scheme, order):
    model, x, v, exact = pendulum()
    want = exact(0.5)
    steps = np.array([80, 160, 320]) * (4 if scheme == "euler" else 1)
    errors = [np.abs(march(model, x, v, scheme, int(n), 0.5) - want).max() for n in steps]
    slopes = -np.diff(np.log2(errors))
    assert slopes[-1] == pytest.approx(order, abs=0.12)
    assert errors[-1] < (2e-2 if scheme == "euler" else 2e-4)


@pytest.mark.parametrize("e", [1e5, 1e7])
def test_backward_euler_settles_at_large_steps_from_a_large_stretch(e):
    """At three times its length, where R K R^T alone lets the energy of a solid grow."""
    rest, tetrahedra = wobbly_box((0.3, 0.1, 0.1), (6, 2, 2), 0.0)
    model = model_of(solid(rest, tetrahedra, e, 0.3, density=1000.0))
    free = np.repeat((rest[:, 0] > 1e-9) & (rest[:, 0] < 0.3 - 1e-9), 3)
    noise = 1e-2 * np.random.default_rng(0).standard_normal(rest.shape) * free[: 3 * len(rest)].reshape(-1, 3)
    last = {}
    for stretched in (True, False):
        system = ImplicitSystem(model, stretched=stretched)
        x, v = rest * [3.0, 1.0, 1.0], noise.copy()
        for _ in range(30):
            a = system.assemble(x, v, 0.03).tocsc()[: x.size, : x.size]
            change = np.zeros(x.size)
            change[free] = spla.spsolve(a[free][:, free], system.right_side(0.03)[: x.size][free])
            v = v + change.reshape(-1, 3)
            x = x + 0.03 * v
        last[stretched] = 0.5 * np.sum(model.mass[:, None] * v * v)
    assert last[True] < 1e-20
    assert last[False] > 1.0


def test_products_and_diagonals():
    model = crowd()
    system = ImplicitSystem(model)
    a = system.assemble(model.rest, np.zeros_like(model.rest), 0.1)
    u = np.random.default_rng(7).standard_normal((system.n, 3))
    y, inverse = wp.zeros(system.n, dtype=wp.vec3d), wp.zeros(system.n, dtype=wp.mat33d)
    arrays = [wp.array(np.array(b, dtype=np.int32), dtype=wp.int32) for b in (a.indptr, a.indices)]
    data = wp.array(np.ascontiguousarray(a.data), dtype=wp.mat33d)
    program = Program("cpu")
    program.launch(block_multiply, system.n, [*arrays, data, wp.array(u, dtype=wp.vec3d), y])
    program.launch(invert_diagonal, system.n, [wp.array(system.pattern.diagonal, dtype=wp.int32), data, inverse])
    program.finish().run()
    assert np.abs(y.numpy().ravel() - a @ u.ravel()).max() < 1e-13 * np.abs(a.data).max()
    blocks = diagonal_blocks(a.data, a.indptr, a.indices)
    assert np.abs(np.linalg.inv(blocks) - inverse.numpy()).max() < 1e-12 * np.abs(inverse.numpy()).max()


def test_asking_again_answers_at_once_and_any_change_assembles_anew():
    model = model_of(rope())
    system, runs = ImplicitSystem(model), []
    run = system._program.run
    system._program.run = lambda: runs.append(run())
    x, v = model.rest.copy(), np.ones_like(model.rest)
    first = system.assemble(x, v, 0.1).toarray()
    assert (system.assemble(x, v.copy(), 0.1).toarray() == first).all() and len(runs) == 1
    x[2] *= 1.01
    assert np.abs(system.assemble(x, v, 0.1).toarray() - first).max() > 0.0 and len(runs) == 2
    system.assemble(x, v, 0.05)
    system.assemble(x, 2.0 * v, 0.05)
    system.assemble(x, 2.0 * v, 0.05, gravity=(0.0, 0.0, -9.81))
    assert len(runs) == 5
