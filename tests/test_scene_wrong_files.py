"""Scene files that are wrong in hundreds of ways: file, line and field are named, and nothing else is raised."""

import random
import re
import time
from pathlib import Path

import numpy as np
import pytest
from scene_example import GOOD

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.yaml_file import json_schema

LINES = GOOD.splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenes")
    (path / "hull.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    np.save(path / "four.npy", np.arange(12.0).reshape(4, 3))
    np.savez(path / "many.npz", goals=np.zeros((2, 3)), texts=np.array(["a"]), objects=np.array([{}], dtype=object))
    (path / "broken.npz").write_bytes(b"PK\x03\x04 not really")
    (path / "hull.d").mkdir()
    return path


def message(text: str | bytes, folder: Path) -> str:
    """The error of a file that holds `text`; anything but `InputError` fails the test."""
    file = folder / "bad.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        Scene.load(file)
    assert type(caught.value) is InputError
    for line in str(caught.value).splitlines():
        assert re.match(re.escape(str(file)) + r":\d+: \S", line) or line.startswith("... and "), line
    return str(caught.value).replace(str(folder) + "/", "")


def test_the_good_file_is_good(folder: Path) -> None:
    scene = Scene.loads(GOOD, folder)
    d = scene.definition
    assert [b.name for b in d.bodies] == ["mooring", "trawl", "buoy", "hull"]
    assert d.bodies[0].stretch_stiffness == 1e5 and d.bodies[0].density == 0.1 and d.bodies[2].density == 300
    assert d.dt == 1e-3 and d.gravity.dtype == np.float64 and d.constraints[0].points[0].index == 0
    assert d.forces[0].expression == ["5 * sin(2 * pi * t)", "0", "-0.1 * vz"]


# what is replaced (once), by what, the line of the error, and words that the message must hold
WRONG = [
    ("stretch_stiffness", "stretch_stifness", 14, r"bodies\[0\].stretch_stifness: .*did you mean 'stretch_stiffness'"),
    ("type: rope", "type: rop", 9, "bodies.0..type: unknown type 'rop', did you mean 'rope'"),
    ("type: rope", "type: 3", 9, "got 3"),
    ("type: rope", "scale: 3", 9, "'type' is needed"),
    ("name: mooring", "name: trawl", 17, "already the name of"),
    ("name: mooring", "name: two words", 10, "expected a name"),
    ("name: mooring", "name: ''", 10, "bodies.0..name: expected text, got an empty one"),
    ("name: mooring", "name: 12", 10, "expected text, got 12"),
    ("start: [0, 0, 1]", "start: [0, 0]", 11, r"shape \(3,\)"),
    ("start: [0, 0, 1]", "start: [0, 0, .nan]", 11, "finite"),
    ("start: [0, 0, 1]", "start: [0, 0, -.inf]", 11, "finite"),
    ("start: [0, 0, 1]", "start: [0, 0, 1e999]", 11, "finite"),
    ("start: [0, 0, 1]", "start: [0, 0, 1e13]", 11, "between -1e.12 and 1e.12"),
    ("stretch_stiffness: 1e5", "stretch_stiffness: 1e31", 14, "between"),
    ("start: [0, 0, 1]", "start: [0, 0, one]", 11, "'one'"),
    ("start: [0, 0, 1]", "start: [0, 0, true]", 11, "true"),
    ("start: [0, 0, 1]", "start: [4, 0, 1]", 12, "same place"),
    ("start: [0, 0, 1]", "start: [[0], [0, 1]]", 11, "start"),
    ("start: [0, 0, 1]", "start: {x: 0}", 11, "a mapping"),
    ("    start: [0, 0, 1]\n", "", 9, "'start'"),
    ("segments: 40", "segments: 0", 13, "at least 1"),
    ("segments: 40", "segments: 1.5", 13, "whole number"),
    ("segments: 40", "segments: 99999999999", 13, "at most"),
    ("segments: 40", "segments: 1" + "0" * 300, 13, "segments"),
    ("segments: 40", "segments: -3", 13, "at least 1"),
    ("segments: 40", "segments: 40\n    points: [[0, 0, 0], [1, 0, 0]]", None, "exactly one of"),
    ("segments: 40", "segments: 40\n    lines: [[0, 1]]", 14, "points only"),
    ("stretch_stiffness: 1e5", "stretch_stiffness: -1e5", 14, "at least 0"),
    ("stretch_stiffness: 1e5", "stretch_stiffness: stiff", 14, "expected a number"),
    ("stretch_stiffness: 1e5", "stretch_stiffness: .inf", 14, "finite"),
    ("stretch_stiffness: 1e5", "stretch_stiffness:", 14, "expected a number"),
    ("stretch_stiffness: 1e5", "density: 1\n    mass: 2", 15, "density or mass, not both"),
    ("stretch_stiffness: 1e5", "mass: 0", 14, "greater than 0"),
    ("stretch_stiffness: 1e5", "density: -1", 14, "greater than 0"),
    ("stretch_stiffness: 1e5", "scale: 0", 14, "greater than 0"),
    ("color: [0.8, 0.6, 0.1]", "color: [255, 0, 0]", 15, "at most 1"),
    ("color: [0.8, 0.6, 0.1]", "color: red", 15, "color"),
    ("size: [2, 1]", "size: [2, -1]", 18, "greater than 0"),
    ("size: [2, 1]", "size: [2, 1, 1]", 18, "shape"),
    ("cells: [20, 10]", "cells: [20, 0]", 19, "at least 1"),
    ("cells: [20, 10]", "cells: [20, 1.5]", 19, "whole"),
    ("cells: [20, 10]", "cells: [9999999, 9999999]", 19, "more than"),
    ("    cells: [20, 10]\n", "", 16, "'cells'"),
    ("density: 300", "density: 300\n    edge_length: 0.1", 28, "mesh or triangles only"),
    ("density: 300", "k_volum: 3", 27, "did you mean 'k_volume'"),
    ("density: 300", "k_volume: -3", 27, "at least 0"),
    ("cells: [2, 2, 2]", "cells: 2", 26, "cells"),
    ("cells: [2, 2, 2]", "cell: [2, 2, 2]", 26, "did you mean 'cells'"),
    ("mesh: hull.obj", "mesh: hul.obj", 30, "no file"),
    ("mesh: hull.obj", "mesh: hull.d", 30, "folder"),
    ("mesh: hull.obj", "mesh: [hull.obj]", 30, "text"),
    ("mesh: hull.obj", 'mesh: "a\\0b"', 30, "zero character"),
    ("mesh: hull.obj", "mesh: " + "x" * 999, 30, "no file"),
    ("mesh: hull.obj", "vertices: [[0, 0, 0]]\n    tetrahedra: [[0, 1, 2, 3]]", 31, "has 1 points"),
    ("mesh: hull.obj", "vertices: four.npy\n    tetrahedra: [[0, 1, 2, 2]]", 31, "twice"),
    ("mesh: hull.obj", "vertices: four.npy\n    tetrahedra: [[0, 1, 2, -1]]", 31, "0 or more"),
    ("mesh: hull.obj", "vertices: [[0, 0, 0]]", 28, "'tetrahedra'"),
    ("mesh: hull.obj", "vertices: none.npy\n    tetrahedra: [[0, 1, 2, 3]]", 30, "no file"),
    ("mesh: hull.obj", "vertices: many.npz\n    tetrahedra: [[0, 1, 2, 3]]", 30, "file.npz#key"),
    ("mesh: hull.obj", "vertices: many.npz#goal\n    tetrahedra: [[0, 1, 2, 3]]", 30, "did you mean 'goals'"),
    ("mesh: hull.obj", "vertices: many.npz#texts\n    tetrahedra: [[0, 1, 2, 3]]", 30, "numbers"),
    ("mesh: hull.obj", "vertices: many.npz#objects\n    tetrahedra: [[0, 1, 2, 3]]", 30, "numbers"),
    ("mesh: hull.obj", "vertices: broken.npz#a\n    tetrahedra: [[0, 1, 2, 3]]", 30, "cannot be read"),
    ("mesh: hull.obj", "vertices: hull.obj\n    tetrahedra: [[0, 1, 2, 3]]", 30, "expected an array"),
    ("body: trawl", "body: trawll", 33, "no body 'trawll', did you mean 'trawl'"),
    ('"-0.1 * vz"', '"-0.1 * vq"', 34, "column 8: unknown name 'vq' .known: x, y"),
    ('"-0.1 * vz"', '"__import__(1)"', 34, "unknown function"),
    ('"-0.1 * vz"', '"9 +"', 34, "cannot be read"),
    ('"-0.1 * vz"', ".nan", 34, "expression"),
    (', "-0.1 * vz"', "", 34, "3 items"),
    ("name: wind", "callable: os.system", 32, "scene file cannot hold"),
    ("type: nail", "type: nial", 36, "did you mean 'nail'"),
    ("type: nail", "type: [nail]", 36, "a list of 1"),
    ("name: bollard", "name: ring", 51, "already"),
    ("name: bollard", "nam: ring", 37, "unknown field, did you mean 'name'"),
    ("body: mooring\n      index: 0", "body: mooring", 38, "exactly one of"),
    ("index: 0", "index: -1", 40, "at least 0"),
    ("index: 0", "indices: []", 40, "shape"),
    ("index: 0", "index: 0\n      all: true", 41, "index and all together|all"),
    ("index: 0", "all: yes", 40, "true or false"),
    ("index: 0", "where: x >", 40, "cannot be read"),
    ("index: 0", "where: vx > 0", 40, "unknown name 'vx'"),
    ("index: 0", "box: [[1, 1, 1], [0, 0, 0]]", 40, "first corner"),
    ("index: 0", "nearest: [1, 2]", 40, "shape"),
    ("index: 0", "side: z", 40, "side"),
    ("index: 0", "index: 0\n      thickness: 0.1", 41, "side only"),
    ("times: [0, 1, 2]", "times: [0, 2, 2]", 42, "increase"),
    ("times: [0, 1, 2]", "times: [0, 1]", 43, "3 keys, but times has 2"),
    ("times: [0, 1, 2]", "times: []", 42, "shape"),
    ("offsets:", "velocities:", 43, "positions or offsets"),
    ("offsets:", "ofsets:", 43, "did you mean 'offsets'"),
    ("interpolation: smooth", "interpolation: smoth", 44, "did you mean 'smooth'"),
    ("end: 1.5", "end: 0", 46, "later than start"),
    ("steps: 20", "steps: 0", 48, "at least 1"),
    ("steps: 20", "mode: paper", 47, "missing"),
    ("max_speed: 2.0", "max_speed: 0", 49, "greater than 0"),
    ("max_speed: 2.0", "mode: slow", 49, "closing or paper"),
    ("nearest: tetrahedron", "nearest: tetrahedra", 53, "did you mean 'tetrahedron'"),
    ("nearest: tetrahedron", "elements: [[0, 1], [2, 3, 4]]", 53, "lengths|shape"),
    ("break_force: 1e4", "break_force: 0", 54, "greater than 0"),
    ("break_force: 1e4", "weights: [[0.5, 0.5]]", 54, "'elements'"),
    ("- [{body: mooring, index: 10}, {body: trawl, index: 0}]", "- [{body: mooring, index: 10}]", 58, "2 items"),
    ("{body: trawl, index: 0}", "{body: mooring, index: 10}", 58, "twice"),
    ("{body: trawl, index: 0}", "{body: mast, index: 10}", 58, "no body 'mast'"),
    ("groups:", "zip:", 58, "mapping"),
    ("surface: true", "surface: false", 63, "exactly one of"),
    ("surface: true", "surface: true, rope: true", 63, "surface and rope together|exactly one"),
    ("    goal: [0, 0, 0.1]\n", "", 64, "goal: this field is needed"),
    ("goal: [0, 0, 0.1]", "goal:", 67, "got nothing"),
    ("goal: [0, 0, 0.1]", "goal: fast", 67, "expected an array"),
    ("goal: [0, 0, 0.1]", "goal: {times: [0], positions: [[0, 0, 0]]}", 67, "takes velocities"),
    ("schema_version: 1", "schema_version: 2", 1, "expected 1"),
    ("dt: 1e-3", "dt: 0", 5, "greater than 0"),
    ("dt: 1e-3", "dt: -1", 5, "greater than 0"),
    ("dt: 1e-3", "dt: '0.001'", 5, "expected a number, got the text"),
    ("dt: 1e-3", "dt: true", 5, "got true"),
    ("dt: 1e-3", "dt: 0.001\ndt: 0.002", 6, "given twice"),
    ("dt: 1e-3", "Dt: 1e-3", 5, "did you mean 'dt'"),
    ("dt: 1e-3", "dt: !!python/object/apply:os.system ['true']", 5, "tag"),
    ("dt: 1e-3", "dt: !custom 3", 5, "tag"),
    ("dt: 1e-3", "dt: *nowhere", 5, "anchor"),
    ("dt: 1e-3", "\tdt: 1e-3", 5, "tab"),
    ("dt: 1e-3", "? [a, b]\n: 3", 5, "name of a field"),
    ("dt: 1e-3", "dt: [1", None, "cannot be read as YAML"),
    ("dt: 1e-3", "dt: 1e-3 }", 5, "expected a number|YAML"),
    ("dt: 1e-3", "dt: 'abc", None, "cannot be read as YAML"),
    ("dt: 1e-3", "dt: a: b", 5, "cannot be read as YAML"),
    ("dt: 1e-3", "<<: 3", 5, "takes a mapping"),
    ("dt: 1e-3", "dt: \x07", 5, "U.0007"),
    ("duration: 2", "duration: -2", 6, "at least 0"),
    ("duration: 2", "frames_per_second: 0", 6, "greater than 0"),
    ("velocity_verlet", "velocity-verlet", 7, "did you mean 'velocity_verlet'"),
    ("up_axis: Z", "up_axis: X", 3, "Z or Y"),
    ("gravity: [0, 0, -9.81]", "gravity: 9.81", 4, "shape"),
    ("bodies:\n", "bodies: none\nx:\n", 8, "expected a list"),
    ("bodies:\n", "boddies:\n", 8, "did you mean 'bodies'"),
    ("forces:\n", "forces: [3]\nx:\n", 31, "mapping"),
    ("constraints:\n", "constraints: {}\nx:\n", 35, "expected a list, got a mapping"),
    ("name: harbour", "name: harbour\n---\nname: b", 3, "second '---'"),
]  # fmt: skip


@pytest.mark.parametrize("case", WRONG, ids=[f"{i}-{case[1][:20].strip()!a}" for i, case in enumerate(WRONG)])
def test_wrong_files_name_line_and_field(case: tuple[str, str, int | None, str], folder: Path) -> None:
    old, new, line, words = case
    assert old in GOOD
    text = message(GOOD.replace(old, new, 1), folder)
    assert re.search(words, text), text
    if line is not None:
        assert f"bad.yaml:{line}: " in text, text


@pytest.mark.parametrize(
    "text",
    [
        "", "   \n", "# only a comment\n", "---\n", "null\n", "3\n", "- a\n- b\n", "just words\n", "[" * 100_000,
        "{" * 100_000, "a: " * 5000, "a:\n" + "".join(" " * i + "- \n" for i in range(200)), "[]", "x: [" + "[" * 60,
        b"\xff\xfe\x00\x01", b"\x00" * 100, bytes(range(256)), b"\x89PNG\r\n\x1a\n" + bytes(range(200)),
        "a: &a [*a]\n", "%YAML 9.9\n---\nname: x\nfoo: 1", "&a name: b\n*a : c\n", "name: \ud7ff\ufffe",
        "name: x\n" * 3, "{name: x, name: y}", "!!set {a, b}", "!!binary aGVsbG8=", "\u2028: 3", "'': 3", "? a\n? b\n",
        "a: 1\n b: 2", "bodies:\n- - - -", "bodies: [,]", "'\\q'", '"\\q"', "@x", "`x`", "a: |9\n x", "a: >-\n",
    ],
)  # fmt: skip
def test_what_is_no_scene_at_all(text: str | bytes, folder: Path) -> None:
    begin = time.perf_counter()
    assert "bad.yaml:" in message(text, folder)
    assert time.perf_counter() - begin < 2.0


def test_files_that_are_not_there(tmp_path: Path) -> None:
    for path, words in [(tmp_path / "none.yaml", "no such file"), (tmp_path, "folder"), (tmp_path / "a\0b", "read")]:
        with pytest.raises(InputError, match=words) as caught:
            Scene.load(path)
        assert str(tmp_path) in str(caught.value)


def test_every_misspelt_key_is_found_in_its_line(folder: Path) -> None:
    """One wrong letter in each key: the line is right, and the key is suggested."""
    count = 0
    for i, line in enumerate(LINES):
        match = re.match(r"^(\s*(?:- )?)(\w{4,}):", line)
        if not match or match[2] == "type":
            continue
        key = match[2]
        wrong = [*LINES[:i], line.replace(key, key[:-1] + "q" + key[-1], 1), *LINES[i + 1 :]]
        text = message("\n".join(wrong), folder)
        assert f"bad.yaml:{i + 1}: " in text and f"did you mean {key!r}?" in text, text
        count += 1
    assert count > 25


VALUES = [
    "3",
    "-1",
    "text",
    "true",
    "[]",
    "{}",
    "[1, 2]",
    "{a: 1}",
    ".nan",
    "1e999",
    "",
    "[[[[1]]]]",
    "'9'",
    "2023-01-01",
]


def test_every_value_of_a_wrong_type_is_an_input_error(folder: Path) -> None:
    """Each value is replaced by each of many others: the file loads, or the error has a line, and nothing else."""
    file = folder / "bad.yaml"
    failed = 0
    for i, line in enumerate(LINES):
        head, colon, _ = line.partition(":")
        if not colon or "{" in head or "[" in head:
            continue
        block = [x for x in LINES[i + 1 :]]
        while block and (len(block[0]) - len(block[0].lstrip())) > len(head) - len(head.lstrip(" -")):
            block.pop(0)  # what hangs below the replaced value goes with it
        for value in VALUES:
            file.write_text("\n".join([*LINES[:i], f"{head}: {value}", *block]) + "\n")
            try:
                Scene.load(file)
            except InputError as error:
                failed += 1
                assert re.match(re.escape(str(file)) + r":\d+: ", str(error)), error
    assert failed > 400


def test_damaged_files_give_input_errors_only(folder: Path) -> None:
    """Cut anywhere, and letters changed, removed, doubled at random."""
    file = folder / "bad.yaml"
    rng = random.Random(1)
    data = GOOD.encode()
    samples = [data[:n] for n in range(0, len(data), 23)]
    for _ in range(250):
        broken = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(broken))
            action = rng.randrange(4)
            if action == 0:
                broken[at] = rng.randrange(256)
            elif action == 1:
                del broken[at : at + rng.randint(1, 30)]
            elif action == 2:
                broken[at:at] = broken[at : at + rng.randint(1, 30)]
            else:
                broken[at:at] = rng.choice(
                    [b"{", b"[", b": ", b"- ", b"*", b"&a ", b"!", b"'", b'"', b"\t", b"\n", b"#"]
                )
        samples.append(bytes(broken))
    wrong = 0
    for sample in samples:
        file.write_bytes(sample)
        try:
            Scene.load(file)
        except InputError as error:
            wrong += 1
            assert str(error).startswith(f"{file}:")
    assert wrong > len(samples) // 2


