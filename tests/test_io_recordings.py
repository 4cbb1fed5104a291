"""What a run writes is what is read back, by us and by the programs the formats are for."""

import json
import zipfile

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.io import SUFFIXES, open_recorder, read_recording
from turnbuckle.meshes.embedding import embed
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, grid_sheet

FRAMES = 70  # more than the room first laid out


@pytest.fixture(scope="module")
def scene():
    """A solid with a finer skin, a cloth and a rope; positions at rest."""
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (2, 2, 2))
    fine, fine_tetrahedra = box_tetrahedra((0.9, 0.9, 0.9), (3, 3, 3))
    used, triangles = np.unique(boundary_triangles(fine_tetrahedra), return_inverse=True)
    skin = Skin(*embed(fine[used] + 0.05, vertices, tetrahedra), triangles.reshape(-1, 3).astype(np.int32))
    sheet = grid_sheet((1, 1), (3, 3))
    a, b = len(vertices), len(vertices) + len(sheet.vertices)
    rope = np.stack([np.arange(5.0), np.zeros(5), np.ones(5)], axis=1)
    lines = np.stack([np.arange(4), np.arange(1, 5)], axis=1).astype(np.int32)
    shapes = [
        Shape("the box", 0, a, triangles=boundary_triangles(tetrahedra), tetrahedra=tetrahedra, skin=skin),
        Shape("cloth", a, b, triangles=sheet.triangles, color=(0.2, 0.4, 0.6)),
        Shape("cloth", b, b + 5, lines=lines),
    ]
    return shapes, np.concatenate([vertices, sheet.vertices + [0, 0, 2], rope])


def _state(rest, frame):
    angle = 0.05 * frame
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return rest @ turn.T + [0, 0, 0.1 * frame], np.cross([0, 0, 0.05], rest @ turn.T)


def _record(path, scene, frames=FRAMES, **more):
    shapes, rest = scene
    settings = {"up_axis": "Z", "frames_per_second": 24.0, "info": {"scene": "test", "dt": np.float64(0.5)}} | more
    with open_recorder(path, shapes, **settings) as recorder:
        for frame in range(frames):
            recorder.write(frame / 24, *_state(rest, frame))
    return path


@pytest.mark.parametrize("suffix", [".npz", ".vtkhdf"])
def test_state_comes_back_bit_for_bit(tmp_path, scene, suffix):
    shapes, rest = scene
    recording = read_recording(_record(tmp_path / f"run{suffix}", scene))
    assert len(recording) == FRAMES
    np.testing.assert_array_equal(recording.times, np.arange(FRAMES) / 24)
    for frame in (0, 31, 32, FRAMES - 1, -1):
        x, v = _state(rest, frame % FRAMES)
        np.testing.assert_array_equal(recording.x(frame), x)
        np.testing.assert_array_equal(recording.v(frame), v)
    with pytest.raises(IndexError):
        recording.x(FRAMES)
    assert recording.info == {
        "scene": "test", "dt": 0.5, "up_axis": "Z", "frames_per_second": 24.0, "schema_version": 1
    }  # fmt: skip
    for shape, read in zip(shapes, recording.shapes, strict=True):
        assert (read.name, read.begin, read.end, read.color) == (shape.name, shape.begin, shape.end, shape.color)
        for name in ("lines", "triangles", "tetrahedra"):
            np.testing.assert_array_equal(getattr(read, name), getattr(shape, name))
        assert (read.skin is None) == (shape.skin is None)
        if shape.skin is not None:
            np.testing.assert_array_equal(read.skin.positions(rest), shape.skin.positions(rest))


