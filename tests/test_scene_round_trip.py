"""Scenes written and read again are identical, bit for bit."""

from pathlib import Path

import numpy as np
import pytest
from scene_example import GOOD

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation


def random_scene(rng: np.random.Generator) -> Scene:
    """A scene with awkward floats in it, and arrays long and short."""
    scene = Scene("fuzz", dt=float(rng.random() * 1e-3), gravity=rng.standard_normal(3) * 10.0 ** rng.integers(-9, 9))
    points = rng.standard_normal((int(rng.integers(4, 120)), 3)) * 10.0 ** rng.integers(-300, 11)
    points[0] = [-0.0, 5e-324, np.nextafter(1e12, 0)]
    scene.add_rope("long", points=points, damping=float(np.nextafter(0.1, 1)), color=rng.random(3))
    scene.add_cloth("c-1.é", vertices=rng.random((3, 3)), triangles=[[0, 1, 2]], mass=1 / 3, rotation=rng.random(3))
    scene.add_solid("box", box={"size": rng.random(3) + 0.1, "cells": [1, 2, 3]}, k_area=1e-17)
    scene.add_force("f", body="long", expression=["x", 1e-17, "where(t < 1, 1e22, -z)"])
    scene.add_constraint("nail", "n", points={"body": "long", "indices": rng.permutation(len(points))})
    goal = {"times": np.cumsum(rng.random(60) + 1e-9), "positions": rng.standard_normal((60, 2, 3))}
    scene.add_constraint("nail", "k", points={"body": "c-1.é", "indices": [0, 2]}, goal=goal, ramp={"steps": 3})
    scene.add_constraint("points_to_point", "j", join=[{"body": "box", "where": 'x < 1e-3 or y > "0"'[:8]}])
    scene.add_constraint("velocity", "v", points={"body": "box", "side": "-y"}, goal=rng.random(3), end=1e9)
    scene.add_constraint("attach", "a", points={"body": "c-1.é", "index": 1}, to={"body": "box", "nearest": "line"})
    scene.add_constraint("slide", "s", points={"body": "box", "all": True}, on={"body": "c-1.é", "surface": True})
    return scene


@pytest.mark.parametrize("seed", range(10))
def test_round_trip_is_identical(seed: int, tmp_path: Path) -> None:
    scene = random_scene(np.random.default_rng(seed))
    scene.save(tmp_path / "a.yaml")
    again = Scene.load(tmp_path / "a.yaml")
    assert again.definition == scene.definition
    assert Scene.loads(scene.to_yaml()).definition == scene.definition
    again.save(tmp_path / "b.yaml")
    assert (tmp_path / "b.yaml").read_text() == (tmp_path / "a.yaml").read_text().replace("a.arrays", "b.arrays")
    assert not list(tmp_path.glob(".*"))
    # the comparison sees one bit
    scene.definition.bodies[0].points.setflags(write=True)
    scene.definition.bodies[0].points[1, 1] = np.nextafter(scene.definition.bodies[0].points[1, 1], 0)
    assert again.definition != scene.definition


def test_mesh_paths_follow_the_file(tmp_path: Path) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "hull.obj").write_text("v 0 0 0\n")
    scene = Scene.loads(GOOD, folder)
    (tmp_path / "sub").mkdir()
    scene.save(tmp_path / "sub" / "moved.yaml")
    moved = Scene.load(tmp_path / "sub" / "moved.yaml")
    assert (moved.folder / moved.definition.bodies[3].mesh).resolve() == (folder / "hull.obj").resolve()
    scene.save(folder / "same.yaml")
    assert Scene.load(folder / "same.yaml").definition == scene.definition


def test_callables_are_refused_by_name(tmp_path: Path) -> None:
    scene = Scene()
    scene.add_rope("r", start=[0, 0, 0], end=[1, 0, 0], segments=3)
    scene.add_force("storm", callable=lambda x, v, t, m: x)
    scene.add_constraint("nail", "hand", points={"body": "r", "index": 0}, goal=lambda t: [0, 0, t])
    with pytest.raises(InputError, match="'storm'.*'hand'"):
        scene.save(tmp_path / "x.yaml")
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="cannot be written"):
        Scene().save(tmp_path / "none" / "x.yaml")


def test_the_scene_read_again_runs_the_same_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    scene = Scene("twin", dt=1e-3 / 3, integrator="beeman")
    scene.add_rope("rope", points=np.cumsum(rng.random((60, 3)), axis=0) / 30, damping=1 / 7)
    scene.add_net("net", size=[1, 1], cells=[8, 8], rotation=rng.random(3), mass=1 / 3)
    scene.add_solid("box", box={"size": [0.3, 0.3, 0.3], "cells": [1, 2, 1]}, position=[2, 0, 1 / 3])
    scene.add_force("wind", body="net", expression=["0.1 * sin(20 * t) * m", 0, "where(z > 0, 1e-2, -0.1) * vx"])
    moves = {"times": [0, 0.01, 0.3], "offsets": rng.random((3, 3)) / 10, "interpolation": "smooth"}
    scene.add_constraint("nail", "hand", points={"body": "rope", "index": 0}, goal=moves, ramp={"steps": 9})
    scene.add_constraint(
        "points_to_point", "knot", groups=[[{"body": "rope", "index": 59}, {"body": "net", "index": 3}]]
    )
    scene.add_constraint(
        "attach", "eye", points={"body": "net", "index": 80}, to={"body": "box", "nearest": "triangle"}
    )
    scene.add_constraint("velocity", "pull", points={"body": "net", "index": 40}, goal=[0, 0, 1 / 7], end=0.01)
    scene.save(tmp_path / "twin.yaml")
    runs = []
    for one in (scene, Scene.load(tmp_path / "twin.yaml")):
        simulation = Simulation(one)
        for _ in range(60):
            simulation.step()
        runs.append((simulation.positions().tobytes(), simulation.velocities().tobytes()))
        assert np.abs(simulation.positions() - simulation.model.rest).max() > 1e-3
    assert runs[0] == runs[1]
