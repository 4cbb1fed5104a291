"""The default contact solver against the others, on random problems and on ones that are hard for sweeps."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from tests.reference import contact_problem
from turnbuckle.data.contact import ContactProblem
from turnbuckle.solvers.contact import newton, newton_programs
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.newton import NewtonSolver, solve_newton
from turnbuckle.solvers.contact.residuals import contact_residuals

MAKERS = ["cloth_on_plane", "soft_stack", "rigid_pile", "chain_on_plane", "mixed"]


def make(name, friction, seed=1):
    return getattr(contact_problem, name)(mu=friction, seed=seed)


def one_block(compliance: np.ndarray, free: np.ndarray, mu: float) -> ContactProblem:
    """One contact of one block with ``A^-1`` (3, 3), along its axes."""
    one, a = (sp.bsr_array((m[None], [0], [0, 1]), shape=(3, 3)) for m in (np.eye(3), np.linalg.inv(compliance)))
    return ContactProblem(a=a, free=free, j=one, floor=np.zeros(1), friction=np.array([mu]))


@pytest.mark.parametrize("name", MAKERS)
def test_frictionless_velocities_are_those_of_anticipation_from_random_starts(name):
    problem = make(name, 0.0)
    rng = np.random.default_rng(7)
    wanted = solve_anticipation(problem, tolerance=1e-11).velocity
    for _ in range(2):
        start = np.zeros((problem.count, 3))
        start[:, 0] = rng.uniform(0.0, 1e-2, problem.count)
        found = NewtonSolver().solve(problem, start, rng.normal(size=len(wanted)), 1e-11, 2000)
        assert found.converged
        np.testing.assert_allclose(found.velocity, wanted, atol=1e-8)


@pytest.mark.parametrize("name", MAKERS)
def test_friction_meets_every_condition(name):
    problem = make(name, 0.4)
    found = solve_newton(problem, tolerance=1e-8, max_iterations=2000)
    assert found.converged
    residuals = contact_residuals(problem, found.velocity, found.impulse, found.equality)
    assert residuals.worst < 5e-8


def test_threads_do_not_change_the_answer():
    problem = make("mixed", 0.3)
    one, two = (NewtonSolver(threads=n).solve(problem, tolerance=1e-6) for n in (1, 2))
    np.testing.assert_array_equal(one.velocity, two.velocity)


def test_a_warm_start_needs_no_step():
    problem = make("cloth_on_plane", 0.3)
    first = solve_newton(problem, tolerance=1e-9, max_iterations=2000)
    again = NewtonSolver().solve(problem, first.impulse, first.velocity, 1e-5)
    assert again.converged and again.iterations["newton"] <= 1


def test_contacts_that_slide_faster_where_they_are_pressed_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """One block of which friction takes a hundred times what a push does: the shift alone would come near by 2 % an update.

    In closed form: it slides along +t, so r_t = -mu r_n, and u_n = 0 gives r_n = -v*_n / (W_nn - mu W_nt).
    """
    mu, w = 0.5, np.array([[1.0, 1.0, 0.0], [1.0, 100.0, 0.0], [0.0, 0.0, 100.0]])
    free = np.array([-1.0, 150.0, 0.0])
    problem = one_block(w, free, mu)
    r = -free[0] / (w[0, 0] - mu * w[0, 1]) * np.array([1.0, -mu, 0.0])
    updates = []
    for most in (1.0, newton_programs.LONGER[1]):
        monkeypatch.setattr(newton_programs, "LONGER", (2.0, most))
        solver = NewtonSolver()
        monkeypatch.setattr(solver.splitting, "start", lambda *_: 0)  # it would solve this alone
        found = solver.solve(problem, tolerance=1e-6, max_iterations=5000)
        assert found.converged
        np.testing.assert_allclose(found.impulse, [r], rtol=1e-5)
        np.testing.assert_allclose(found.velocity, free + w @ r, rtol=1e-5, atol=1e-5)
        updates.append(found.iterations["multipliers"])
    assert updates[1] < updates[0] / 4


def test_contacts_whose_shift_swings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressed more it slides faster, by as much as makes plain updates go from side to side for ever."""
    mu, w = 0.5, np.array([[1.0, 1.08, 0.0], [1.08, 1.2, 0.0], [0.0, 0.0, 1.2]])
    free = np.array([-1.0, 3.0, 0.0])
    problem = one_block(w, free, mu)
    r = -free[0] / (w[0, 0] - mu * w[0, 1]) * np.array([1.0, -mu, 0.0])
    solver = NewtonSolver()
    monkeypatch.setattr(solver.splitting, "start", lambda *_: 0)
    monkeypatch.setattr(newton, "SCALE", (1e3, 1e3))  # stiff enough that multipliers follow shifts at once
    found = solver.solve(problem, tolerance=1e-7, max_iterations=300)
    assert found.converged
    np.testing.assert_allclose(found.impulse, [r], rtol=1e-5)


@pytest.mark.parametrize("splits", [True, False])
def test_a_guess_that_slides_fast_hides_no_contact(splits: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shift of the guess, mu |u_t| = 30 m/s, would let a contact be missed without pushing."""
    problem = one_block(np.eye(3), np.array([-0.01, 0.02, 0.0]), 0.3)
    solver = NewtonSolver()
    if not splits:
        monkeypatch.setattr(solver.splitting, "start", lambda *_: 0)
    found = solver.solve(problem, None, np.array([0.0, 100.0, 0.0]), 1e-6)
    assert found.converged
    np.testing.assert_allclose(found.velocity, [0.0, 0.02 - 0.3 * 0.01, 0.0], atol=2e-6)


def test_equality_rows_of_an_earlier_problem_do_not_stay() -> None:
    """Joints turn from look to look, while sizes stay: a solver takes as many steps as a fresh one."""
    problem = make("mixed", 0.3)
    assert problem.e is not None and problem.e.shape[0] > 0
    other = problem.e.copy()
    other.data = -np.roll(problem.e.data, 1) + 0.1 * np.sin(np.arange(len(problem.e.data)))
    turned = replace(problem, e=other)
    solver = NewtonSolver()
    solver.solve(problem, tolerance=1e-7)
    again, fresh = solver.solve(turned, tolerance=1e-7), NewtonSolver().solve(turned, tolerance=1e-7)
    assert again.converged and fresh.converged
    assert again.iterations == fresh.iterations
    np.testing.assert_allclose(turned.e @ again.velocity, turned.wanted, atol=1e-9)


def test_a_larger_problem_after_a_small_one_is_solved_whole() -> None:
    """Lists of what there is grow with the problem, whatever was solved before."""
    whole = contact_problem.rigid_pile(mu=0.4, seed=0)
    solver = NewtonSolver()
    for contacts in (8, 11, 16):
        rows = np.arange(3 * contacts)
        problem = replace(
            whole,
            j=whole.j.tocsr()[rows].tobsr((3, 3)),
            floor=whole.floor[:contacts],
            friction=whole.friction[:contacts],
        )
        found = solver.solve(problem, tolerance=1e-8, max_iterations=2000)
        assert found.converged
        residuals = contact_residuals(problem, found.velocity, found.impulse, found.equality)
        assert residuals.worst < 5e-8
