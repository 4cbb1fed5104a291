"""Operator splitting at the start of the default solver: its law, its majorant, and what it saves."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import warp as wp
from reference.contact_problem import mixed, rigid_pile, soft_stack

from turnbuckle.solvers.contact import splitting
from turnbuckle.solvers.contact.newton import NewtonSolver
from turnbuckle.solvers.contact.newton_search import best_length
from turnbuckle.solvers.contact.residuals import contact_residuals
from turnbuckle.solvers.contact.splitting_kernels import contact_step


def law(y: np.ndarray, floor: float, mu: float, weight: float) -> np.ndarray:
    """Coulomb's law at the compliance 1 / weight by trying all impulses of a fine grid: the slow way."""
    n = max(weight * (floor - y[0]), 0.0)
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    sizes = np.linspace(0.0, mu * n, 401)
    t = sizes[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    left = np.linalg.norm(y[1:] + t / weight, axis=-1)  # friction makes what slides as slow as it can
    best = t.reshape(-1, 2)[left.argmin()]
    return np.array([n, *best])


def test_a_contact_by_itself_is_coulombs_law() -> None:
    rng = np.random.default_rng(3)
    m = 60
    u, floor, weight = rng.normal(size=(m, 3)), rng.normal(size=m), rng.uniform(0.5, 5.0, m)
    mu = rng.uniform(0.0, 1.0, m)
    put = lambda values, kind: wp.array(np.ascontiguousarray(values), dtype=kind, device="cpu")  # noqa: E731
    out = [put(np.zeros((m, 3)), wp.vec3d) for _ in range(4)]
    sizes, offsets = put([m, m], wp.int32), put(np.arange(m + 1), wp.int32)
    same = [put(np.arange(m), wp.int32), put(np.tile(np.eye(3), (m + 1, 1, 1)), wp.mat33d)]
    given = [put(np.append(u, [[0, 0, 0]], axis=0), wp.vec3d), put(floor, wp.float64), put(mu, wp.float64)]
    wp.launch(contact_step, 1, inputs=[0, 1, sizes, offsets, *same, *given, put(weight, wp.float64), 1.0, *out],
              device="cpu")  # fmt: skip
    z, r, push = (array.numpy() for array in out[1:])
    pushed = slid = 0
    for c in range(m):
        wanted = law(u[c], floor[c], mu[c], weight[c])
        np.testing.assert_allclose(r[c], wanted, atol=2e-2 * max(1.0, wanted[0]))
        pushed += wanted[0] > 0.0
        slid += wanted[0] > 0.0 and np.linalg.norm(u[c, 1:] + r[c, 1:] / weight[c]) > 1e-9
    assert 10 < slid < pushed < m
    np.testing.assert_allclose(z, u + r / weight[:, None], atol=1e-14)
    np.testing.assert_allclose(push, r + weight[:, None] * (z - u), atol=1e-14)


@pytest.mark.parametrize("make", [soft_stack, rigid_pile, mixed])
def test_k_is_no_less_than_the_matrix_of_the_augmented_problem(make) -> None:
    problem = make(mu=0.3)
    solver = NewtonSolver()
    solver.solve(problem, max_iterations=1)
    b, n, m = solver.buffers, len(problem.free) // 3, problem.count
    for name in ("begin", "weights", "split"):
        solver._run(name)
    weight, diagonal, coupled = b.read("weight", m), b.read("diagonal", n), b.read("coupled", n)
    a = problem.a.toarray()
    k = a.copy()
    for i in range(n):
        k[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = diagonal[i]
    for i in problem.pairs:
        k[3 * i : 3 * i + 3, 3 * i + 3 : 3 * i + 6] = coupled[i]
        k[3 * i + 3 : 3 * i + 6, 3 * i : 3 * i + 3] = coupled[i + 1]
    np.testing.assert_allclose(k, k.T, atol=1e-12 * np.abs(k).max())
    free = np.ones(n, dtype=bool) if problem.fixed is None else ~problem.fixed
    keep = np.repeat(free, 3)
    j = problem.j.toarray()[:, keep]
    least = np.linalg.eigvalsh(k[keep][:, keep] - a[keep][:, keep] - j.T @ (np.repeat(weight, 3)[:, None] * j))[0]
    assert least > -1e-10 * np.abs(k).max()
    assert (weight > 0.0).all()


@pytest.mark.parametrize(("make", "tolerance"), [(soft_stack, 1e-6), (rigid_pile, 1e-3)])
def test_splitting_alone_comes_to_the_solution(make, tolerance, monkeypatch) -> None:
    monkeypatch.setattr(splitting, "LIMIT", 400)
    problem = make(mu=0.3)
    found = NewtonSolver().solve(problem, tolerance=tolerance)
    assert found.converged and found.iterations["newton"] == 0 and found.iterations["splitting"] > 8
    assert contact_residuals(problem, found.velocity, found.impulse).worst < 10.0 * tolerance


def test_bodies_that_are_too_large_are_left_to_newton(monkeypatch) -> None:
    monkeypatch.setattr("turnbuckle.linalg.skyline.LARGEST", 5)
    found = NewtonSolver().solve(soft_stack(mu=0.3), tolerance=1e-6)
    assert found.converged and found.iterations["splitting"] == 0 and found.iterations["newton"] > 0


def test_a_step_is_as_long_as_is_best() -> None:
    """phi(t) = t^2 - 3 t + sum of two one-sided springs, by their slopes; the least value is found among all t."""

    def slopes(t: float) -> tuple[float, float]:
        push = sum(k * max(x - t, 0.0) for k, x in ((4.0, 1.0), (30.0, 0.6)))
        bend = sum(k * (t < x) for k, x in ((4.0, 1.0), (30.0, 0.6)))
        return push, bend

    def look(t: float) -> np.ndarray:
        push, bend = slopes(t)
        return np.array([[0.0], [0.0], [push], [bend]])

    push, bend = slopes(0.0)
    first = -3.0 - push  # phi'(0), and phi''(0) = 2 + bend
    residual = -first - (2.0 + bend)  # what conjugate gradients have left along the step
    found = best_length(np.array([[first], [residual], [push], [bend]]), look)
    t = np.linspace(0.0, 4.0, 40_001)
    slope = 2.0 * t - 3.0 - np.array([slopes(x)[0] for x in t])
    assert abs(np.interp(found, t, slope)) <= 0.2 * abs(first) + 1e-9
    assert found > 0.5


def test_a_problem_that_grows_is_solved_as_if_it_were_new() -> None:
    """Rows added to a problem that is known: the same answer as from nothing, also after its arrays had to grow."""
    problem = soft_stack(mu=0.3)
    m = problem.count
    few = m // 3
    j, end = problem.j, problem.j.indptr[few]
    rows = sp.bsr_array((j.data[:end], j.indices[:end], j.indptr[: few + 1]), shape=(3 * few, j.shape[1]))
    first = replace(problem, j=rows, floor=problem.floor[:few], friction=problem.friction[:few])
    solver = NewtonSolver()
    solver.solve(first, tolerance=1e-6)
    grown = solver.solve(problem, tolerance=1e-9, max_iterations=2000, known=few)
    fresh = NewtonSolver().solve(problem, tolerance=1e-9, max_iterations=2000)
    assert grown.converged and fresh.converged
    assert contact_residuals(problem, grown.velocity, grown.impulse).worst < 1e-7
    np.testing.assert_allclose(grown.velocity, fresh.velocity, atol=1e-5)
    again = solver.solve(problem, grown.impulse, grown.velocity, 1e-6, known=m)
    np.testing.assert_allclose(again.velocity, grown.velocity, atol=1e-5)


def test_what_was_solved_between_is_not_taken_for_known() -> None:
    problem = rigid_pile(mu=0.3)
    solver = NewtonSolver()
    wanted = solver.solve(problem, tolerance=1e-7)
    none = sp.bsr_array(
        (np.zeros((0, 3, 3)), np.zeros(0, np.int32), np.zeros(1, np.int32)), shape=(0, len(problem.free))
    )
    solver.solve(replace(problem, j=none, floor=np.zeros(0), friction=np.zeros(0)))
    found = solver.solve(problem, tolerance=1e-7, known=problem.count)
    assert found.impulse[:, 0].sum() == pytest.approx(wanted.impulse[:, 0].sum(), rel=1e-3)


def test_arrays_that_grow_keep_what_is_in_them() -> None:
    solver = NewtonSolver()
    buffers = solver.buffers
    buffers.put("weight", np.arange(5.0) + 1.0, wp.float64)
    buffers.put("weight", np.full(400, 7.0), wp.float64)
    buffers.put("other", np.arange(70.0), wp.float64)
    before = buffers.read("other", 70)
    buffers._room("other", 5000, wp.float64)
    np.testing.assert_array_equal(buffers.read("other", 70), before)


def test_velocities_that_are_no_numbers_end_at_once() -> None:
    problem = soft_stack(mu=0.3)
    problem.free[3] = np.nan
    found = NewtonSolver().solve(problem, tolerance=1e-6)
    assert not found.converged and "finite" in found.message
    assert found.iterations["newton"] <= 1 and found.iterations["cg"] < 500
