"""Obstacles: shapes, trajectories, sequences of meshes, callables; and what is wrong with files."""

from pathlib import Path

import numpy as np
import pytest

import turnbuckle
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Scripted
from turnbuckle.data.shape import Shape
from turnbuckle.meshes.sequences import read_sequence
from turnbuckle.meshes.solids import box_surface
from turnbuckle.scene.scene import Scene
from turnbuckle.viewer.render import Renderer

VERTICES, TRIANGLES = box_surface(np.array([1.0, 1.0, 1.0]))


def only(scene: Scene) -> Scripted:
    model, state = scene.build()
    (script,) = model.scripted
    x = state.positions()[script.begin : script.end]
    np.testing.assert_allclose(x, script.positions(0.0), atol=1e-15)
    assert (model.mass[script.begin : script.end] == 0.0).all()
    assert state.follows[script.begin : script.end].all()
    return script


def test_what_stands_still() -> None:
    scene = Scene(contact=True)
    scene.add_cloth("cloth", size=[1, 1], cells=[2, 2], position=[0, 0, 3])
    scene.add_obstacle("table", box=[2, 1, 0.5], position=[1, 2, 3], rotation=[0, 0, np.pi / 2], scale=2.0)
    script = only(scene)
    assert not script.moves
    x = script.positions(7.0)
    np.testing.assert_allclose(x.max(axis=0) - x.min(axis=0), [2.0, 4.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(x.mean(axis=0), [1.0, 2.0, 3.0], atol=1e-12)


@pytest.mark.parametrize(
    "shape",
    [
        {"plane": [1, 2]}, {"sphere": 0.5}, {"cylinder": {"radius": 0.5, "length": 1.0}},
        {"capsule": {"radius": 0.5, "length": 1.0}}, {"vertices": VERTICES, "triangles": TRIANGLES},
    ],
)  # fmt: skip
def test_every_shape_is_built(shape: dict) -> None:
    scene = Scene(contact=True)
    scene.add_obstacle("thing", **shape)
    scene.add_cloth("cloth", size=[1, 1], cells=[2, 2], position=[0, 0, 3])
    script = only(scene)
    assert np.abs(script.positions(0.0).mean(axis=0)).max() < 1e-12


def test_a_plane_faces_up() -> None:
    scene = Scene(contact=True)
    scene.add_obstacle("plane", plane=[1, 2])
    model, state = scene.build()
    corner = state.positions()[model.shapes[0].triangles]
    assert (np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0).all()


def test_a_trajectory_moves_it_and_its_points_start_with_its_speed() -> None:
    scene = Scene(contact=True, dt=1e-3)
    keys = {"times": [0.0, 2.0], "positions": [[0, 0, 0], [4, 0, 0]], "interpolation": "linear"}
    scene.add_obstacle("wall", box=[1, 1, 1], trajectory=keys)
    scene.add_cloth("cloth", size=[1, 1], cells=[2, 2], position=[0, 0, 3])
    script = only(scene)
    assert script.moves
    np.testing.assert_allclose(script.positions(1.0) - script.positions(0.0), np.tile([2.0, 0, 0], (8, 1)), atol=1e-12)
    _, state = scene.build()
    np.testing.assert_allclose(state.velocities()[:8], np.tile([2.0, 0.0, 0.0], (8, 1)), atol=1e-9)


def test_a_callable_in_python() -> None:
    scene = Scene(contact=True)
    scene.add_obstacle(
        "jelly", motion=lambda t: VERTICES * (1.0 + t), triangles=TRIANGLES, position=[0, 0, 1], scale=2.0
    )
    script = only(scene)
    np.testing.assert_allclose(script.positions(0.5), VERTICES * 3.0 + [0, 0, 1])
    with pytest.raises(InputError, match="motion of the obstacle 'jelly' is a Python callable"):
        scene.to_yaml()
    scene = Scene(contact=True)
    scene.add_obstacle("torn", motion=lambda t: VERTICES[: 8 if t < 1 else 7], triangles=TRIANGLES)
    with pytest.raises(StepError, match="gives 7 vertices at t = 1 s, 8 at the start"):
        only(scene).positions(1.0)


def frames() -> np.ndarray:
    return np.stack([VERTICES, VERTICES + [1, 0, 0], VERTICES + [1, 3, 0]])


def test_frames_go_straight_between_their_times(tmp_path: Path) -> None:
    scene = Scene(contact=True)
    scene.add_obstacle(
        "body", frames=frames(), triangles=TRIANGLES, times=[0.0, 1.0, 1.5], start=2.0, position=[0, 0, 5]
    )
    script = only(scene)
    for t, shift in ((0.0, [0, 0]), (2.0, [0, 0]), (2.5, [0.5, 0]), (3.25, [1, 1.5]), (9.0, [1, 3])):
        np.testing.assert_allclose(script.positions(t), VERTICES + [*shift, 5], atol=1e-12)
    scene.save(tmp_path / "scene.yaml")
    again = Scene.load(tmp_path / "scene.yaml")
    assert again.definition == scene.definition
    np.testing.assert_array_equal(only(again).positions(2.7), script.positions(2.7))


@pytest.mark.parametrize(("fields", "at"), [({}, 0.08), ({"frame_rate": 50.0}, 0.04), ({"times": [0, 1, 2]}, 2.0)])
def test_a_sequence_from_an_npz(tmp_path: Path, fields: dict, at: float) -> None:
    np.savez(tmp_path / "body.npz", verts=frames().astype(np.float32), faces=TRIANGLES, dt=0.04)
    scene = Scene(contact=True, folder=tmp_path)
    scene.add_obstacle("body", sequence="body.npz", **fields)
    script = only(scene)
    assert script.moves
    np.testing.assert_allclose(script.positions(at), frames()[2], atol=1e-6)
    np.testing.assert_allclose(script.positions(0.75 * at), 0.5 * (frames()[1] + frames()[2]), atol=1e-6)


def write_obj(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()), ""]))


