"""Material around rigid kernels and skins over chains of bodies: geometry, smoothness, what is drawn."""

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io import open_recorder, read_recording
from turnbuckle.meshes.inside import winding_numbers
from turnbuckle.meshes.mass_properties import check_solid
from turnbuckle.meshes.shapes import boundary_triangles, six_volumes
from turnbuckle.meshes.shell import Shell, box_shell, capsule_shell, cylinder_shell, sphere_shell
from turnbuckle.meshes.spline_surface import ring_gain, spline_surface
from turnbuckle.scene.build_bodies import build_body
from turnbuckle.scene.build_coating import expand_coatings
from turnbuckle.scene.build_rigid import rigid_shape
from turnbuckle.scene.build_skin import add_skins
from turnbuckle.scene.definitions import RigidDef
from turnbuckle.scene.scene import Scene
from turnbuckle.viewer.geometry import SceneGeometry

HERE = Path()
SIZE, RADIUS, LENGTH, THICKNESS = np.array([0.2, 0.3, 0.5]), 0.1, 0.4, 0.05


def box_depth(p: np.ndarray) -> np.ndarray:
    return np.abs(p) - 0.5 * SIZE


# Distance from the kernel's surface, in the measure in which the coating is THICKNESS thick.
DISTANCE: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "box": lambda p: box_depth(p).max(axis=1),
    "sphere": lambda p: np.linalg.norm(p, axis=1) - RADIUS,
    "cylinder": lambda p: np.maximum(np.hypot(p[:, 0], p[:, 1]) - RADIUS, np.abs(p[:, 2]) - 0.5 * LENGTH),
    "capsule": lambda p: (
        np.linalg.norm(p - np.c_[0 * p[:, :2], np.clip(p[:, 2], -0.5 * LENGTH, 0.5 * LENGTH)], axis=1) - RADIUS
    ),
}
SHELL: dict[str, Callable[..., Shell]] = {
    "box": lambda *a: box_shell(SIZE, *a),
    "sphere": lambda *a: sphere_shell(RADIUS, *a),
    "cylinder": lambda *a: cylinder_shell(RADIUS, LENGTH, *a),
    "capsule": lambda *a: capsule_shell(RADIUS, LENGTH, *a),
}


@pytest.mark.parametrize("name", SHELL)
@pytest.mark.parametrize("layers", [1, 3])
def test_shells_fill_the_space_between_kernel_and_outer_surface(name: str, layers: int) -> None:
    missing = []
    for edge in (None, 0.04, 0.02):
        shell = SHELL[name](THICKNESS, layers, edge)
        volumes = six_volumes(shell.vertices, shell.tetrahedra) / 6.0
        assert volumes.min() > 0.0
        check_solid(shell.vertices, boundary_triangles(shell.tetrahedra))  # neighbours share whole faces
        distance = DISTANCE[name](shell.vertices)
        on_kernel = np.zeros(len(distance), dtype=bool)
        on_kernel[shell.inner] = True
        np.testing.assert_allclose(distance[on_kernel], 0.0, atol=1e-15)
        levels = np.unique(np.round(distance[~on_kernel] / THICKNESS * layers, 9))
        np.testing.assert_allclose(levels, np.arange(1, layers + 1))
        missing.append(abs(1.0 - volumes.sum() / shell.volume))
    if name == "box":
        assert max(missing) < 1e-13
    else:
        assert missing[0] < 0.2 and missing[1] / missing[2] > 3.0  # second order in the edge length


def coated(**kernel: object) -> Scene:
    scene = Scene("coated")
    scene.add_rigid("bone", **kernel)
    scene.add_coating("flesh", around="bone", thickness=THICKNESS, density=1000.0)
    return scene


def test_a_coating_becomes_a_solid_that_lies_on_anchors_of_its_kernel() -> None:
    scene = coated(
        sphere=RADIUS, position=(1.0, 2.0, 3.0), rotation=(0.3, 1.0, 0.0), scale=1.3, markers=[[0.0, 0.0, 1.0]]
    )
    plain = rigid_shape(scene.definition.bodies[0], HERE)
    expanded = expand_coatings(scene.definition, HERE)
    bone, flesh = expanded.bodies
    assert (bone.type, flesh.type, flesh.name) == ("rigid", "solid", "flesh")
    held = expanded.constraints[0]
    assert held.name == "flesh.kernel" and held.type == "points_to_point"
    on_bone = rigid_shape(bone, HERE)
    np.testing.assert_array_equal(on_bone.vertices[: len(plain.vertices)], plain.vertices)  # numbers stay
    assert on_bone.mass == plain.mass
    in_world = Rotation.from_rotvec((0.3, 1.0, 0.0)).apply(on_bone.vertices) + (1.0, 2.0, 3.0)
    solid = build_body(flesh, HERE)
    own, anchors = (selection.indices for selection in held.zip)
    assert anchors.min() == len(plain.vertices)
    np.testing.assert_allclose(solid.x[own], in_world[anchors], atol=1e-15)
    outer, inner = RADIUS * 1.3 + THICKNESS, RADIUS * 1.3
    assert solid.mass.sum() == pytest.approx(1000.0 * 4 / 3 * np.pi * (outer**3 - inner**3), rel=1e-12)


