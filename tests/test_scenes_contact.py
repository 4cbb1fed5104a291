"""The ready scenes of contact: what the paper counts, starts without intersections, their files, their scripts."""

import re
from pathlib import Path

import numpy as np
import pytest

from turnbuckle.contact.intersections import intersections
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes import REGISTRY
from turnbuckle.scenes.dancer import followers
from turnbuckle.scenes.local_global import AWAY, DELTA, NORMAL, REST, elastic_energy, projected
from turnbuckle.step.simulation import Simulation

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"  # a real dancer and a dress, where they are
SCENES = ("falling_cloth", "letters", "mixed_stack", "dancer", "local_global", "hung_and_hit")
SMALL: dict[str, dict] = {
    "falling_cloth": {"cells": 6},
    "letters": {"count": 5, "text": "AB C"},
    "mixed_stack": {"storeys": 1, "cloth_cells": 6},
    "dancer": {
        "layers": 2,
        "around": 24,
        "rows": 6,
        "turn_at": 0.1,
        "turn_time": 0.3,
        "kick_at": 0.4,
        "kick_time": 0.2,
    },
    "local_global": {},
    "hung_and_hit": {"cells": 8},
}


@pytest.fixture(scope="module", params=SCENES)
def full(request: pytest.FixtureRequest) -> tuple[str, Scene, Model, State]:
    if request.param == "letters":
        pytest.importorskip("manifold3d")
    scene = REGISTRY[request.param]()
    return request.param, scene, *scene.build()


def test_counts_of_the_paper(full: tuple[str, Scene, Model, State]) -> None:
    name, scene, model, _ = full
    surfaces = model.surfaces
    assert surfaces is not None
    solids = len(model.corotational.corners)
    if name == "falling_cloth":
        assert len(scene.definition.bodies) == 2
        assert len(model.mass[model.mass > 0]) == 2500
        assert (scene.definition.dt, scene.definition.duration) == (0.004, 4.0)
    elif name == "letters":
        assert sum(shape.name.startswith("letter") for shape in model.shapes) == 164
        assert 22_500 <= solids <= 23_500
        assert (scene.definition.dt, scene.definition.duration) == (0.03, 40.0)
        assert model.corotational.youngs_modulus.min() >= 1e5
    elif name == "dancer":
        assert (model.mass > 0).sum() == 16_800
        assert len(model.scripted) == 1 and model.scripted[0].moves
        assert scene.definition.dt == 0.002
    elif name == "mixed_stack":
        assert solids > 500 and len(model.hinges.points) > 1000 and model.rigid.count > 10
    elif name == "local_global":
        assert (model.mass > 0).sum() == 3 and len(model.springs.pairs) == 3


def test_nothing_intersects_at_the_start(full: tuple[str, Scene, Model, State]) -> None:
    _, _, model, state = full
    assert model.surfaces is not None
    x = state.positions()
    assert len(intersections(model.surfaces, model.surfaces.positions(x))) == 0
    referee = pytest.importorskip("contact_referee")
    assert not referee.intersects(model.surfaces, x)


