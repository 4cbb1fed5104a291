"""Solvers of frictional contact against each other, a quadratic program, and the conditions themselves."""

from collections.abc import Callable

import numpy as np
import pytest
from reference.contact_problem import chain_on_plane, cloth_on_plane, mixed, rigid_pile, soft_stack
from reference.contact_qp import solve_frictionless

from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.errors import InputError
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.residuals import contact_residuals

PROBLEMS: dict[str, Callable[..., ContactProblem]] = {
    "cloth": cloth_on_plane,
    "layers": lambda **k: cloth_on_plane(n=6, layers=3, **k),
    "soft": soft_stack,
    "rigid": rigid_pile,
    "chain": chain_on_plane,
    "mixed": mixed,
}


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("seed", [0, 1])
def test_frictionless_anticipation_is_the_quadratic_program(name: str, seed: int) -> None:
    problem = PROBLEMS[name](mu=0.0, seed=seed)
    found = solve_anticipation(problem, start=np.random.default_rng(seed).random((problem.count, 3)) * 0.1)
    assert found.converged and found.residual <= 1e-10
    assert (found.impulse[:, 0] > 0.0).sum() > 3 and (found.impulse[:, 0] == 0.0).any()
    assert np.abs(found.velocity - solve_frictionless(problem)).max() < 1e-8


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("shape", ["cone", "pyramid4"])
def test_anticipation_with_friction_meets_every_condition(name: str, shape: str) -> None:
    problem = PROBLEMS[name](mu=0.3)
    found = solve_anticipation(problem, friction_shape=shape)
    residuals = contact_residuals(problem, found.velocity, found.impulse, found.equality, shape)
    assert found.converged and residuals.worst == found.residual <= 1e-10


def test_unknown_shape_is_named() -> None:
    with pytest.raises(InputError, match="pyramid5"):
        solve_anticipation(rigid_pile(), friction_shape="pyramid5")