def test_a_scene_without_coatings_is_left_alone() -> None:
    scene = Scene("plain")
    scene.add_rigid("bone", sphere=1.0)
    assert expand_coatings(scene.definition, HERE) is scene.definition


def test_a_mesh_is_filled_around_the_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if importlib.util.find_spec("pytetwild") is None:
        pytest.skip("needs pytetwild")
    monkeypatch.setenv("TURNBUCKLE_CACHE", str(tmp_path))
    trimesh.creation.icosphere(subdivisions=2, radius=0.2).export(tmp_path / "outer.ply")
    scene = Scene("coated", folder=tmp_path)
    scene.add_rigid("bone", box=(0.2, 0.2, 0.2))
    scene.add_coating("flesh", around="bone", mesh="outer.ply", edge_length=0.05)
    expanded = expand_coatings(scene.definition, tmp_path)
    flesh, kernel = build_body(expanded.bodies[1], tmp_path), rigid_shape(scene.definition.bodies[0], tmp_path)
    inner = np.zeros(len(flesh.x), dtype=bool)
    inner[expanded.constraints[0].zip[0].indices] = True
    inside = winding_numbers(flesh.x, kernel.vertices, kernel.triangles) > 0.5
    np.testing.assert_array_equal(inside, inner)
    assert not inside[flesh.tetrahedra].all(axis=1).any()
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2).volume
    assert flesh.mass.sum() == pytest.approx(1000.0 * (ball - 0.2**3), rel=1e-6)


def test_what_is_drawn_of_a_coating_is_its_true_outer_surface() -> None:
    scene = coated(capsule={"radius": RADIUS, "length": LENGTH}, position=(1.0, 0.0, 0.0))
    model, state = scene.build()
    x, shape = state.positions(), model.shape("flesh")
    surface = shape.skin.positions(x) - (1.0, 0.0, 0.0)
    np.testing.assert_allclose(DISTANCE["capsule"](surface), THICKNESS, atol=1e-13)
    check_solid(surface, shape.skin.triangles)
    assert len(shape.skin.triangles) > 4 * len(shape.triangles)
    stretched = 2.0 * x
    np.testing.assert_allclose(shape.skin.positions(stretched), 2.0 * shape.skin.positions(x), atol=1e-12)


def test_coatings_and_skins_survive_a_file(tmp_path: Path) -> None:
    scene = snake(True, radius=0.07, rings=2, color=(0.1, 0.2, 0.3))
    scene.save(tmp_path / "snake.yaml")
    assert Scene.load(tmp_path / "snake.yaml").definition == scene.definition


def test_wrong_coatings_are_one_sentence() -> None:
    scene = Scene("wrong")
    scene.add_rope("rope", start=(0, 0, 0), end=(1, 0, 0), segments=3)
    scene.add_rigid("pair", parts=[{"sphere": 1.0}, {"sphere": 1.0, "position": (3.0, 0.0, 0.0)}])
    for around, text in (
        ("rope", "'rope' is a rope; a coating goes around a rigid body"),
        ("pair", "outer surface as mesh"),
    ):
        other = Scene.from_dict({"bodies": [*scene.definition.bodies]})
        other.add_coating("flesh", around=around, thickness=0.1)
        with pytest.raises(InputError, match=f"coating 'flesh': .*{text}"):
            expand_coatings(other.definition, HERE)
    with pytest.raises(InputError, match="coating 'flesh', around: there is no body 'bone'"):
        scene.add_coating("flesh", around="bone", thickness=0.1)
    with pytest.raises(InputError, match="give exactly one of thickness, or mesh"):
        scene.add_coating("flesh", around="pair")
    fine = coated(sphere=0.1)
    fine.definition.bodies[1] = fine.definition.bodies[1].model_copy(update={"edge_length": 1e-6})
    with pytest.raises(InputError, match="coating 'flesh': edge_length 1e-06 m asks for more than"):
        expand_coatings(fine.definition, HERE)