def test_what_a_scene_is_made_of_is_said(full: tuple[str, Scene, Model, State]) -> None:
    """Each docstring gives the figures of its materials as they are built."""
    name, scene, model, _ = full
    text = re.sub(r"\s+", " ", REGISTRY[name].__doc__ or "")
    said = {float(number) for number in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?", text.replace(",", ""))}
    assert scene.definition.contact is not None
    assert scene.definition.contact.friction in said
    for values in (model.corotational.youngs_modulus, model.corotational.poissons_ratio, model.hinges.k):
        assert set(np.unique(values)) <= said, f"{set(np.unique(values))} is not in the docstring"


@pytest.mark.parametrize("name", SCENES)
def test_it_survives_its_file(name: str, tmp_path: Path) -> None:
    if name == "letters":
        pytest.importorskip("manifold3d")
    scene = REGISTRY[name](**SMALL[name])
    scene.save(tmp_path / "scene.yaml")
    again = Scene.load(tmp_path / "scene.yaml")
    assert again.definition == scene.definition


@pytest.mark.parametrize("name", SCENES)
def test_it_runs(name: str) -> None:
    """A few steps of a small one: committed, nothing crosses, scripts are followed."""
    if name == "letters":
        pytest.importorskip("manifold3d")
    simulation = Simulation(REGISTRY[name](**SMALL[name]))
    for _ in range(4):
        report = simulation.step()
        assert report.status == "ok", report
    model, x = simulation.model, simulation.state.positions()
    assert np.isfinite(x).all()
    assert model.surfaces is not None
    assert len(intersections(model.surfaces, model.surfaces.positions(x))) == 0
    for script in model.scripted:
        np.testing.assert_allclose(x[script.begin : script.end], script.positions(simulation.state.time), atol=1e-12)


def test_letters_fall_into_a_box_that_closes_after_twenty_seconds() -> None:
    pytest.importorskip("manifold3d")
    model, state = REGISTRY["letters"](**SMALL["letters"]).build()
    walls = [script for script in model.scripted if script.moves]
    assert len(walls) == 4
    inner = []
    for t in (0.0, 20.0, 23.0, 26.0, 40.0):
        at = {wall.name: wall.positions(t) for wall in walls}
        inner.append(
            [at["east"][:, 0].min() - at["west"][:, 0].max(), at["north"][:, 1].min() - at["south"][:, 1].max()]
        )
    inner = np.array(inner)
    np.testing.assert_allclose(inner, inner[0] * np.array([1.0, 1.0, 0.8, 0.6, 0.6])[:, None], rtol=1e-9)
    x = state.positions()[model.mass > 0]
    assert np.abs(x[:, :2]).max() < 0.5 * inner[0].min()
    names = [shape.name for shape in model.shapes if shape.name.startswith("letter")]
    assert names == ["letter0", "letter1", "letter2", "letter3", "letter4"]


def test_the_waist_keeps_its_distance_from_the_body_all_the_time() -> None:
    """Nails and body follow one motion, both straight between frames."""
    model, state = REGISTRY["dancer"]().build()
    (script,) = model.scripted
    waist = state.groups["waist"]
    inner = waist.points[:100]  # of the innermost layer
    first = script.positions(0.0)
    near = np.argmin(np.linalg.norm(first[:, None] - state.positions()[inner], axis=2), axis=0)
    apart = np.linalg.norm(first[near] - state.positions()[inner], axis=1)
    assert waist.goal is not None
    for t in np.linspace(0.0, 3.1, 40):
        body, held = script.positions(t), waist.goal.position(t)[:100]
        np.testing.assert_allclose(np.linalg.norm(body[near] - held, axis=1), apart, atol=2e-4)


def test_points_follow_a_body_that_turns_and_bends() -> None:
    rng = np.random.default_rng(3)
    body = rng.uniform(-1.0, 1.0, (400, 3))
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    frames = np.stack([body, body @ turn.T + [1, 2, 3], body + 0.01 * rng.standard_normal(body.shape)])
    points = rng.uniform(-0.5, 0.5, (20, 3))
    moved = followers(frames, points)
    np.testing.assert_allclose(moved[0], points, atol=1e-12)
    np.testing.assert_allclose(moved[1], points @ turn.T + [1, 2, 3], atol=1e-12)
    assert np.abs(moved[2] - points).max() < 0.03


def test_a_real_dancer_in_a_real_dress() -> None:
    body, dress = DATA / "dancer_rumba_2k.npz", DATA / "dress_synth.npz"
    if not (body.is_file() and dress.is_file()):
        pytest.skip("the data are not here")
    scene = REGISTRY["dancer"](body=str(body), garment=str(dress), up_axis="Y", settle=0.2)
    model, state = scene.build()
    assert model.surfaces is not None
    assert len(intersections(model.surfaces, model.surfaces.positions(state.positions()))) == 0
    (script,) = model.scripted
    frames = np.load(body)["verts"]
    np.testing.assert_allclose(script.positions(0.2 + 0.04 * 30), frames[30], atol=1e-6)
    assert scene.definition.duration == pytest.approx(0.2 + 0.04 * 120, rel=1e-2)
    waist = state.groups["waist"]
    np.testing.assert_array_equal(
        np.sort(waist.points) - model.shape("dress").begin, np.sort(np.load(dress)["top_rings"])
    )


def test_a_garment_of_ones_own_hangs_by_its_highest_rim(tmp_path: Path) -> None:
    angle = 2.0 * np.pi * np.arange(24) / 24
    ring = np.stack([0.25 * np.cos(angle), 0.25 * np.sin(angle), np.zeros(24)], axis=1)
    vertices = np.concatenate([ring + [0, 0, z] for z in (1.0, 0.9, 0.8)])
    ids = np.arange(24)
    after = np.roll(ids, -1)
    quads = [np.stack([24 * r + ids, 24 * (r + 1) + ids, 24 * (r + 1) + after, 24 * r + after], 1) for r in range(2)]
    triangles = np.concatenate([np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]]) for q in quads])
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
    (tmp_path / "tube.obj").write_text("\n".join(lines))
    _, state = REGISTRY["dancer"](garment=str(tmp_path / "tube.obj"), turn_at=0.1).build()
    held = state.positions()[state.groups["waist"].points]
    assert len(held) == 24
    np.testing.assert_allclose(held[:, 2], 1.0)