def test_a_sequence_from_a_folder_in_the_order_of_numbers(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    for k, name in enumerate(("f_9.obj", "f_10.obj", "f_11.obj")):
        write_obj(folder / name, frames()[k], TRIANGLES)
    scene = Scene(contact=True, folder=tmp_path)
    scene.add_obstacle("body", sequence="walk", frame_rate=2.0)
    np.testing.assert_allclose(only(scene).positions(0.5), frames()[1])
    moved = tmp_path / "elsewhere" / "scene.yaml"
    moved.parent.mkdir()
    scene.save(moved)
    np.testing.assert_allclose(only(Scene.load(moved)).positions(1.0), frames()[2])
    write_obj(folder / "f_12.obj", VERTICES, TRIANGLES[:-1])
    with pytest.raises(InputError, match=r"body 'body': .*f_12.obj has another topology than f_9.obj") as caught:
        scene.build()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"verts": frames()}, "needs arrays 'verts' (frames, n, 3) and 'faces' (m, 3)"),
        ({"verts": frames()[:, :, :2], "faces": TRIANGLES}, "'verts' has shape (3, 8, 2)"),
        ({"verts": frames(), "faces": TRIANGLES + 1}, "'faces' names vertex 8 of 8"),
        ({"verts": frames() * np.nan, "faces": TRIANGLES}, "frame 0 is not finite"),
        ({"verts": frames(), "faces": TRIANGLES, "times": [0.0, 2.0, 1.0]}, "its dt or times do not fit its 3 frames"),
    ],
)
def test_wrong_sequences_are_named(tmp_path: Path, arrays: dict, message: str) -> None:
    np.savez(tmp_path / "body.npz", **arrays)
    with pytest.raises(InputError) as caught:
        read_sequence(tmp_path / "body.npz")
    assert message in str(caught.value)
    assert "body.npz" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_damaged_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no file or folder"):
        Scene(folder=tmp_path).add_obstacle("body", sequence="gone.npz")
    (tmp_path / "bad.npz").write_bytes(b"PK nothing")
    with pytest.raises(InputError, match=r"bad.npz: cannot be read as .npz"):
        read_sequence(tmp_path / "bad.npz")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no OBJ files"):
        read_sequence(tmp_path / "empty")
    np.savez(tmp_path / "two.npz", verts=frames(), faces=TRIANGLES)
    with pytest.raises(InputError, match="there are 2 times for 3 frames"):
        read_sequence(tmp_path / "two.npz", times=np.array([0.0, 1.0]))


