"""Joints whose domain is looked up in each step (curves, surfaces, functions): with ties, and what they miss by."""

import numpy as np
import pytest
from rigid_scene_example import bowl, box

import turnbuckle

ENDS = {"name": "j", "body1": "b", "local_pos0": [0, 0, 0], "local_pos1": [0, 0, 0]}
LOOKED_UP = {"type": "joint", "domain": bowl, **ENDS}
KNOWN = {"type": "distance", "min": 0.5, "max": 0.5, **ENDS}


def pendulum(joint: dict, **more: object) -> turnbuckle.Simulation:
    """A box at 0.5 m from the origin, with a rope tied to it."""
    body = box("b", [0.5, 0, 0], velocity=[0, 1.0, 0], markers=[[0.1, 0, 0]])
    rope = {"type": "rope", "name": "r", "start": [0.6, 0, 0], "end": [1.1, 0, 0], "segments": 4, "mass": 0.8}
    ends = [{"body": "b", "index": 0}, {"body": "r", "index": 0}]
    tie = {"type": "points_to_point", "name": "tie", "groups": [ends]}
    bodies = [body, {**rope, "stretch_stiffness": 500.0}]
    return turnbuckle.Simulation(turnbuckle.Scene("p", dt=1e-3, **more, bodies=bodies, constraints=[joint, tie]))


@pytest.mark.parametrize("integrator", ["velocity_verlet", "verlet", "rk4"])
def test_points_tied_to_a_body_on_a_looked_up_domain_move_as_on_the_same_domain_known(integrator: str) -> None:
    """Each look closes the flight again; impulses on tied points count once."""
    looked_up, known = (pendulum(joint, integrator=integrator) for joint in (LOOKED_UP, KNOWN))
    for _ in range(150):
        reports = [simulation.step() for simulation in (looked_up, known)]
        assert [report.status for report in reports] == ["ok", "ok"]
    assert np.abs(looked_up.positions() - known.positions()).max() < 1e-8
    assert np.abs(looked_up.velocities() - known.velocities()).max() < 1e-6


def test_the_rate_along_what_is_held_is_measured() -> None:
    simulation = turnbuckle.Simulation(
        turnbuckle.Scene("bead", dt=1e-3, bodies=[box("b", [0.3, 0, 0.4])], constraints=[LOOKED_UP])
    )
    report = simulation.step()
    assert report.status == "ok" and report.rate_residual["joint"] < 1e-12
    search = simulation.stepper.articulated.search
    out = simulation.center("b") / np.linalg.norm(simulation.center("b"))
    along = np.cross(out, [0, 1.0, 0])
    simulation.set_velocity("b", 0.7 * out + 3.0 * along, [0, 0, 0])
    assert search.rates(simulation.state.rigid) == pytest.approx([0.7], rel=1e-9)
    simulation.switch("j", False)
    simulation.step()
    assert search.rates(simulation.state.rigid) == pytest.approx([0.0], abs=0)


def test_a_limit_of_a_looked_up_domain_is_left_inwards_only() -> None:
    ball = {**LOOKED_UP, "domain": lambda p: p * min(1.0, 0.5 / np.linalg.norm(p))}
    bead = turnbuckle.Scene("bead", dt=1e-3, bodies=[box("b", [0.5, 0, 0])], constraints=[ball], gravity=[0, 0, 0])
    simulation = turnbuckle.Simulation(bead)
    simulation.step()
    search = simulation.stepper.articulated.search
    for speed, residual in ((0.2, 0.2), (-0.2, 0.0)):
        simulation.set_velocity("b", [speed, 1.0, 0], [0, 0, 0])
        assert search.rates(simulation.state.rigid) == pytest.approx([residual], abs=1e-8)


def test_the_displacement_solver_reports_the_rate_it_leaves() -> None:
    """It follows displacements: at the end of a step the speed is that of the chord, which leaves the sphere."""
    scene = turnbuckle.Scene(
        "bead", dt=1e-2, gravity=[0, 0, 0], solver="displacement", bodies=[box("b", [0.5, 0, 0], velocity=[0, 2.0, 0])],
        constraints=[LOOKED_UP],
    )  # fmt: skip
    simulation = turnbuckle.Simulation(scene)
    report = simulation.step()
    out = simulation.center("b") / np.linalg.norm(simulation.center("b"))
    leaves = abs(float(simulation.velocity("b")[0] @ out))
    assert leaves > 1e-3
    assert report.rate_residual["joint"] == pytest.approx(leaves, rel=1e-6)