def test_local_projection_costs_more_energy_than_the_global_response() -> None:
    """In the step that meets the wall: c alone moved out of it, against what the solver does (the paper's point)."""
    scene = REGISTRY["local_global"]()
    dt = scene.definition.dt
    free = REGISTRY["local_global"]()
    free.apply_set("contact=false")
    free.apply_set("integrator=implicit_euler")
    touched, alone = Simulation(scene), Simulation(free)
    for _ in range(3):
        before = touched.state.positions()[:3] + dt * touched.state.velocities()[:3]
        touched.step()
        alone.step()
        if NORMAL @ (before[2] - REST[2]) + AWAY < DELTA:
            break
    else:
        pytest.fail("the structure has not come to the wall")
    x = touched.state.positions()[:3]
    assert NORMAL @ (x[2] - REST[2]) + AWAY >= 0.5 * DELTA, "c is outside of the wall"
    local = elastic_energy(projected(alone.state.positions()[:3]))
    assert 0.0 < elastic_energy(x) < 0.8 * local
    np.testing.assert_allclose(elastic_energy(REST), 0.0, atol=1e-18)


def test_the_wall_of_local_global_meets_c_first() -> None:
    model, state = REGISTRY["local_global"]().build()
    (wall,) = model.scripted
    a, b, c = state.positions()[:3]
    corner = wall.positions(0.0)
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    np.testing.assert_allclose(normal / np.linalg.norm(normal), NORMAL, atol=1e-12)
    np.testing.assert_allclose(NORMAL @ (c - corner[0]), AWAY, atol=1e-12)
    assert min(NORMAL @ (a - corner[0]), NORMAL @ (b - corner[0])) > 2.0 * AWAY
    np.testing.assert_allclose(state.velocities()[:3], np.tile(-NORMAL, (3, 1)))


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("falling_cloth", {"size": -1.0}),
        ("falling_cloth", {"tilt": 95.0}),
        ("letters", {"count": 0}),
        ("letters", {"press": 0.95}),
        ("letters", {"font": "missing.ttf"}),
        ("mixed_stack", {"storeys": 0}),
        ("dancer", {"body": "missing.npz"}),
        ("dancer", {"garment": "missing.npz"}),
        ("dancer", {"turn_time": 0.0}),
        ("local_global", {"speed": 0.0}),
        ("hung_and_hit", {"swing": 170.0}),
    ],
)
def test_wrong_parameters_are_named(name: str, wrong: dict) -> None:
    if name == "letters":
        pytest.importorskip("manifold3d")
    with pytest.raises(InputError) as caught:
        REGISTRY[name](**wrong)
    key, value = next(iter(wrong.items()))
    assert key in str(caught.value) or str(value) in str(caught.value)
    assert "\n" not in str(caught.value)
