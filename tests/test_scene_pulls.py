"""Forces that pull points to places, in Python and in scene files."""

from pathlib import Path

import numpy as np
import pytest

import turnbuckle
from turnbuckle.data.errors import InputError
from turnbuckle.run.frozen_selections import frozen_force
from turnbuckle.scene.goals import KeyframedGoal
from turnbuckle.scene.pulls import Pull

DT = 1e-3


def cloth(block: bool = False, **pull: object) -> turnbuckle.Scene:
    """A cloth of 16 points without weight, pulled at the corners of one side."""
    scene = turnbuckle.Scene("pulled", dt=DT, gravity=[0, 0, 0], integrator="verlet", duration=0.5)
    scene.add_cloth(
        "cloth", size=[0.3, 0.3], cells=[3, 3], density=0.2, structural_stiffness=20.0, shear_stiffness=20.0
    )
    if block:
        scene.add_rigid("block", box=[0.1, 0.1, 0.1], position=[0, 0, 1])
    scene.add_force("hand", pull={"points": {"body": "cloth", "indices": [0, 3]}, "frequency": 50.0, **pull})
    return scene


def test_the_force_is_that_of_springs() -> None:
    """Toward what is between two keys, with their velocity; at rest before the first and after the last."""
    goals = np.array([[[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]], [[1.0, 2.0, 0.0]]])
    pull = Pull(KeyframedGoal(np.array([1.0, 1.5, 2.0]), goals, smooth=False), frequency=10.0, damping=0.5)
    x, v, mass = np.array([[1.0, 1, 1]]), np.array([[0.0, 1, 0]]), np.array([0.2])
    for t, place, velocity in (
        (0.0, [0, 0, 0], [0, 0, 0]), (1.25, [0.5, 0, 0], [2, 0, 0]), (1.75, [1, 1, 0], [0, 4, 0]), (3.0, [1, 2, 0], [0, 0, 0]),
    ):  # fmt: skip
        wanted = 0.2 * (100.0 * (np.array([place]) - x) + 10.0 * (np.array([velocity]) - v))
        np.testing.assert_allclose(pull(x, v, t, mass), wanted, atol=1e-14)


@pytest.mark.parametrize("integrator", ["verlet", "rk4", "implicit_euler", "newmark"])
def test_a_point_swings_at_its_frequency(integrator: str) -> None:
    """x = cos(w t) without damping: half a turn takes it to the other side."""
    scene = turnbuckle.Scene("one", dt=DT, gravity=[0, 0, 0], integrator=integrator)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=1, stretch_stiffness=0.0)
    goal = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.0]]
    scene.add_force(
        "pull", pull={"points": {"body": "rope", "all": True}, "goal": goal, "frequency": 20.0, "damping": 0.0}
    )
    sim = turnbuckle.Simulation(scene)
    sim.run(np.pi / 20.0)
    assert sim.positions("rope")[0, 2] == pytest.approx(0.2, rel=0.04 if integrator == "implicit_euler" else 0.01)
    assert np.abs(sim.positions("rope")[1] - [1, 0, 0]).max() < 1e-12


def test_points_follow_keyframes_and_give() -> None:
    """Where nails would tear what another holds, a pull stretches until forces are equal."""
    keys = {"times": [0.0, 0.2], "positions": [[[0, 0, 0.0], [0.3, 0, 0.0]], [[0, 0, 0.1], [0.3, 0, 0.1]]]}
    scene = cloth(goal=keys, damping=1.0)
    scene.add_constraint("nail", "held", points={"body": "cloth", "indices": [12, 15]})
    sim = turnbuckle.Simulation(scene)
    sim.run(1.5)
    z = sim.positions("cloth")[[0, 3], 2] - sim.model.rest[[0, 3], 2]
    assert (0.0 < z).all() and (z <= 0.1 + 1e-3).all()
    np.testing.assert_array_equal(sim.positions("cloth")[[12, 15]], sim.model.rest[[12, 15]])


def test_scene_files_keep_pulls(tmp_path: Path) -> None:
    scene = cloth(goal={"times": [0.0, 0.1], "offsets": [[0, 0, 0], [0, 0, 0.05]]})
    scene.save(tmp_path / "pulled.yaml")
    again = turnbuckle.Scene.load(tmp_path / "pulled.yaml")
    ends = []
    for one in (scene, again):
        sim = turnbuckle.Simulation(one)
        sim.run(0.2)
        ends.append(sim.positions("cloth").copy())
    np.testing.assert_array_equal(*ends)
    assert np.abs(ends[0] - sim.model.rest).max() > 1e-3


def test_where_bodies_are_moved_goals_stay() -> None:
    """`assemble` moves soft bodies as a whole: a goal that is where points began is said by numbers then."""
    scene = cloth()
    model = turnbuckle.Simulation(scene).model
    (before,) = scene.definition.forces
    force = frozen_force(before, model, {"cloth"})
    assert force.pull is not None
    np.testing.assert_array_equal(force.pull.goal, model.rest[[0, 3]])
    assert frozen_force(before, model, {"other"}) is before


@pytest.mark.parametrize(
    ("pull", "told"),
    [
        (
            {"frequency": 2000.0},
            "force 'hand': .* turns by 2 rad in a step of 0.001 s; .* give frequency 1e\\+03 or less",
        ),
        ({"points": {"body": "cloth", "indices": [99]}}, "force 'hand': points of 'cloth': there is no point 99"),
        ({"points": {"body": "clot", "all": True}}, "there is no body 'clot'"),
        ({"points": [{"body": "cloth", "index": 1}, {"body": "cloth", "index": 1}]}, "force 'hand': two selections"),
        ({"goal": [[0, 0, 0]] * 3}, "force 'hand': goal has shape"),
        ({"goal": {"times": [0, 1], "velocities": [[0, 0, 0]] * 2}}, "positions or offsets"),
        ({"frequency": -1.0}, "frequency"),
        ({"points": {"body": "block", "all": True}}, "force 'hand': pulls mass points, and 'block' has none"),
    ],
)
def test_wrong_pulls_are_told(pull: dict, told: str) -> None:
    with pytest.raises(InputError, match=told):
        turnbuckle.Simulation(cloth(block=True, **pull))


def test_a_pull_stands_alone() -> None:
    scene = turnbuckle.Scene("two", dt=DT)
    scene.add_cloth("cloth", size=[1, 1], cells=[1, 1], density=0.1)
    with pytest.raises(InputError, match="exactly one of pull"):
        scene.add_force("both", body="cloth", pull={"points": {"body": "cloth", "all": True}, "frequency": 1.0})
