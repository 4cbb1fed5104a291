"""Recordings in other formats, opened by the libraries that read those: positions, times and topology are those of the run."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.data.errors import InputError
from turnbuckle.io import Recording, read_recording

FRAMES = 5


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rope, a solid and a spinning brick."""
    scene = turnbuckle.Scene("mixed", dt=1e-3, duration=0.2, frames_per_second=20, up_axis="Z")
    scene.add_rope("rope", start=[0, 0, 1], end=[0.5, 0, 1], segments=4, mass=0.1, color=[1, 0, 0])
    scene.add_cloth("cloth", size=[1, 1], cells=[3, 3], position=[1, 0, 1])
    scene.add_solid("cube", box={"size": [0.3, 0.3, 0.3], "cells": [1, 1, 1]}, position=[-1, 0, 1])
    scene.add_rigid("brick", box=[0.2, 0.3, 0.1], position=[0, 1, 1], angular_velocity=[1, 2, 3])
    scene.add_constraint("nail", "top", points={"body": "rope", "index": 0})
    path = tmp_path_factory.mktemp("recorded") / "run.npz"
    turnbuckle.run_scene(scene, out=[path])
    return path


@pytest.fixture
def run(recorded: Path) -> Recording:
    found = read_recording(recorded)
    assert len(found) == FRAMES
    return found


def points(run: Recording, name: str, frame: int) -> np.ndarray:
    shape = next(s for s in run.shapes if s.name == name)
    return run.x(frame)[shape.begin : shape.end]


def same_set(a: np.ndarray, b: np.ndarray, tolerance: float) -> bool:
    """Whether two sets of places are the same in some order."""
    near = np.linalg.norm(a[:, None] - b[None], axis=2)
    return bool(near.min(axis=1).max() < tolerance and near.min(axis=0).max() < tolerance)


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_meshes_of_each_frame(recorded: Path, run: Recording, tmp_path: Path, suffix: str) -> None:
    files = turnbuckle.export_recording(recorded, tmp_path / f"m.{suffix}")
    assert [f.name for f in files] == [f"m_{i:04d}.{suffix}" for i in range(FRAMES)]
    last = trimesh.load(files[-1], process=False, force="mesh")
    drawn = np.concatenate([points(run, name, -1) for name in ("cloth", "cube", "brick")])
    # trimesh takes the triangles of a file; the rope is of lines.
    assert same_set(np.asarray(last.vertices)[np.unique(last.faces)], drawn, 1e-6)
    triangles = sum(len(s.triangles) for s in run.shapes)
    assert len(last.faces) == triangles
    text = files[0].read_bytes()
    assert text.count(b"\nl ") == 4 if suffix == "obj" else b"element edge 4\n" in text
    one = turnbuckle.export_recording(recorded, tmp_path / f"one.{suffix}", frame=-1)
    assert one == [tmp_path / f"one.{suffix}"] and one[0].read_bytes() == files[-1].read_bytes()


