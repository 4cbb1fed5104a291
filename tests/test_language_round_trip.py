"""What the description language writes it reads back bit for bit, whatever a scene can say."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_scene_round_trip import random_scene

from turnbuckle.data.errors import InputError
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import JOINTS, SceneDef
from turnbuckle.scene.language.forms import Form, form_of
from turnbuckle.scene.language.parser import classes_of, parse
from turnbuckle.scene.language.words import BLOCKS, LISTS, POSITIONAL, RESERVED, pairs_of, words_of
from turnbuckle.scene.language.writer import write_description
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes import REGISTRY

TEXTS = (
    "word",
    "end",
    "max",
    "yes",
    "no",
    "world",
    "two words",
    'quo"te',
    "back\\slash",
    "é-1.2",
    "1e5",
    "-7",
    "+x",
    "inf",
)
TEXTS += (
    "",
    ";",
    "/* no comment */",
    "new\nline",
    "\u2028\x85",
    "a;b",
    "(",
    "x > 0 and z < 1",
    "\U0001f600",
    "//",
    "{}",
)
NUMBERS = (0, 1, -1, 0.1, -0.0, 5e-324, 1.7976931348623157e308, 1e22, 1 / 3, 123456789012345678, -1e-9, 2.0)


def classes(kind: type[Definition], seen: set[type[Definition]]) -> Iterator[type[Definition]]:
    """All definitions inside one."""
    if kind in seen:
        return
    seen.add(kind)
    yield kind
    for field in kind.model_fields:
        form = form_of(kind, field)
        for inner in (*form.record, *form.records, *form.groups):
            yield from classes(inner, seen)


ALL = list(classes(SceneDef, set()))


def random_record(kind: type[Definition], rng: np.random.Generator, depth: int = 0) -> dict[str, Any]:
    """Some fields of a definition with values of the right form, right or wrong as they may be."""
    item: dict[str, Any] = {}
    for field in kind.model_fields:
        form = form_of(kind, field)
        needed = field in POSITIONAL.get(kind, ()) or (depth == 0 and field == "name")
        if field == "type" or not form.said or not (needed or rng.random() < 0.5):
            continue
        item[field] = random_value(form, field, rng, depth)
    return item


def random_value(form: Form, field: str, rng: np.random.Generator, depth: int) -> Any:
    ways = [
        way for way in ("number", "text", "flag", "array", "texts", "record", "records", "groups") if getattr(form, way)
    ]
    way = str(rng.choice(ways))
    if way == "number":
        return NUMBERS[rng.integers(len(NUMBERS))]
    if way == "text":
        return TEXTS[rng.integers(len(TEXTS))]
    if way == "flag":
        return bool(rng.random() < 0.5)
    if way == "texts":
        return [TEXTS[k] for k in rng.integers(len(TEXTS), size=rng.integers(1, 4))]
    if way == "array":
        if rng.random() < 0.1 and field != "axis":
            return "points of mine.npz#key"
        shape = form.shapes[rng.integers(len(form.shapes))]
        size = [int(rng.integers(1, 5)) if n is None else n for n in shape]
        return rng.choice(np.array(NUMBERS, dtype=float), size=size)
    if way == "record":
        return random_record(form.record[rng.integers(len(form.record))], rng, depth + 1)
    if way == "records":
        kinds = form.records
        return [random_record(kinds[rng.integers(len(kinds))], rng, depth + 1) for _ in range(rng.integers(1, 3))]
    return [
        [random_record(form.groups[0], rng, depth + 1) for _ in range(rng.integers(1, 3))]
        for _ in range(rng.integers(1, 3))
    ]


def plain(value: Any) -> Any:
    """Arrays as lists; every number as the bits of a float. Components of a force are texts: 1 is '1'."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {
            k: [str(c) for c in v] if k in ("expression", "torque", "between") else plain(v) for k, v in value.items()
        }
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return float(value).hex() if isinstance(value, (int, float)) and not isinstance(value, bool) else value


@pytest.mark.parametrize("block", BLOCKS)
def test_every_field_of_every_kind_reads_back(block: str) -> None:
    for name, kind in classes_of(block).items():
        for seed in range(25):
            rng = np.random.default_rng(seed)
            item = random_record(kind, rng)
            if block == "world":
                data = {key: value for key, value in item.items() if key not in (*LISTS.values(), "schema_version")}
            else:
                item = {"type": name, **item} if "type" in kind.model_fields else item
                data = {LISTS[block]: [item]}
            text = write_description(data)
            wanted = {**{key: [] for key in LISTS.values()}, **data}
            assert plain(parse(text).data) == plain(wanted), text


