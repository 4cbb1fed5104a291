"""Reading of the user's meshes: surfaces by trimesh, tetrahedra by meshio, line meshes by either or by hand.

The libraries fail in many ways (exceptions of all kinds, messages on the screen, even ``sys.exit``); whatever
happens, the caller sees one InputError that names the file.
"""

import contextlib
import io
import itertools
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import boundary_triangles

SURFACE_SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".off")
VOLUME_SUFFIXES = (".msh", ".vtk", ".vtu", ".mesh")
SUFFIXES = SURFACE_SUFFIXES + VOLUME_SUFFIXES

# Cells that would lose mass or shape if they were left out without a word.
_REFUSED_CELLS = ("hexahedron", "wedge", "pyramid", "tetra10", "triangle6", "hexahedron20", "hexahedron27", "line3")


@dataclass(frozen=True)
class SurfaceMesh:
    """Triangles, vertices of one place welded, in the order of the file."""

    vertices: np.ndarray  # [m], (n, 3) float64
    triangles: np.ndarray  # (m, 3) int32


@dataclass(frozen=True)
class TetMesh:
    """Tetrahedra as the file has them: not repaired."""

    vertices: np.ndarray  # [m], (n, 3) float64
    tetrahedra: np.ndarray  # (m, 4) int32

    @property
    def boundary(self) -> np.ndarray:
        """Triangles of the boundary, (k, 3) int32."""
        return boundary_triangles(self.tetrahedra)


@dataclass(frozen=True)
class LineMesh:
    """Line segments, for ropes and nets."""

    vertices: np.ndarray  # [m], (n, 3) float64
    lines: np.ndarray  # (m, 2) int32


def read_mesh(path: str | Path) -> SurfaceMesh | TetMesh | LineMesh:
    """Read a mesh; the suffix tells the format, the content the kind.

    OBJ, PLY, STL, GLB and OFF are surfaces (an OBJ of ``l`` elements only is a line mesh); .msh, .vtk, .vtu and .mesh
    give tetrahedra if they hold any, else triangles (quads are cut in two), else lines. Coordinates are taken as
    metres. Raises InputError, naming the file, when it is missing, unreadable, empty, cut off or of another format.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"mesh {path}: the suffix '{path.suffix}' is not known; use one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"mesh {path}: there is no such file")
    try:
        if path.stat().st_size == 0:
            raise InputError(f"mesh {path}: the file is empty")
        quiet = io.StringIO()
        with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with np.errstate(all="ignore"):
                mesh = _read_surface(path, suffix) if suffix in SURFACE_SUFFIXES else _read_cells(path)
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"mesh {path}: cannot be read as {suffix} ({reason}); is it whole and of that format?"
        ) from None
    return _checked(path, mesh)


def _read_surface(path: Path, suffix: str) -> SurfaceMesh | LineMesh:
    import trimesh  # here, because it is slow to import and few scenes read surfaces

    if suffix == ".obj":
        lines = _obj_lines(path)
        if lines is not None:
            return lines
    if suffix == ".stl":
        _check_stl_length(path)
    scene = trimesh.load_scene(path, process=False)
    vertices, triangles, count = [], [], 0
    for node in scene.graph.nodes_geometry:  # a scene places one geometry several times
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh) or not len(part.faces):
            continue
        faces = np.asarray(part.faces, dtype=np.int64)
        if np.linalg.det(transform[:3, :3]) < 0:  # a mirrored part keeps its outside outside
            faces = faces[:, ::-1]
        vertices.append(np.asarray(part.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3])
        triangles.append(faces + count)
        count += len(vertices[-1])
    if not triangles:
        raise InputError(f"mesh {path}: has no triangles; export the object as a triangle mesh")
    joined = np.concatenate(triangles)
    promised = _promised_faces(path, suffix)
    if len(joined) < promised:  # a polygon of n corners gives n - 2 triangles
        raise InputError(f"mesh {path}: is cut off ({len(joined)} triangles of {promised} faces); copy it again")
    _check_range(path, joined, count)
    welded, index = weld(np.concatenate(vertices))
    return SurfaceMesh(welded, index[joined].astype(np.int32))


def _check_stl_length(path: Path) -> None:
    """A binary STL says how many triangles of 50 bytes follow its header of 84."""
    with path.open("rb") as file:
        head = file.read(84)
    if len(head) == 84 and not head.lstrip().startswith(b"solid"):
        promised = 84 + 50 * int(np.frombuffer(head[80:84], "<u4")[0])
        if path.stat().st_size < promised:
            raise InputError(f"mesh {path}: is cut off ({path.stat().st_size} of {promised} bytes); copy it again")


def _promised_faces(path: Path, suffix: str) -> int:
    """How many faces the header of an OFF or PLY says that there are, else 0; the library takes fewer in silence."""
    with path.open("rb") as file:
        head = file.read(4096)
    if suffix == ".ply":
        found = re.search(rb"element face (\d+)", head)
        return int(found.group(1)) if found else 0
    if suffix == ".off":
        words = re.sub(rb"#[^\n]*", b"", head).replace(b"OFF", b"", 1).split()
        return int(words[1]) if len(words) > 1 else 0
    return 0


def weld(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices of exactly the same place; the first of each stays, in its order.

    Returns the vertices left [m], (k, 3), and the new index of each old one, (n,). Formats that repeat a vertex for
    each triangle (STL) or each seam (GLB) repeat its bits, so no tolerance is needed.
    """
    _, first, inverse = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # np.unique sorts; the user's indices should survive
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[inverse.ravel()]


