"""Reading of the user's meshes: every format, and every way in which a file can be broken."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.read import LineMesh, SurfaceMesh, TetMesh, read_mesh
from turnbuckle.meshes.repair import check_surface
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, six_volumes

SURFACES = ("obj", "ply", "stl", "glb", "off")
VOLUMES = ("msh", "vtk", "vtu", "mesh")


@pytest.fixture(scope="module")
def box():
    return box_tetrahedra((1.0, 2.0, 3.0), (2, 1, 2))


def _write(folder, suffix, box, name="mesh"):
    vertices, tetrahedra = box
    path = folder / f"{name}.{suffix}"
    if suffix in SURFACES:
        import trimesh

        trimesh.Trimesh(vertices, boundary_triangles(tetrahedra), process=False).export(path)
    else:
        import meshio

        meshio.Mesh(vertices, [("tetra", tetrahedra)]).write(
            path, **({"file_format": "gmsh"} if suffix == "msh" else {})
        )
    return path


@pytest.mark.parametrize("suffix", SURFACES)
def test_surface_formats_are_welded_and_closed(tmp_path, box, suffix):
    mesh = read_mesh(_write(tmp_path, suffix, box))
    assert isinstance(mesh, SurfaceMesh)
    assert mesh.vertices.dtype == np.float64 and mesh.triangles.dtype == np.int32
    assert len(mesh.vertices) == len(np.unique(boundary_triangles(box[1])))  # STL repeats each vertex some six times
    assert check_surface(mesh.vertices, mesh.triangles)[2].volume == pytest.approx(6.0, rel=1e-6)


@pytest.mark.parametrize("suffix", VOLUMES)
def test_volume_formats(tmp_path, box, suffix):
    mesh = read_mesh(_write(tmp_path, suffix, box))
    assert isinstance(mesh, TetMesh)
    assert mesh.tetrahedra.dtype == np.int32
    np.testing.assert_allclose(mesh.vertices, box[0], atol=1e-12)
    assert six_volumes(mesh.vertices, mesh.tetrahedra).sum() / 6 == pytest.approx(6.0)
    assert len(mesh.boundary) == len(boundary_triangles(box[1]))


@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_broken_files_are_one_sentence(tmp_path, box, suffix, capfd):
    whole = _write(tmp_path, suffix, box).read_bytes()
    noise = np.random.default_rng(1).integers(0, 256, 2000, dtype=np.uint8).tobytes()
    broken = {"empty": b"", "text": b"a letter to a friend\n" * 30, "noise": noise}
    # An OBJ has no counts: cut within its faces it is a smaller OBJ, and only `check_surface` sees the hole.
    parts = (0.02, 0.3, 0.5) if suffix == "obj" else (0.02, 0.3, 0.6, 0.9)
    broken |= {f"cut{part}": whole[: int(part * len(whole))] for part in parts}
    for name, data in broken.items():
        path = tmp_path / f"{name}.{suffix}"
        path.write_bytes(data)
        with pytest.raises(InputError) as caught:
            read_mesh(path)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    printed = capfd.readouterr()
    assert printed.out == "" and printed.err == ""


def test_cut_obj_is_found_open(tmp_path, box):
    path = _write(tmp_path, "obj", box)
    rows = path.read_text().splitlines()
    path.write_text("\n".join(rows[:-4]))
    mesh = read_mesh(path)
    with pytest.raises(InputError, match="not closed"):
        check_surface(mesh.vertices, mesh.triangles)


def test_missing_and_unknown(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "nothing.obj")
    with pytest.raises(InputError, match=r"\.fbx.*\.obj"):
        read_mesh(tmp_path / "model.fbx")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(InputError):
        read_mesh(tmp_path / "folder.obj")


def test_glb_scene_places_its_parts(tmp_path):
    import trimesh

    scene = trimesh.Scene()
    cube = trimesh.creation.box((1, 1, 1))
    scene.add_geometry(cube, geom_name="cube", node_name="a")
    moved = np.diag([2.0, 2.0, -2.0, 1.0])  # a mirror too: the outside must stay outside
    moved[:3, 3] = (10, 0, 0)
    scene.graph.update("b", matrix=moved, geometry="cube")
    scene.export(tmp_path / "scene.glb")
    mesh = read_mesh(tmp_path / "scene.glb")
    _, _, report = check_surface(mesh.vertices, mesh.triangles)
    assert report.parts == 2 and report.flipped == 0
    assert report.volume == pytest.approx(1 + 8, rel=1e-6)
    assert mesh.vertices[:, 0].max() == pytest.approx(11, rel=1e-6)


def test_lines(tmp_path):
    import meshio

    (tmp_path / "rope.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nl 1 2 3\nl -2 -1\n")
    rope = read_mesh(tmp_path / "rope.obj")
    assert isinstance(rope, LineMesh)
    assert rope.lines.tolist() == [[0, 1], [1, 2], [2, 3]]
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 1]])
    meshio.Mesh(points, [("line", np.array([[0, 1], [1, 2]]))]).write(tmp_path / "rope.vtu")
    assert read_mesh(tmp_path / "rope.vtu").lines.tolist() == [[0, 1], [1, 2]]


def test_indices_out_of_range_and_nan(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    (tmp_path / "b.off").write_text("OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n")
    (tmp_path / "c.obj").write_text("v 0 0 0\nv 1 0 0\nl 1 5\n")
    for name in ("a.off", "b.off", "c.obj"):
        with pytest.raises(InputError, match=name):
            read_mesh(tmp_path / name)


def test_cells_with_mass_that_cannot_be_kept_are_refused(tmp_path):
    import meshio

    cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    meshio.Mesh(cube, [("hexahedron", np.arange(8)[None]), ("tetra", np.array([[0, 1, 2, 4]]))]).write(
        tmp_path / "m.vtu"
    )
    with pytest.raises(InputError, match="hexahedron"):
        read_mesh(tmp_path / "m.vtu")