def test_npz_opens_with_numpy_alone(tmp_path, scene):
    path = _record(tmp_path / "run.npz", scene)
    with np.load(path, allow_pickle=False) as file:
        assert file["time"].shape == (FRAMES,)
        assert file["x"].shape == file["v"].shape == (FRAMES, len(scene[1]), 3)
        np.testing.assert_array_equal(file["x"][7], _state(scene[1], 7)[0])
        np.testing.assert_array_equal(file["shape2_lines"], scene[0][2].lines)
        assert json.loads(str(file["info"]))["shapes"][0]["name"] == "the box"
    assert zipfile.ZipFile(path).testzip() is None
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]  # nothing left beside


def test_vtk_reads_the_steps_back(tmp_path, scene):
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    shapes, rest = scene
    reader = vtkHDFReader()
    reader.SetFileName(str(_record(tmp_path / "run.vtkhdf", scene)))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == FRAMES
    skin = shapes[0].skin
    for frame in (3, FRAMES - 1):
        reader.SetStep(frame)
        reader.Update()
        grid = reader.GetOutput()
        x, v = _state(rest, frame)
        assert reader.GetTimeValue() == pytest.approx(frame / 24)
        np.testing.assert_allclose(
            vtk_to_numpy(grid.GetPoints().GetData()), np.concatenate([x, skin.positions(x)]), atol=1e-5
        )
        np.testing.assert_allclose(
            vtk_to_numpy(grid.GetPointData().GetArray("velocity")), np.concatenate([v, skin.positions(v)]), atol=1e-6
        )
    kinds = [grid.GetCellType(k) for k in range(grid.GetNumberOfCells())]
    assert kinds.count(10) == 40 and kinds.count(3) == 4
    assert kinds.count(5) == len(skin.triangles) + len(shapes[1].triangles)
    body = vtk_to_numpy(grid.GetCellData().GetArray("body"))
    assert np.bincount(body).tolist() == [40 + len(skin.triangles), len(shapes[1].triangles), 4]
    last = grid.GetCell(int(np.flatnonzero(body == 2)[-1]))
    np.testing.assert_allclose(last.GetPoints().GetPoint(1), x[-1], atol=1e-5)


@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usd"])
def test_usd_stage(tmp_path, scene, suffix):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    shapes, rest = scene
    stage = Usd.Stage.Open(str(_record(tmp_path / f"run{suffix}", scene)))
    assert [p.name for p in tmp_path.iterdir()] == [f"run{suffix}"]
    assert stage.GetDefaultPrim().GetName() == "World"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Z"
    assert stage.GetTimeCodesPerSecond() == 24 and stage.GetEndTimeCode() == pytest.approx(FRAMES - 1)
    skin = UsdGeom.Mesh(stage.GetPrimAtPath("/World/the_box/surface"))
    solid = UsdGeom.TetMesh(stage.GetPrimAtPath("/World/the_box/solid"))
    cloth = UsdGeom.Mesh(stage.GetPrimAtPath("/World/cloth/surface"))
    rope = UsdGeom.BasisCurves(stage.GetPrimAtPath("/World/cloth_2/lines"))
    assert skin.GetSubdivisionSchemeAttr().Get() == "none" and solid.GetPurposeAttr().Get() == "guide"
    assert len(solid.GetTetVertexIndicesAttr().Get()) == 40
    assert list(rope.GetCurveVertexCountsAttr().Get()) == [5]
    np.testing.assert_allclose(cloth.GetDisplayColorAttr().Get()[0], (0.2, 0.4, 0.6), atol=1e-6)
    assert skin.GetPointsAttr().GetNumTimeSamples() == FRAMES
    x, v = _state(rest, 40)
    for prim, points, velocities in (
        (skin, shapes[0].skin.positions(x), shapes[0].skin.positions(v)),
        (cloth, x[shapes[1].begin : shapes[1].end], v[shapes[1].begin : shapes[1].end]),
        (rope, x[-5:], v[-5:]),
    ):
        np.testing.assert_allclose(prim.GetPointsAttr().Get(40), points, atol=1e-5)
        np.testing.assert_allclose(prim.GetVelocitiesAttr().Get(40), velocities, atol=1e-6)
        np.testing.assert_allclose(prim.GetExtentAttr().Get(40), [points.min(axis=0), points.max(axis=0)], atol=1e-5)


