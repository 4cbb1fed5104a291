"""Wrong inputs by the hundred: files spoiled by hand and by dice, and what to call with each."""

import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scene_example import GOOD
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app

NETS = GOOD.replace("dt: 1e-3", "dt: 1e-3\nconflicts: solve")
CONTACT = """\
name: drop
dt: 4e-3
duration: 0.02
contact: {friction: 0.4, delta: 2e-3}
frictions:
- {between: [cloth, ground], static: 0.5, dynamic: 0.2}
bodies:
- {type: obstacle, name: ground, plane: [4, 4]}
- {type: cloth, name: cloth, size: [1, 1], cells: [3, 3], position: [0, 0, 0.5], bend_model: hinges, bend_stiffness: 1e-4}
- {type: solid, name: ball, box: {size: [0.2, 0.2, 0.2], cells: [1, 1, 1]}, position: [0, 0, 1], youngs_modulus: 1e4}
"""
JOINTS = """\
name: arm
up_axis: Y
dt: 1e-3
duration: 0.01
solver: equality
bodies:
- {type: rigid, name: base, box: [1, 1, 1], motion: immobile}
- {type: rigid, name: arm, capsule: {radius: 0.1, length: 0.8}, position: [0, 1, 0], mass: 2, inertia: [0.1, 0.1, 0.02]}
- type: rigid
  name: hand
  position: [0, 2, 0]
  parts:
  - {sphere: 0.1, density: 500}
  - {cylinder: {radius: 0.05, length: 0.3}, rotation: [0, 1.57, 0]}
constraints:
- {type: revolute, name: elbow, body0: base, body1: arm, anchor: [0, 0.5, 0], axis: [0, 0, 1], lower_limit: -1, upper_limit: 1}
- {type: ball, name: wrist, body0: arm, body1: hand, anchor: [0, 1.5, 0]}
- type: joint
  name: guide
  body0: base
  body1: hand
  axial: {axis: [0, 1, 0], min: -5, max: 5}
  local_pos0: [0, 0, 0]
  local_pos1: [0, 0, 0]
  motor: {on: axial, target_velocity: 0.1, max_force: 10}
"""
ROPE = """\
name: rope
dt: 1e-3
duration: 0.05
frames_per_second: 100
bodies:
- {type: rope, name: rope, start: [0, 0, 0], end: [1, 0, 0], segments: 5}
- {type: rigid, name: brick, box: [0.1, 0.2, 0.3], position: [0, 1, 0]}
constraints:
- {type: nail, name: top, points: {body: rope, index: 0}}
"""
DESCRIPTION = """\
world name pair; up Y; gravity 0 -9.81 0; dt .001; duration .01; end
object a box 1 2 3; mass 2; immobile; end
object b sphere 1; position 0 3 0; spin 0 0 1; end
object d type rope; first 0 5 0; last 0 6 0; segments 4; end
constraint object1 a; object2 b; hinge 0 0 0 0 -3 0; end
constraint type nail; points of d index 0; end
"""
URDF = """<robot name="r"><link name="world"/><link name="base"><inertial><origin xyz="0 0 .1"/><mass value="2"/>
<inertia ixx=".1" iyy=".1" izz=".1"/></inertial><collision><geometry><box size="1 2 3"/></geometry></collision></link>
<joint name="j" type="revolute"><origin xyz="0 0 1" rpy="0 .1 0"/><parent link="world"/><child link="base"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="2"/></joint></robot>"""
MJCF = """<mujoco><option timestep="0.002" gravity="0 0 -9.81"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="a" pos="0 0 1"><joint type="hinge" axis="0 1 0" range="-90 90"/><geom type="box" size=".1 .2 .3"/></body>
</worldbody><equality><connect body1="a" anchor="0 0 .3"/></equality></mujoco>"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
NASTY = ("", "null", "true", ".nan", "-.inf", "1e400", "-1", "0", "1e-320", "99999999999999999999", "abc", "[]", "{}", "[[]]",
         "[1, 2]", "[1, 2, 3, 4]", "{a: 1}", "'", "!!python/object:os.system x", "&a [*a]", "0x1g", "\u0000", "~", "1:30", "1,5",
         "[a, b, c]", "[.nan, 0, 0]", "[1e20, 0, 0]", "2026-01-01", "«»", "none.obj", "../../x", "x" * 5000)  # fmt: skip


@dataclass
class Case:
    """A command that is to be refused, or to do its work."""

    name: str
    words: list[str]


@dataclass
class Answer:
    """What the command said."""

    code: int
    error: str
    exception: BaseException | None


def call(words: list[str]) -> Answer:
    """The command in this process, all exceptions seen."""
    result = CliRunner().invoke(app, words)
    exception = None if isinstance(result.exception, SystemExit) else result.exception
    return Answer(result.exit_code, result.stderr, exception)


def replaced_value(text: str, dice: random.Random) -> str:
    """One value of a YAML text, in a flow or after a colon, by a nasty one."""
    places = [i for i, c in enumerate(text) if c in ":[," and i + 1 < len(text) and text[i + 1] in " 0123456789-"]
    at = dice.choice(places) + 1
    end = at + 1
    while end < len(text) and text[end] not in ",]}\n":
        end += 1
    return text[:at] + " " + dice.choice(NASTY) + text[end:]


def shuffled_lines(text: str, dice: random.Random) -> str:
    """A line lost, doubled, moved, or indented."""
    lines = text.split("\n")
    at = dice.randrange(len(lines))
    way = dice.randrange(4)
    if way == 0:
        del lines[at]
    elif way == 1:
        lines.insert(dice.randrange(len(lines)), lines[at])
    elif way == 2:
        lines.insert(dice.randrange(len(lines)), lines.pop(at))
    else:
        lines[at] = " " * dice.randrange(1, 5) + lines[at]
    return "\n".join(lines)


def scratched(data: bytes, dice: random.Random) -> bytes:
    """Bytes cut off, overwritten, taken out, or put in."""
    if not data:
        return b"\xff"
    at = dice.randrange(len(data))
    length = dice.choice((1, 1, 2, 8, 64))
    way = dice.randrange(4)
    if way == 0:
        return data[:at]
    if way == 1:
        return data[:at] + dice.randbytes(length) + data[at + length :]
    if way == 2:
        return data[:at] + data[at + length :]
    return data[:at] + dice.randbytes(length) + data[at:]


def misspelt(text: str, dice: random.Random) -> str:
    """A letter of a word exchanged, lost, or doubled."""
    places = [i for i, c in enumerate(text) if c.isalpha()]
    at = dice.choice(places)
    return text[:at] + dice.choice(("", "q", text[at] * 2, "Ä", "#", "-")) + text[at + 1 :]


def scenes(folder: Path, count: int) -> Iterator[Case]:
    """Scene files."""
    dice = random.Random(1)
    (folder / "hull.obj").write_text(TETRAHEDRON)
    spoil: list[Callable[[str, random.Random], str]] = [replaced_value, replaced_value, shuffled_lines, misspelt]
    for number in range(count):
        text = (NETS, CONTACT, JOINTS)[number % 3]
        for _ in range(dice.choice((1, 1, 2))):
            text = dice.choice(spoil)(text, dice)
        file = folder / f"scene{number}.yaml"
        file.write_text(text, encoding="utf-8")
        yield Case(f"scene {number}", ["check", str(file)])


def descriptions(folder: Path, count: int) -> Iterator[Case]:
    """Files of the description language."""
    dice = random.Random(2)
    for number in range(count):
        words = DESCRIPTION.split(" ")
        at = dice.randrange(len(words))
        way = dice.randrange(5)
        if way == 0:
            del words[at]
        elif way == 1:
            words[at] = dice.choice(NASTY)
        elif way == 2:
            words.insert(
                at, dice.choice(("end", ";", "(", ")", "{", "object", "constraint", "/*", '"', "nan", "-", "1e999"))
            )
        elif way == 3:
            words[at] = misspelt(words[at] + "x", dice)
        else:
            words = words[:at]
        file = folder / f"description{number}.gascuel"
        file.write_text(" ".join(words), encoding="utf-8")
        yield Case(f"description {number}", ["check", str(file)])


def mesh_files() -> Iterator[tuple[str, bytes]]:
    """Meshes that are none, by hand; each suffix with the same nonsense too."""
    yield "nan.obj", TETRAHEDRON.replace("v 1 0 0", "v nan 0 0").encode()
    yield "inf.obj", TETRAHEDRON.replace("v 1 0 0", "v inf 0 0").encode()
    yield "far.obj", TETRAHEDRON.replace("v 1 0 0", "v 1e300 0 0").encode()
    yield "index.obj", TETRAHEDRON.replace("f 2 3 4", "f 2 3 9").encode()
    yield "zero.obj", TETRAHEDRON.replace("f 2 3 4", "f 0 3 4").encode()
    yield "minus.obj", TETRAHEDRON.replace("f 2 3 4", "f -9 3 4").encode()
    yield "words.obj", TETRAHEDRON.replace("v 1 0 0", "v one two three").encode()
    yield "points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    yield "flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
    yield "open.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\n"
    yield "same.obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    yield "lines.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n"
    yield (
        "huge.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n",
    )
    yield "text.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1 2 3\n"
    yield "count.stl", b"\0" * 80 + struct.pack("<I", 4000000000) + b"\0" * 50
    yield "vector.vtk", b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n0 0\n"
    yield "hexa.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1 1 1\n$EndNodes\n"
    yield "json.glb", b"glTF\x02\0\0\0\x20\0\0\0\x08\0\0\0JSON{}      "
    for suffix in ("obj", "ply", "stl", "glb", "off", "msh", "vtk", "vtu", "mesh"):
        yield f"empty.{suffix}", b""
        yield f"noise.{suffix}", random.Random(3).randbytes(400)
        yield f"words.{suffix}", b"This is no mesh.\n" * 3
        yield f"zeros.{suffix}", bytes(300)
    yield "page.dae", b"<html></html>"


def meshes(folder: Path) -> Iterator[Case]:
    """Scenes whose mesh is wrong, as three kinds of bodies."""
    kinds = {
        "solid": "{{type: solid, name: m, mesh: {}}}",
        "cloth": "{{type: cloth, name: m, mesh: {}}}",
        "rigid": "{{type: rigid, name: m, mesh: {}}}",
    }
    for i, (name, data) in enumerate(mesh_files()):
        (folder / name).write_bytes(data)
        kind = list(kinds)[i % 3]
        file = folder / f"mesh{i}.yaml"
        file.write_text(f"bodies:\n- {kinds[kind].format(name)}\n")
        yield Case(f"{kind} of {name}", ["check", str(file)])


def made_files(folder: Path) -> dict[str, Path]:
    """A recording in each format that is read back, a checkpoint, and the scene they are of."""
    (folder / "rope.yaml").write_text(ROPE)
    names = {"npz": "run.npz", "vtkhdf": "run.vtkhdf", "checkpoint": "run.checkpoint"}
    paths = {kind: folder / name for kind, name in names.items()}
    scene = turnbuckle.Scene.load(folder / "rope.yaml")
    turnbuckle.run_scene(scene, out=[paths["npz"], paths["vtkhdf"]], checkpoint=paths["checkpoint"], every=20)
    return {**paths, "scene": folder / "rope.yaml"}


def recordings(folder: Path, made: dict[str, Path], count: int) -> Iterator[Case]:
    """Recordings with bytes lost and changed."""
    dice = random.Random(4)
    for number in range(count):
        kind = ("npz", "vtkhdf")[number % 2]
        file = folder / f"recording{number}.{kind}"
        file.write_bytes(scratched(made[kind].read_bytes(), dice))
        out = str(folder / "frame.obj")
        yield Case(f"recording {number} ({kind})", ["export", str(file), "--to", "obj", "--frame", "-1", "--out", out])


def checkpoints(folder: Path, made: dict[str, Path], count: int) -> Iterator[Case]:
    """Checkpoints with bytes lost and changed."""
    dice = random.Random(5)
    for number in range(count):
        file = folder / f"state{number}.checkpoint"
        file.write_bytes(scratched(made["checkpoint"].read_bytes(), dice))
        yield Case(f"checkpoint {number}", ["run", str(made["scene"]), "--resume", str(file)])


def foreign(folder: Path, count: int) -> Iterator[Case]:
    """URDF and MJCF with attributes spoiled."""
    dice = random.Random(6)
    for number in range(count):
        text, suffix = ((URDF, "urdf"), (MJCF, "xml"))[number % 2]
        quotes = [i for i, c in enumerate(text) if c == '"']
        way = dice.randrange(3)
        if way == 0:
            k = 2 * dice.randrange(len(quotes) // 2)
            text = (
                text[: quotes[k] + 1]
                + dice.choice(("", "nan", "a b", "1 2 3 4 5 6 7", "-1", "1e999"))
                + text[quotes[k + 1] :]
            )
        elif way == 1:
            text = misspelt(text, dice)
        else:
            text = text[: dice.randrange(len(text))]
        file = folder / f"foreign{number}.{suffix}"
        file.write_text(text, encoding="utf-8")
        yield Case(f"foreign {number}", ["import", str(file), str(folder / "imported.yaml")])


def others(folder: Path, made: dict[str, Path]) -> Iterator[Case]:
    """Arguments, places and kinds of files that do not go together."""
    scene, npz = str(made["scene"]), str(made["npz"])
    (folder / "latin.yaml").write_bytes("name: h\u00e9".encode("latin-1"))
    (folder / "deep.yaml").write_text("bodies: " + "[" * 3000)
    (folder / "bomb.yaml").write_text(
        "a: &a [x]\n" + "".join(f"{c}: &{c} [*{p},*{p},*{p}]\n" for p, c in zip("abcdefgh", "bcdefghi", strict=True))
    )
    (folder / "array.yaml").write_text("bodies:\n- {type: rope, name: r, points: 'x.npy'}\n")
    np.save(folder / "x.npy", np.array([{}], dtype=object), allow_pickle=True)
    (folder / "folder.yaml").mkdir(exist_ok=True)
    for words in (
        ["run", str(folder)], ["run", str(folder / "latin.yaml")], ["check", str(folder / "deep.yaml")],
        ["check", str(folder / "bomb.yaml")], ["check", str(folder / "array.yaml")], ["check", str(folder / "folder.yaml")],
        ["run", scene, "--dt", "nan"], ["run", scene, "--dt", "0"], ["run", scene, "--duration", "-1"],
        ["run", scene, "--duration", "inf"], ["run", scene, "--set", "x"], ["run", scene, "--set", "dt"],
        ["run", scene, "--set", "bodies.none.density=3"], ["run", scene, "--set", "bodies[9].density=3"],
        ["run", scene, "--set", "=3"], ["run", scene, "--set", "dt=[1"], ["run", scene, "--set", "bodies=3"],
        ["run", scene, "--out", "a.avi"], ["run", scene, "--out", str(folder / "no" / "a.npz")],
        ["run", scene, "--out", str(folder)], ["run", scene, "--out", "/dev/null"], ["run", scene, "--every", "3"],
        ["run", scene, "--checkpoint", str(folder)], ["run", scene, "--report", str(folder)],
        ["run", scene, "--resume", npz], ["run", scene, "--resume", scene], ["run", scene, "--device", "cuda:77"],
        ["run", scene, "--device", "nonsense"], ["run", scene, "--device", ""], ["run", npz], ["check", npz],
        ["check", str(made["vtkhdf"])], ["run", "curtian"], ["run", ""], ["run", "\0"], ["check", "x" * 5000],
        ["run", "curtain", "--set", "m=abc"], ["run", "curtain", "--set", "m=-3"], ["run", "curtain", "--set", "m=1e9"],
        ["export", scene, "--to", "obj"], ["export", npz, "--to", "step"], ["export", npz, "--to", "obj", "--frame", "99"],
        ["export", str(folder), "--to", "obj"], ["export", "none.npz", "--to", "glb"], ["export", npz, "--to", ""],
        ["import", scene, "x.yaml"], ["import", npz, "x.yaml"], ["import", str(folder), "x.yaml"],
        ["convert", npz, "x.yaml"], ["convert", scene, "x.txt"], ["convert", scene, str(folder / "no" / "x.yaml")],
        ["sweep", scene, "--vary", "dt=a:b:c"], ["sweep", scene, "--vary", "dt=1:2:3:4"], ["sweep", scene, "--vary", "x"],
        ["sweep", scene, "--vary", "dt=.nan,-1", "--out", str(folder / "sw")],
        ["sweep", npz, "--vary", "dt=1e-3,2e-3", "--out", str(folder / "sw")],
        ["sweep", scene, "--vary", "dt=1e-3,2e-3", "--out", npz], ["assemble", scene, "--out", "x.txt"],
        ["assemble", scene, "--out", str(folder / "no" / "x.yaml")], ["check", scene, "--graph", str(folder)],
        ["check", scene, "--graph", "x.docx"], ["bench", "nonsense"],
    ):  # fmt: skip
        yield Case(" ".join(w[:60] for w in words), words)
