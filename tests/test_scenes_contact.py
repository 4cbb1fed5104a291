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
from turnbuckle.scenes.local_global import (
    AWAY,
    DELTA,
    NORMAL,
    REST,
    A,
    C,
    elastic_energy,
    local_global,
    moved,
    optimal,
    projected,
    wall_distance,
)
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
        assert (model.mass > 0).sum() == 4 and len(model.springs.pairs) == 5 and len(model.hinges.points) == 1


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


def real_dancer(**parameters: object) -> Scene:
    """A recorded dancer in a dress of three layers, where the data are."""
    body, dress = DATA / "dancer_rumba_2k.npz", DATA / "dress_synth.npz"
    if not (body.is_file() and dress.is_file()):
        pytest.skip("the data are not here")
    return REGISTRY["dancer"](body=str(body), garment=str(dress), up_axis="Y", **parameters)


@pytest.mark.slow
def test_a_real_dancer_dances_to_the_end() -> None:
    """Her arms pass through where the waist is held, and her body through itself."""
    sim = Simulation(real_dancer())
    degraded = halved = 0
    for _ in range(round(5.1 / sim.dt)):
        report = sim.step()
        assert report.status != "failed", report.messages
        assert report.intersections == 0
        assert report.contact_residual.get("gap", 0.0) < 1e-2
        degraded += report.status == "degraded"
        halved += report.halvings > 0
    assert degraded <= 25 and halved <= 25


def test_a_real_dancer_in_a_real_dress() -> None:
    body, dress = DATA / "dancer_rumba_2k.npz", DATA / "dress_synth.npz"
    scene = real_dancer(settle=0.2, waist="nails")
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


@pytest.mark.parametrize("dt", [0.03, 0.01])
def test_local_projection_costs_far_more_energy_than_the_global_response(dt: float) -> None:
    """The structure comes to rest at the least energy that a and c allow; c alone moved out of the wall stores 20 times that."""
    push = 0.02
    simulation = Simulation(local_global(push=push, dt=dt))
    for _ in range(round(1.5 / dt)):
        report = simulation.step()
        assert report.status == "ok", report
    x = simulation.state.positions()[:4]
    gap = float(wall_distance(x[[C]])[0])
    assert 0.5 * DELTA <= gap <= 1.01 * DELTA, "c lies on the wall"
    local = projected(moved(REST, push), gap)
    np.testing.assert_allclose(x[A], local[A], atol=1e-12)
    np.testing.assert_allclose(x[C], local[C], atol=1e-4)  # it sticks, so both have c at the same place
    assert report.energies["elastic"] == pytest.approx(elastic_energy(x), rel=1e-9)
    least = elastic_energy(optimal(x))
    assert 1e-4 < elastic_energy(x) <= least * (1.0 + 1e-6)
    assert elastic_energy(optimal(local)) < 0.05 * elastic_energy(local)
    assert elastic_energy(x) < 0.05 * elastic_energy(local)


def test_the_wall_of_local_global_meets_c_first() -> None:
    model, state = REGISTRY["local_global"]().build()
    (wall,) = model.scripted
    x = state.positions()[:4]
    corner = wall.positions(0.0)
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    np.testing.assert_allclose(normal / np.linalg.norm(normal), NORMAL, atol=1e-12)
    away = (x - corner[0]) @ NORMAL
    np.testing.assert_allclose(away, wall_distance(x), atol=1e-12)
    np.testing.assert_allclose(away[C], AWAY, atol=1e-12)
    assert away[:C].min() > 2.0 * AWAY
    assert elastic_energy(x) < 1e-18 and elastic_energy(projected(x)) < 1e-18  # it touches nothing yet
    np.testing.assert_allclose(state.velocities()[:4] @ NORMAL, -0.06)


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
        ("local_global", {"push": 0.0}),
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