def test_several_errors_at_once_at_most_twenty(folder: Path) -> None:
    text = message(GOOD.replace("segments: 40", "segmets: 40").replace("dt: 1e-3", "dt: 0"), folder)
    assert [line.split(":")[1] for line in text.splitlines()] == ["5", "13"]
    many = "bodies:\n" + "".join(f"- {{type: rope, name: r{i}, start: [0], end: 3}}\n" for i in range(30))
    lines = message(many, folder).splitlines()
    assert len(lines) == 21 and lines[-1].startswith("... and ")


def test_aliases_are_fine_and_bombs_are_not(folder: Path) -> None:
    scene = Scene.loads(
        "bodies:\n- &a {type: net, name: a, size: &s [1, 1], cells: [2, 2]}\n- {<<: *a, name: b, size: *s, mass: 3}\n"
    )
    assert scene.definition.bodies[1].name == "b" and scene.definition.bodies[1].mass == 3
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    for i in range(1, 12):
        bomb += f"a{i}: &a{i} [" + ", ".join([f"*a{i - 1}"] * 9) + "]\n"
    begin = time.perf_counter()
    assert "aliases expand" in message(bomb, folder)
    assert time.perf_counter() - begin < 1.0


def test_numbers_follow_yaml_1_2(folder: Path) -> None:
    for text, value in [
        ("1e5", 1e5),
        ("1E-2", 0.01),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("0x10", 16),
        ("0o17", 15),
        ("012", 12),
    ]:
        assert Scene.loads(f"duration: {text}").definition.duration == value
    for text in ["1_000", "1:30", "yes", "0b1", "1e", "--1", '"1e5"']:
        assert "expected a number" in message(f"duration: {text}", folder)
    assert Scene.loads("name: on").definition.name == "on"


def test_schema_describes_files() -> None:
    schema = json_schema()
    assert schema["additionalProperties"] is False
    rope = schema["$defs"]["RopeDef"]["properties"]
    assert "[N/m]" in rope["stretch_stiffness"]["description"]
    assert rope["start"]["anyOf"][0] == {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    assert "callable" not in schema["$defs"]["ForceDef"]["properties"]
    for name, definition in schema["$defs"].items():
        for field, value in definition["properties"].items():
            assert field == "type" or re.search(r"\[.+\]\.?", value.get("description", "")), f"{name}.{field}: no unit"