def test_every_field_is_said_by_one_word_that_nothing_else_has() -> None:
    assert len(ALL) > 40
    for kind in ALL:
        words = words_of(kind)
        said = [field for field in kind.model_fields if form_of(kind, field).said]
        assert sorted(words.values()) == sorted(said), f"{kind.__name__}: two fields have one word"
        assert not {"end", *BLOCKS} & {*words, *pairs_of(kind)}, f"{kind.__name__}: a word ends or begins a block"
        for field in POSITIONAL.get(kind, ()):
            assert kind.model_fields[field].is_required(), f"{kind.__name__}.{field} comes first, so it must be there"
    assert {"constraint", "end", "min", "max"} <= RESERVED


def joints() -> Scene:
    """One of each type of joint, with what they have in common and numbers that are hard to write."""
    rng = np.random.default_rng(8)
    scene = Scene("joints", up_axis="Y", solver="displacement", displacement={"scheme": 1, "alpha": 1 / 3})
    scene.add_rigid("a", box=rng.random(3) + 0.1, mass=1 / 3, velocity=rng.random(3), angular_velocity=rng.random(3))
    scene.add_rigid("world", sphere=0.5, inertia=np.diag(rng.random(3) + 1), center=rng.random(3), motion="immobile")
    parts = [{"capsule": {"radius": 0.1, "length": 1 / 7}, "position": rng.random(3), "density": 1e-3}, {"sphere": 1.0}]
    scene.add_rigid("2nd", parts=parts, linear_damping=0.1, markers=rng.random((2, 3)), color=[0, 0.5, 1])
    keys = {"times": [0, 1 / 3, 9], "positions": rng.random((3, 3)), "rotations": rng.random((3, 3))}
    scene.add_rigid("end", cylinder={"radius": 0.1, "length": 2.0}, trajectory=keys | {"interpolation": "linear"})
    scene.add_rigid("point", vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], triangles=[[0, 2, 1], [0, 1, 3]])
    scene.add_force("push", body="a", expression=["sin(t)", 1.0, "-m"], torque=["0", 1e-17, 2], at=rng.random(3))
    ends = {"body0": "world", "body1": "2nd"}
    places = {"local_pos0": rng.random(3), "local_pos1": rng.random(3)}
    common = {"start": 0.1, "end": 1 / 3 + 1, "break_force": 1e3, "break_torque": 1e-3, "restitution": 0.5, "mu": 0.3}
    limits = {"lower_limit": -0.5, "upper_limit": 1 / 3}
    motor = {"on": "twist", "target_position": -1 / 3, "max_force": 1.0, "time_constant": 0.2}
    own: dict[str, dict[str, Any]] = {
        "ball": {},
        "revolute": {"axis": [0, 0, 1], **limits, "motor": motor},
        "universal": {"axis0": [0, 0, 1], "axis1": rng.random(3)},
        "prismatic": {"axis": rng.random(3), **limits},
        "cylindrical": {"axis": rng.random(3)},
        "planar": {"axis": rng.random(3)},
        "weld": {"enabled": False, "alpha": 0.25},
        "distance": {"min": 0.1, "max": 1 / 3, "stiffness": 1e5, "damping": 1.0},
        "cone_twist": {"axis": [1, 0, 0], "cone": 0.4, **limits},
        "point_to_ring": {"axis": [1, 0, 0], "min": 0.2, "max": 0.4},
        "rolling": {"normal": [0, 1, 0], "radius": 1 / 3, "axis": [1, 0, 0]},
    }
    assert set(own) | {"joint"} == set(JOINTS)
    for name, fields in own.items():
        scene.add_joint(name, f"joint-{name}", **ends, **places, **common, **fields)
    angle = {"axis0": [1, 0, 0], "axis1": [0, 1, 0], "min": 0.1, "max": 9, "stiffness": 3.0}
    twist = {"vector0": [0, 1, 0], "vector1": [1, 0, 0], "min": -1.0, "max": 1 / 3}
    general: list[dict[str, Any]] = [
        {"axial": {"axis": [0, 0, 3], "min": -1.0, "damping": 0.0}, "motor": {"on": "axial", "target_velocity": -2.0}},
        {"planar": {"normal": [0, 0, 1], "min": 1.0, "max": 2.0}, "angle": angle, "twist": twist},
        {"curve": {"points": rng.random((5, 3)), "interpolation": "spline", "closed": True}},
        {"surface": {"vertices": rng.random((3, 3)), "triangles": [[0, 1, 2]]}},
        {"sphere": {"max": 2.0}, "fixed_rotation": True},
        {"sphere": {}},
        {"twist": twist | {"axis0": [0, 0, 1], "axis1": [0, 0, 1]}},
        {"twist": twist | {"axis1": [0, 0, 1]}, "angle": {"axis0": [0, 0, 1], "axis1": [0, 1, 0]}},
    ]
    for k, fields in enumerate(general):
        scene.add_joint("joint", f"general-{k}", body1="a", **fields)
    scene.add_joint("ball", "anchored", body0="a", body1="point", anchor=rng.random(3))
    scene.add_joint("joint", "half", body1="a", local_pos1=rng.random(3))
    return scene


