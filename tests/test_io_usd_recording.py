"""USD read back as a recording: ours, and that of another program."""

from pathlib import Path

import numpy as np
import pytest

import turnbuckle
from turnbuckle.io import read_recording

pytest.importorskip("pxr")


def test_a_run_recorded_as_usd_plays_as_the_same_run(tmp_path: Path) -> None:
    scene = turnbuckle.Scene("both", dt=2e-4, duration=0.1, frames_per_second=50.0)
    scene.add_rigid("bob", box=[0.1, 0.2, 0.3], position=[1, 0, 0], mass=1.0, velocity=[0, 0, 1])
    scene.add_joint("ball", "pivot", body1="bob", anchor=[0.6, 0, 0])
    scene.add_cloth("flag", size=[0.3, 0.2], cells=[3, 2], position=[0, 0, 1], color=[0.2, 0.4, 0.6])
    scene.add_rope("rope", start=[0, 1, 0], end=[1, 1, 0], segments=4)
    scene.add_obstacle("floor", box=[3, 3, 0.1], position=[0, 0, -2])
    turnbuckle.run_scene(scene, out=[tmp_path / "run.npz", tmp_path / "run.usdc"])
    true, read = read_recording(tmp_path / "run.npz"), read_recording(tmp_path / "run.usdc")
    assert np.allclose(read.times, true.times, atol=1e-9) and read.info["frames_per_second"] == 50.0
    shapes = {shape.name: shape for shape in read.shapes}
    assert set(shapes) == {"bob", "flag", "rope", "floor"}
    assert shapes["bob"].local is not None and not shapes["bob"].still and shapes["floor"].still
    assert np.allclose(shapes["flag"].color, [0.2, 0.4, 0.6], atol=1e-6)
    for shape in true.shapes:
        mine = shapes[shape.name]
        for frame in (0, len(true) - 1):
            x = true.x(frame)[shape.begin : shape.end]
            got = read.x(frame)[mine.begin : mine.end]
            used = np.unique(shape.triangles) if len(shape.triangles) else np.unique(shape.lines)
            away = np.linalg.norm(got[:, None] - x[used][None], axis=2)
            assert away.min(axis=0).max() < 1e-6 and away.min(axis=1).max() < 1e-6, (shape.name, frame)
    v = read.v(2)[shapes["flag"].begin : shapes["flag"].end]
    flag = next(s for s in true.shapes if s.name == "flag")
    assert np.abs(v).max() > 0.1 and np.allclose(v, true.v(2)[flag.begin : flag.end], atol=1e-4)
    turnbuckle.export_recording(tmp_path / "run.usdc", tmp_path / "again.glb")
    assert (tmp_path / "again.glb").stat().st_size > 1000


def test_the_film_of_another_program(tmp_path: Path) -> None:
    """Quads, centimetres, Y up, a transform that moves, points that move."""
    (tmp_path / "other.usda").write_text(
        """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
    timeCodesPerSecond = 24
)
def Xform "Carrier" {
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (100, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "Quad" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (100, 0, 0), (100, 100, 0), (0, 100, 0)]
    }
}
def Mesh "Wave" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points.timeSamples = { 0: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], 12: [(0, 0, 0), (1, 0, 0), (0, 9, 0)] }
}
"""
    )
    read = read_recording(tmp_path / "other.usda")
    assert np.allclose(read.times, [0.0, 0.5, 1.0]) and read.info["up_axis"] == "Y"
    quad, wave = read.shapes
    assert len(quad.triangles) == 2 and quad.local is not None and wave.local is None
    assert np.allclose(read.x(1)[quad.begin], [0.5, 0, 0]) and np.allclose(read.x(2)[wave.end - 1], [0, 0.09, 0])
    assert np.allclose(read.v(1)[quad.begin], [1, 0, 0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("#usda 1.0\n", "no mesh"),
        ("#usda 1.0\ndef Mesh", "no USD file"),
        ('#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 9]\n'
         "point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n}\n", "no point"),
        ('#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 1, 2]\n'
         "point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n}\n", "do not fit"),
    ],
)  # fmt: skip
def test_wrong_files(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "wrong.usda").write_text(text)
    with pytest.raises(turnbuckle.InputError, match=words):
        read_recording(tmp_path / "wrong.usda")