def state_of(scene: Scene) -> tuple[tuple[Shape, ...], np.ndarray]:
    """Shapes and positions of all bodies at the start, skins included."""
    shapes, places = [], [np.zeros((0, 3))]
    for body in expand_coatings(scene.definition, HERE).bodies:
        begin = sum(map(len, places))
        if isinstance(body, RigidDef):
            shape = rigid_shape(body, HERE)
            places.append(Rotation.from_rotvec(np.array(body.rotation)).apply(shape.vertices) + body.position)
            shapes.append(Shape(body.name, begin, begin + len(places[-1]), triangles=shape.triangles))
        else:
            solid = build_body(body, HERE)
            places.append(solid.x)
            shapes.append(replace(solid.shape, begin=begin, end=begin + len(solid.x)))
    x = np.concatenate(places)
    return add_skins(scene.definition, shapes, x), x


def snake(coat: bool, **skin: object) -> Scene:
    """Three capsules in a bent row, with flesh around them if wanted, under one skin."""
    scene = Scene("snake")
    names = []
    for i in range(3):
        place = {"position": (0.3 * i, 0.05 * i * i, 1.0), "rotation": (0.0, np.pi / 2, 0.0)}
        scene.add_rigid(f"bone{i}", capsule={"radius": 0.03 if coat else 0.08, "length": 0.2}, **place)
        names.append(scene.add_coating(f"flesh{i}", around=f"bone{i}", thickness=0.05) if coat else f"bone{i}")
    scene.add_skin("skin", bodies=names, **skin)
    return scene


