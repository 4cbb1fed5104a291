"""Constraints between bodies keep the momentum of the whole; which schemes keep the angular one is stated here."""

import numpy as np
import pytest
from laboratory import Run
from reference import schemes
from test_physics_constraints import everything

ANGULAR = ["euler_cromer", "velocity_verlet"]  # forces act where the points are; the others: to the scheme's order


def between_bodies(seed: int, offset: float, kinds: tuple[str, ...]) -> dict:
    scene, _ = everything(np.random.default_rng(seed), offset)
    scene["constraints"] = [c for c in scene["constraints"] if c["type"] in kinds]
    return scene | {"gravity": [0.0, 0.0, 0.0]}


@pytest.mark.parametrize("offset", [0.0, 0.05])
@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_linear_momentum(name, offset):
    run = Run({"integrator": name, **between_bodies(11, offset, ("points_to_point", "attach", "slide"))})
    before = (run.m[:, None] * run.v).sum(0)
    sizes = np.repeat([1e-3, 3e-4, 8e-4], 50)
    for h in sizes:
        run.step(h)
        scale = (run.m * np.linalg.norm(run.v, axis=1)).sum()
        assert np.abs((run.m[:, None] * run.v).sum(0) - before).max() < 1e-12 * scale


@pytest.mark.parametrize("name", ANGULAR)
def test_angular_momentum_where_constraints_are_fulfilled(name):
    """Joined points lie at one place and an attached point on its line, so their forces have no moment.

    A slide is not among them: its force acts where the point will be, h v further along the line.
    """
    run = Run({"integrator": name, **between_bodies(12, 0.0, ("points_to_point", "attach"))})
    run.step(1e-3)  # velocities come onto the constraints

    def angular() -> np.ndarray:
        return np.cross(run.x, run.m[:, None] * run.v).sum(0)

    before = angular()
    for h in np.repeat([1e-3, 4e-4], 100):
        run.step(h)
    scale = (run.m * np.linalg.norm(run.x, axis=1) * np.linalg.norm(run.v, axis=1)).sum()
    assert np.abs(angular() - before).max() < 1e-12 * scale
