"""Iterative constraint anticipation against the full one, and what the paper promises of it."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from reference.contact_problem import chain_on_plane, cloth_on_plane, mixed, rigid_pile, soft_stack
from reference.contact_qp import solve_frictionless

from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.errors import InputError
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.ica import solve_ica
from turnbuckle.solvers.contact.residuals import contact_residuals

PROBLEMS: dict[str, Callable[..., ContactProblem]] = {
    "cloth": lambda **k: cloth_on_plane(stiffness=2.0, **k),
    "layers": lambda **k: cloth_on_plane(n=6, layers=3, stiffness=2.0, **k),
    "soft": soft_stack,
    "rigid": rigid_pile,
    "chain": chain_on_plane,
    "mixed": mixed,
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_frictionless_is_the_quadratic_program_from_any_start(name: str) -> None:
    problem = PROBLEMS[name](mu=0.0)
    exact = solve_frictionless(problem)
    for seed in range(2):
        start = np.random.default_rng(seed).random((problem.count, 3)) * [0.1, 0.0, 0.0]
        found = solve_ica(problem, start=start, tolerance=5e-11, max_iterations=5000)
        assert found.converged, found.message
        assert np.abs(found.velocity - exact).max() < 1e-8


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("shape", ["cone", "pyramid4", "pyramid8", "pyramid16"])
def test_friction_meets_every_condition_to_its_tolerance(name: str, shape: str) -> None:
    problem = PROBLEMS[name](mu=0.4)
    found = solve_ica(problem, friction_shape=shape, tolerance=1e-7, max_iterations=5000)
    residuals = contact_residuals(problem, found.velocity, found.impulse, found.equality, shape)
    assert found.converged and residuals.worst <= 1e-7
    assert residuals.equality < 1e-12


@pytest.mark.parametrize("name", ["cloth", "layers", "soft", "chain", "mixed"])
def test_with_little_friction_velocities_are_those_of_the_full_anticipation(name: str) -> None:
    problem = PROBLEMS[name](mu=0.2, seed=3)
    found = solve_ica(problem, tolerance=2e-11, max_iterations=5000)
    full = solve_anticipation(problem)
    assert found.converged and full.converged
    assert np.abs(found.velocity - full.velocity).max() < 1e-8


def test_jacobi_refinement_converges_where_it_may_and_is_caught_where_it_diverges() -> None:
    cloth = PROBLEMS["cloth"](mu=0.3)
    jacobi = solve_ica(cloth, tolerance=1e-10, refinement="jacobi", max_iterations=5000)
    sweeps = solve_ica(cloth, tolerance=1e-10, max_iterations=5000)
    assert jacobi.converged and np.abs(jacobi.velocity - sweeps.velocity).max() < 1e-7
    assert sweeps.iterations["outer"] < jacobi.iterations["outer"]
    soft = solve_ica(soft_stack(), refinement="jacobi")
    assert not soft.converged and "diverged" in soft.message


def test_paper_stops_early_and_within_the_allowance() -> None:
    problem = PROBLEMS["layers"](mu=0.3)
    strict = solve_ica(problem, tolerance=1e-8)
    paper = solve_ica(problem, stopping="paper", allowance=2e-3)
    assert paper.converged and paper.iterations["outer"] < strict.iterations["outer"]
    gap = contact_residuals(problem, paper.velocity, paper.impulse, paper.equality).gap
    assert 1e-6 < gap <= 2e-3


def test_warm_start_needs_less() -> None:
    problem = PROBLEMS["layers"](mu=0.3)
    cold = solve_ica(problem, tolerance=1e-8)
    warm = solve_ica(problem, start=cold.impulse, velocity=cold.velocity, tolerance=1e-8)
    assert warm.converged and warm.iterations["outer"] <= 1 < cold.iterations["outer"]


def test_same_bits_every_time() -> None:
    problem = mixed()
    first, again = (solve_ica(problem, tolerance=1e-6) for _ in range(2))
    assert first.velocity.tobytes() == again.velocity.tobytes() and first.impulse.tobytes() == again.impulse.tobytes()


def test_repeated_equality_rows_do_no_harm() -> None:
    problem = chain_on_plane(mu=0.4)
    once = solve_ica(problem, tolerance=1e-10)
    problem.e = sp.csr_array(sp.vstack([problem.e, problem.e[:5] * 2.0]))
    problem.wanted = np.concatenate([problem.wanted, 2.0 * problem.wanted[:5]])
    for solve in (solve_ica, solve_anticipation):
        twice = solve(problem, tolerance=1e-9)
        assert twice.converged, twice.message
        assert np.abs(once.velocity - twice.velocity).max() < 1e-8


def test_limits_and_options_are_named() -> None:
    short = solve_ica(PROBLEMS["layers"](mu=0.3), max_iterations=2)
    assert not short.converged and "after 2 iterations" in short.message
    with pytest.raises(InputError, match="refinement is 'sor'"):
        solve_ica(rigid_pile(), refinement="sor")
    with pytest.raises(InputError, match="stopping is 'never'"):
        solve_ica(rigid_pile(), stopping="never")