def test_constraints_take_points_of_obstacles_as_masters_only() -> None:
    scene = Scene(contact=True, integrator="verlet")
    scene.add_obstacle("body", frames=frames(), triangles=TRIANGLES, times=[0.0, 1.0, 2.0])
    scene.add_cloth("dress", size=[0.5, 0.5], cells=[2, 2], position=[-0.25, -0.25, 0.51])
    scene.add_constraint(
        "attach", "pin", points={"body": "dress", "index": 4}, to={"body": "body", "nearest": "triangle"}
    )
    _, state = scene.build()
    group = state.groups["pin"]
    assert group.points[0] == 8 + 4
    assert (group.points[1:] < 8).all()
    scene.add_constraint("nail", "stop", points={"body": "body", "index": 0})
    with pytest.raises(InputError, match="'stop': holds points of the obstacle 'body' alone"):
        scene.build()


def test_pictures_show_where_it_is() -> None:
    scene = Scene(contact=True)
    scene.add_obstacle("body", frames=frames(), triangles=TRIANGLES, times=[0.0, 1.0, 2.0], color=[1, 0, 0])
    scene.add_obstacle("unseen", box=[9, 9, 9], drawn=False)
    model, state = scene.build()
    shape: Shape = model.shapes[0]
    assert not shape.still
    assert not model.shapes[1].drawn
    bounds = (np.array([-1.0, -1, -1]), np.array([4.0, 4, 1]))
    renderer = Renderer(list(model.shapes), "Z", (96, 72), bounds, "pillow")
    x = state.positions().copy()
    pictures = []
    for t in (0.0, 2.0):
        x[shape.begin : shape.end] = model.scripted[0].positions(t)
        red = renderer.frame(x).astype(int)
        pictures.append(np.argwhere(red[:, :, 0] > red[:, :, 1] + 60))
    assert min(map(len, pictures)) > 20
    assert np.abs(pictures[0].mean(axis=0) - pictures[1].mean(axis=0)).max() > 5.0, "it has moved across the picture"


@pytest.mark.parametrize(
    "integrator", ["verlet", "velocity_verlet", "rk4", "beeman", "explicit_euler", "implicit_euler"]
)
def test_without_contact_obstacles_stay_or_go_where_they_are_told(integrator: str) -> None:
    scene = turnbuckle.Scene("off", dt=2e-3, integrator=integrator)
    scene.add_obstacle("floor", box=[1, 1, 0.1], position=[0, 0, -1])
    keys = {"times": [0, 1], "positions": [[0, 0, 0], [1, 0, 0]]}
    scene.add_obstacle("cart", sphere=0.1, trajectory=keys)
    scene.add_rope("rope", start=[0, 1, 0], end=[1, 1, 0], segments=2)
    simulation = turnbuckle.Simulation(scene)
    floor, cart, rope = (simulation.positions(n).copy() for n in ("floor", "cart", "rope"))
    simulation.run(0.1)
    assert np.array_equal(simulation.positions("floor"), floor)
    assert np.allclose(simulation.positions("cart") - cart, [0.028, 0, 0], atol=1e-9)  # smooth between keys
    assert simulation.positions("rope")[1, 2] < rope[1, 2] - 0.03, "what is free falls"
    assert simulation.state.energies["kinetic"] > 0.0 and np.abs(simulation.state.velocities()).max() < 1.1