def through_both(scene: Scene, folder: Path) -> None:
    """To the language, to YAML, to the language: the same all the way."""
    scene.save(folder / "a.gascuel")
    first = Scene.load(folder / "a.gascuel")
    assert first.definition == scene.definition
    first.save(folder / "b.yaml")
    second = Scene.load(folder / "b.yaml")
    assert second.definition == scene.definition
    second.save(folder / "c.gascuel")
    text = (folder / "a.gascuel").read_text(encoding="utf-8")
    assert (folder / "c.gascuel").read_text(encoding="utf-8") == text.replace("a.arrays", "c.arrays")
    assert Scene.from_description(scene.to_description(), scene.folder).definition == scene.definition


def test_every_joint_goes_through_both_formats(tmp_path: Path) -> None:
    scene = joints()
    through_both(scene, tmp_path)
    text = scene.to_description()
    assert 'object1 "world";' in text and 'object2 "2nd";' in text and "  immobile;" in text
    assert "hinge " in text and "about 0 0 1  0 0 1" in text and "fixed-rotation;" in text


@pytest.mark.parametrize("seed", range(6))
def test_soft_bodies_and_point_constraints_too(seed: int, tmp_path: Path) -> None:
    through_both(random_scene(np.random.default_rng(seed)), tmp_path)


@pytest.mark.parametrize(
    "name", ["snake", "otary", "monocycle", "puppet", "bricard", "robot_on_ropes", "self_assembly"]
)
def test_ready_scenes_too(name: str, tmp_path: Path) -> None:
    through_both(REGISTRY[name](), tmp_path)


def test_meshes_follow_the_file(tmp_path: Path) -> None:
    models = tmp_path / "models"
    models.mkdir()
    (models / "hull.obj").write_text("v 0 0 0\n")
    scene = Scene(folder=models)
    scene.add_rigid("a", mesh="hull.obj")
    scene.add_rigid("b", parts=[{"mesh": "hull.obj"}])
    scene.add_joint("joint", "j", body0="a", body1="b", surface={"mesh": "hull.obj"})
    through_both(scene, models)
    (tmp_path / "sub").mkdir()
    for name in ("x.gascuel", "x.yaml"):
        scene.save(tmp_path / "sub" / name)
        moved = Scene.load(tmp_path / "sub" / name)
        found = [moved.definition.bodies[0].mesh, moved.definition.bodies[1].parts[0].mesh]
        found.append(moved.definition.constraints[0].surface.mesh)
        assert {(moved.folder / mesh).resolve() for mesh in found} == {(models / "hull.obj").resolve()}
    other = Scene(folder=tmp_path)
    other.include(tmp_path / "sub" / "x.gascuel")
    assert other.definition.bodies[0].mesh == "models/hull.obj"


def test_python_callables_are_named() -> None:
    scene = Scene()
    scene.add_rigid("a", sphere=1.0, trajectory=lambda t: (np.zeros(3), np.zeros(3)))
    scene.add_rigid("b", sphere=1.0)
    scene.add_joint("joint", "rail", body0="a", body1="b", domain=lambda p: p)
    for write in (scene.to_description, scene.to_yaml):
        with pytest.raises(InputError, match="the domain of the joint 'rail'.*the trajectory of the body 'a'"):
            write()


def test_a_text_is_the_json_of_itself() -> None:
    """What stands in quotes follows JSON, so any text can be said."""
    for text in TEXTS[:-1]:
        data = parse(f"world name {json.dumps(text)}; end").data
        assert data["name"] == text