def glb(path: Path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert magic == b"glTF" and version == 2 and total == len(data)
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    length, binary = struct.unpack_from("<I4s", data, 20 + size)
    assert binary == b"BIN\0" and 28 + size + length == total
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def values(content: dict, binary: bytes, number: int) -> np.ndarray:
    accessor = content["accessors"][number]
    view = content["bufferViews"][accessor["bufferView"]]
    assert view["byteOffset"] % 4 == 0
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    kind = {5126: np.float32, 5125: np.uint32}[accessor["componentType"]]
    found = np.frombuffer(binary, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
    if "max" in accessor:
        assert found.max(axis=0).tolist() == accessor["max"] and found.min(axis=0).tolist() == accessor["min"]
    return found


def test_glb_is_the_run(recorded: Path, run: Recording, tmp_path: Path) -> None:
    (file,) = turnbuckle.export_recording(recorded, tmp_path / "run.glb")
    scene = trimesh.load(file)
    assert set(scene.geometry) >= {"cloth", "cube", "brick"}
    turned = np.asarray(scene.to_geometry().bounds)  # glTF is Y up
    drawn = np.concatenate([points(run, n, 0) for n in ("rope", "cloth", "cube", "brick")])
    assert np.allclose(turned[:, 1], [drawn[:, 2].min(), drawn[:, 2].max()], atol=1e-6)

    content, binary = glb(file)
    nodes = {node["name"]: (i, node) for i, node in enumerate(content["nodes"])}
    channels = content["animations"][0]["channels"]
    samplers = content["animations"][0]["samplers"]

    def channel(name: str, path: str) -> np.ndarray:
        (found,) = [c for c in channels if c["target"] == {"node": nodes[name][0], "path": path}]
        sampler = samplers[found["sampler"]]
        assert np.allclose(values(content, binary, sampler["input"])[:, 0], run.times, atol=1e-6)
        return values(content, binary, sampler["output"])

    # What deforms: base and weights times targets are the frame, in every frame.
    mesh = content["meshes"][nodes["cloth"][1]["mesh"]]
    (primitive,) = [p for p in mesh["primitives"] if p["mode"] == 4]
    base = values(content, binary, primitive["attributes"]["POSITION"])
    targets = np.array([values(content, binary, t["POSITION"]) for t in primitive["targets"]])
    weights = channel("cloth", "weights").reshape(FRAMES, FRAMES - 1)
    for frame in range(FRAMES):
        assert np.allclose(
            base + np.einsum("t,tnd->nd", weights[frame], targets), points(run, "cloth", frame), atol=1e-6
        )
    # What is rigid: the node carries the corners to where they were.
    from scipy.spatial.transform import Rotation

    brick = content["meshes"][nodes["brick"][1]["mesh"]]["primitives"][0]
    corners = values(content, binary, brick["attributes"]["POSITION"])
    places, turns = channel("brick", "translation"), channel("brick", "rotation")
    for frame in range(FRAMES):
        moved = Rotation.from_quat(np.array(turns[frame])).apply(np.array(corners, dtype=float)) + places[frame]
        assert same_set(moved, points(run, "brick", frame), 1e-5)


def test_usd_has_the_frames(recorded: Path, run: Recording, tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom

    (file,) = turnbuckle.export_recording(recorded, tmp_path / "run.usdc", every=2)
    stage = pxr.Stage.Open(str(file))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/cloth/surface"))
    codes = mesh.GetPointsAttr().GetTimeSamples()
    rate = stage.GetTimeCodesPerSecond()
    assert np.allclose(np.array(codes) / rate, run.times[::2])
    assert np.allclose(np.array(mesh.GetPointsAttr().Get(codes[-1])), points(run, "cloth", 4), atol=1e-6)


def test_vtk_reads_the_frames(recorded: Path, run: Recording, tmp_path: Path) -> None:
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    (file,) = turnbuckle.export_recording(recorded, tmp_path / "run.vtkhdf")
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == FRAMES
    reader.SetStep(3)
    reader.Update()
    grid = reader.GetOutputDataObject(0)
    assert np.allclose(vtk_to_numpy(grid.GetPoints().GetData()), run.x(3), atol=1e-6)


def test_films_have_the_frames(recorded: Path, tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    (film,) = turnbuckle.export_recording(recorded, tmp_path / "run.mp4")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    assert frames == FRAMES and seconds == pytest.approx(FRAMES / 20, abs=0.02)


def test_a_recording_comes_back_bit_for_bit(recorded: Path, run: Recording, tmp_path: Path) -> None:
    (file,) = turnbuckle.export_recording(recorded, tmp_path / "again.vtkhdf")
    again = read_recording(turnbuckle.export_recording(file, tmp_path / "back.npz")[0])
    assert np.array_equal(again.times, run.times) and np.array_equal(again.x(2), run.x(2))
    assert again.info["scene"] == "mixed" and [s.name for s in again.shapes] == [s.name for s in run.shapes]


def test_the_command(recorded: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["export", str(recorded), "--to", "obj", "--out", str(tmp_path / "f%02d.obj")])
    assert done.exit_code == 0 and "(5 files)" in done.stdout and (tmp_path / "f04.obj").is_file()
    for words, what in (
        ([str(recorded), "--to", "fbx"], "expected one of"), ([str(recorded), "--to", "obj", "--every", "0"], "at least 1"),
        ([str(recorded), "--to", "obj", "--frame", "9"], "there is no frame 9"),
        ([str(recorded), "--to", "npz"], "is the recording itself"), (["none.npz", "--to", "obj"], "no such file"),
        ([str(recorded), "--to", "glb", "--out", "a.obj"], "ends in .glb"),
        (["four_bars", "--to", "obj"], "a scene can be exported to"),
    ):  # fmt: skip
        result = CliRunner().invoke(app, ["export", *words])
        assert result.exit_code == 2 and what in result.stderr, (words, result.output)


def test_too_many_shapes_for_glb_are_refused(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turnbuckle.io.export_glb.FRAMES", 3)
    with pytest.raises(InputError, match="give --every 2"):
        turnbuckle.export_recording(recorded, tmp_path / "run.glb")