def one_sided(samples: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First, second, third derivative at the first of four samples of a cubic, exact."""
    a, b, c, d = samples
    first = (-11 * a + 18 * b - 9 * c + 2 * d) / (6 * spacing)
    return first, (2 * a - 5 * b + 4 * c - d) / spacing**2, (d - 3 * c + 3 * b - a) / spacing**3


@pytest.mark.parametrize("coat", [False, True])
def test_the_skin_is_twice_differentiable_after_any_motion(coat: bool) -> None:
    around, resolution = 8, 4
    shapes, x = state_of(snake(coat, around=around, resolution=resolution))
    generator = np.random.default_rng(3)
    for shape in shapes[:-1]:  # every body elsewhere; soft ones out of shape too
        turn = Rotation.from_rotvec(0.3 * generator.standard_normal(3))
        own = x[shape.begin : shape.end]
        x[shape.begin : shape.end] = turn.apply(own - own.mean(axis=0)) + own.mean(axis=0)
        x[shape.begin : shape.end] += 0.03 * generator.standard_normal(3)
        if coat:
            x[shape.begin : shape.end] += 0.003 * generator.standard_normal(own.shape)
    surface = shapes[-1].skin.positions(x)[:-2].reshape(-1, around * resolution, 3)
    rows = len(surface) + 2  # with the poles
    assert (rows - 1) % resolution == 0
    jumps, scale, kinks = [], [], []
    h = 1.0 / resolution

    def compare(line: np.ndarray, k: int) -> None:
        after, before = one_sided(line[k : k + 4], h), one_sided(line[k - 3 : k + 1][::-1], -h)
        jumps.append([np.abs(p - q).max() for p, q in zip(after[:2], before[:2], strict=True)])
        scale.append([np.abs(p).max() for p in after[:2]])
        kinks.append(np.abs(after[2] - before[2]).max())

    for column in range(around * resolution):
        for knot in range(resolution, rows - resolution, resolution):
            compare(surface[:, column], knot - 1)  # the first row is the pole
    for ring in surface:
        twice = np.concatenate([ring, ring])
        for knot in range(resolution, resolution * (around + 1), resolution):
            compare(twice, knot)
    assert (np.max(jumps, axis=0) < 1e-11 * np.max(scale, axis=0)).all()
    assert np.max(kinks) > 1e-3 * np.max(scale, axis=0)[1]  # the third derivative jumps: these are the knots


def test_the_skin_moves_with_a_rigid_body_exactly_and_only_nearby() -> None:
    shapes, x = state_of(snake(False))
    skin = shapes[-1].skin
    turn, shift = Rotation.from_rotvec((0.4, -1.0, 2.0)), np.array([3.0, -1.0, 0.5])
    np.testing.assert_allclose(skin.positions(turn.apply(x) + shift), turn.apply(skin.positions(x)) + shift, atol=1e-13)
    moved = x.copy()
    moved[shapes[0].begin : shapes[0].end] += (0.0, 0.1, 0.0)
    change = np.linalg.norm(skin.positions(moved) - skin.positions(x), axis=1)
    place = skin.positions(x)[:, 0]
    assert change[place > 0.5].max() < 1e-15 and change[place < -0.1].min() > 0.0999


@pytest.mark.parametrize("coat", [False, True])
def test_the_skin_follows_the_bodies_and_is_closed(coat: bool) -> None:
    shapes, x = state_of(snake(coat))
    skin = shapes[-1].skin
    surface = skin.positions(x)
    check_solid(surface, skin.triangles)  # closed, normals outwards
    bodies = [s for s in shapes[:-1] if s.name.startswith("flesh" if coat else "bone")]
    for shape in bodies:  # its axis lies inside
        own = x[shape.begin : shape.end]
        assert winding_numbers(own.mean(axis=0)[None], surface, skin.triangles) == pytest.approx(1.0)
    depth = np.concatenate([x[s.begin : s.end] for s in bodies])
    distance = np.array([np.linalg.norm(depth - p, axis=1).min() for p in surface])
    assert np.median(distance) < 0.04  # of a radius of 0.08, the distance to vertices
    # a ring of controls around a capsule gives back its radius
    middle = np.abs(surface[:, 0] - 0.3) < 0.02
    across = np.hypot(surface[middle, 1] - 0.05, surface[middle, 2] - 1.0)
    assert across.min() > 0.066 and across.max() < 0.085


def test_a_ring_on_a_circle_gives_the_circle() -> None:
    surface = spline_surface(5, 12, 3)
    np.testing.assert_allclose(surface.weights.sum(axis=1), 1.0, atol=1e-14)
    angle = 2 * np.pi * np.arange(12) / 12
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * ring_gain(12)
    controls = np.concatenate([*(ring + (0, 0, k) for k in range(5)), [[0, 0, 0], [0, 0, 4.0]]])
    points = surface.weights @ controls
    radius = np.hypot(points[:, 0], points[:, 1])
    middle = np.abs(points[:, 2] - 2.0) < 0.1
    np.testing.assert_allclose(radius[middle], 1.0, atol=2e-3)
    np.testing.assert_allclose(points[-2:], [[0, 0, 0], [0, 0, 4.0]], atol=1e-15)


def test_sections_of_the_user_are_taken() -> None:
    scene = Scene("sections")
    place = {"position": (1.0, 0.0, 0.0), "rotation": (0.0, np.pi / 2, 0.0)}
    scene.add_rigid("body", sphere=0.1, **place)
    sections = [{"body": "body", "position": (0, 0, k), "axis": (0, 0, 1), "radius": 0.2} for k in range(5)]
    scene.add_skin("skin", bodies=["body"], sections=sections)
    shapes, x = state_of(scene)
    surface = shapes[-1].skin.positions(x)
    middle = np.abs(surface[:, 0] - 3.0) < 0.5  # the body's z is the world's x
    np.testing.assert_allclose(np.hypot(surface[middle, 1], surface[middle, 2]), 0.2, atol=1e-3)
    check_solid(surface, shapes[-1].skin.triangles)


def test_the_skin_is_drawn_and_recorded_in_place_of_what_it_covers(tmp_path: Path) -> None:
    shapes, x = state_of(snake(True))
    assert [s.name for s in shapes if s.drawn] == ["skin"]
    drawn = SceneGeometry(list(shapes), x)
    assert len(drawn.surface.cells) == len(shapes[-1].skin.triangles)
    for name in ("run.npz", "run.vtkhdf", "run.usda"):
        if name.endswith(".usda"):
            pytest.importorskip("pxr")
        with open_recorder(tmp_path / name, list(shapes), up_axis="Z", frames_per_second=60.0) as recorder:
            recorder.write(0.0, x, 0 * x)
        if name.endswith(".usda"):
            assert (tmp_path / name).read_text().count('token visibility = "invisible"') == 6
            continue
        back = read_recording(tmp_path / name).shapes
        assert [s.drawn for s in back] == [s.drawn for s in shapes]
        np.testing.assert_array_equal(back[-1].skin.positions(x), shapes[-1].skin.positions(x))


def test_wrong_skins_are_one_sentence() -> None:
    scene = Scene("wrong")
    scene.add_rope("rope", start=(0, 0, 0), end=(1, 0, 0), segments=3)
    scene.add_rigid("body", sphere=0.1)
    with pytest.raises(InputError, match=r"skin 'skin', bodies\[1\]: there is no body 'bodi', did you mean 'body'"):
        scene.add_skin("skin", bodies=["body", "bodi"])
    with pytest.raises(InputError, match="'rope' is none of the skin's bodies"):
        bad = {"body": "rope", "position": (0, 0, 0), "axis": (0, 0, 1), "radius": 0.1}
        scene.add_skin("skin", bodies=["body"], sections=[bad, bad])
    scene.add_rigid("twin", sphere=0.1)
    scene.add_skin("skin", bodies=["body", "twin"])
    with pytest.raises(InputError, match="skin 'skin': its bodies are not in the order of a chain"):
        state = scene.definition
        shapes = [Shape(n, 0, 482, triangles=rigid_shape(state.bodies[1], HERE).triangles) for n in ("body", "twin")]
        add_skins(state, shapes, rigid_shape(state.bodies[1], HERE).vertices)