def test_lines_become_polylines():
    pytest.importorskip("pxr")
    from turnbuckle.io.usd import polylines

    order, counts = polylines(np.array([[0, 1], [2, 1], [2, 3], [1, 4], [5, 6], [6, 7], [7, 5]]))
    assert counts.sum() == len(order) and sorted(counts) == [2, 2, 3, 4]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    drawn = [
        tuple(sorted(order[s + k : s + k + 2].tolist()))
        for s, n in zip(starts, counts, strict=True)
        for k in range(n - 1)
    ]
    assert sorted(drawn) == [(0, 1), (1, 2), (1, 4), (2, 3), (5, 6), (5, 7), (6, 7)]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_wrong_targets_and_frames(tmp_path, scene, suffix):
    shapes, rest = scene
    settings = {"up_axis": "Z", "frames_per_second": 24.0}
    (tmp_path / f"folder{suffix}").mkdir()
    (tmp_path / "file").write_text("")
    for target in (tmp_path / "no" / f"a{suffix}", tmp_path / f"folder{suffix}", tmp_path / "file" / f"a{suffix}"):
        with pytest.raises(InputError, match=str(target)):
            open_recorder(target, shapes, **settings)
    path = tmp_path / f"a{suffix}"
    for wrong in ({"up_axis": "x"}, {"frames_per_second": 0.0}):
        with pytest.raises(InputError):
            open_recorder(path, shapes, **(settings | wrong))
    assert not path.exists()
    recorder = open_recorder(path, shapes, **settings)
    recorder.write(0.0, rest, 0 * rest)
    with pytest.raises(InputError, match="shape"):
        recorder.write(0.1, rest[:-1], rest[:-1])
    recorder.close()
    recorder.close()
    with pytest.raises(InputError, match="closed"):
        recorder.write(0.2, rest, rest)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_second_run_replaces_the_first_and_no_frame_is_a_file_too(tmp_path, scene, suffix):
    path = _record(tmp_path / f"run{suffix}", scene)
    size = path.stat().st_size
    _record(path, scene, frames=0)
    assert 0 < path.stat().st_size < size
    if suffix in (".npz", ".vtkhdf"):
        assert len(read_recording(path)) == 0


def test_unknown_suffix_names_the_known(tmp_path, scene):
    with pytest.raises(InputError, match=r"\.abc.*\.npz, \.vtkhdf, \.usdc"):
        open_recorder(tmp_path / "run.abc", scene[0], up_axis="Z", frames_per_second=24)
    with pytest.raises(InputError, match="only .npz, .vtkhdf, .usdc"):
        read_recording(tmp_path / "run.abc")


@pytest.mark.parametrize("suffix", [".npz", ".npz.part", ".vtkhdf"])
def test_files_that_are_no_recordings(tmp_path, scene, suffix):
    path = tmp_path / f"bad{suffix}"
    with pytest.raises(InputError, match="no such file"):
        read_recording(path)
    whole = _record(tmp_path / f"run{suffix.removesuffix('.part')}", scene).read_bytes()
    for data in (b"", b"text, not data\n" * 50, whole[:100], whole[: len(whole) // 2]):
        path.write_bytes(data)
        with pytest.raises(InputError, match="no recording|not whole"):
            read_recording(path)
    if suffix == ".npz":
        np.savez(path, something=np.zeros(3))
        with pytest.raises(InputError, match="no recording"):
            read_recording(path)


def test_without_usd_the_extra_is_named(tmp_path, scene, monkeypatch):
    monkeypatch.delattr("turnbuckle.io.usd.Usd", raising=False)
    with pytest.raises(InputError, match=r"turnbuckle\[usd\]"):
        open_recorder(tmp_path / "run.usdc", scene[0], up_axis="Z", frames_per_second=24)