def _obj_lines(path: Path) -> LineMesh | None:
    """The polylines of an OBJ that has no faces, else None."""
    vertices: list[list[float]] = []
    lines: list[tuple[int, int]] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for row in file:
            words = row.split()
            if not words or words[0] not in ("v", "l", "f"):
                continue
            if words[0] == "f":
                return None
            if words[0] == "v":
                vertices.append([float(w) for w in words[1:4]])
            else:
                ids = [int(w.split("/")[0]) for w in words[1:]]
                ids = [i - 1 if i > 0 else len(vertices) + i for i in ids]
                lines.extend(zip(ids[:-1], ids[1:], strict=True))
    if not lines:
        return None
    return LineMesh(np.array(vertices, dtype=np.float64).reshape(-1, 3), _indices(path, lines, len(vertices)))


def _read_cells(path: Path) -> SurfaceMesh | TetMesh | LineMesh:
    import meshio  # here, because it is slow to import and few scenes need it

    if path.suffix.lower() == ".msh":
        _check_msh_ends(path)
    mesh = meshio.read(path, file_format="gmsh" if path.suffix.lower() == ".msh" else None)
    vertices = np.asarray(mesh.points, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] not in (2, 3):
        raise InputError(f"mesh {path}: its points have {vertices.shape[-1]} coordinates; 3 are needed")
    if vertices.shape[1] == 2:
        vertices = np.pad(vertices, ((0, 0), (0, 1)))
    cells: dict[str, list[np.ndarray]] = {}
    for block in mesh.cells:
        if len(block.data):
            cells.setdefault(block.type, []).append(np.asarray(block.data, dtype=np.int64))
    refused = [kind for kind in cells if kind in _REFUSED_CELLS]
    if refused:
        raise InputError(f"mesh {path}: has {refused[0]} cells; convert them to plain tetrahedra or triangles first")
    if "quad" in cells:
        quads = np.concatenate(cells["quad"])
        cells.setdefault("triangle", []).extend([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    for kind, make in (("tetra", TetMesh), ("triangle", SurfaceMesh), ("line", LineMesh)):
        if kind in cells:
            return make(vertices, _indices(path, np.concatenate(cells[kind]), len(vertices)))
    raise InputError(f"mesh {path}: has no tetrahedra, triangles or lines")


def _check_msh_ends(path: Path) -> None:
    """A .msh is a row of sections ``$Name .. $EndName``; meshio reads for ever where an end is missing."""
    marks = [mark.decode() for mark in re.findall(rb"(?m)^\$([A-Z][A-Za-z]+)[ \t\r]*$", path.read_bytes())]
    if marks[:1] != ["MeshFormat"]:
        raise InputError(f"mesh {path}: cannot be read as .msh: it is not of Gmsh (no $MeshFormat); save it with Gmsh")
    for begin, end in itertools.zip_longest(marks[::2], marks[1::2]):
        if end != f"End{begin}":
            raise InputError(f"mesh {path}: is cut off or damaged (${begin} has no $End{begin}); copy it again")


def _indices(path: Path, cells: object, count: int) -> np.ndarray:
    indices = np.asarray(cells, dtype=np.int64)
    _check_range(path, indices, count)
    return indices.astype(np.int32)


def _check_range(path: Path, indices: np.ndarray, count: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= count):
        bad = indices.min() if indices.min() < 0 else indices.max()
        raise InputError(f"mesh {path}: a cell names vertex {bad}, but there are {count} vertices (numbered from 0)")


def _checked(path: Path, mesh: SurfaceMesh | TetMesh | LineMesh) -> SurfaceMesh | TetMesh | LineMesh:
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise InputError(f"mesh {path}: vertex {bad[0]} is not finite ({len(bad)} such vertices); repair the file")
    return mesh
