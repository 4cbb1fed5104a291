"""From the definition of a body to points, masses, springs, tetrahedra, and what is drawn of it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.meshes.cage import cage_near
from turnbuckle.meshes.embedding import embed
from turnbuckle.meshes.read import LineMesh, SurfaceMesh, TetMesh, read_mesh
from turnbuckle.meshes.repair import check_surface, repair_tetrahedra
from turnbuckle.meshes.shapes import (
    boundary_triangles,
    box_tetrahedra,
    cylinder_tetrahedra,
    grid_sheet,
    six_volumes,
)
from turnbuckle.meshes.tetrahedralise import tetrahedralise
from turnbuckle.scene.build_hinges import hinge_points
from turnbuckle.scene.build_obstacles import ObstacleMotion, obstacle
from turnbuckle.scene.build_rigid import RigidShape, rigid_shape
from turnbuckle.scene.definitions import BodyBase, ClothDef, ObstacleDef, RigidDef, RopeDef, SheetDef, SolidDef
from turnbuckle.scene.trajectories import start_pose

FILLED = 0.01  # of a surface's volume: what tetrahedra may miss before it is said


@dataclass
class Body:
    """One body in local numbers. Positions in the world [m]."""

    name: str
    x: np.ndarray  # (n, 3)
    mass: np.ndarray  # (n,) [kg]
    velocity: np.ndarray  # (3,)
    shape: Shape
    pairs: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    stiffness: np.ndarray = field(default_factory=lambda: np.zeros(0))  # [N/m]
    damping: np.ndarray = field(default_factory=lambda: np.zeros(0))  # [N s/m]
    tetrahedra: np.ndarray = field(default_factory=lambda: np.zeros((0, 4), np.int32))
    material: tuple[float, ...] = (0.0,) * 6
    repairs: str = ""
    rigid: RigidShape | None = None
    hinges: np.ndarray = field(default_factory=lambda: np.zeros((0, 4), np.int32))
    hinge_stiffness: float = 0.0  # [N m/rad]
    hinge_damping: float = 0.0  # [N m s/rad]
    limited: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int32))  # pairs under a strain limit
    strain_limit: float = 0.0  # [1]
    elastic: tuple[float, float, float] | None = None  # corotational: E [Pa], nu, damping [s]; then no `material`
    motion: ObstacleMotion | None = None


def build_body(definition: ObstacleDef | RigidDef | RopeDef | SheetDef | SolidDef, folder: Path) -> Body:
    """Make a body; mesh paths are relative to ``folder``. Raises InputError that names the body."""
    try:
        if isinstance(definition, ObstacleDef):
            return _obstacle(definition, folder)
        if isinstance(definition, RigidDef):
            return _rigid(definition, folder)
        if isinstance(definition, RopeDef):
            return _rope(definition, folder)
        if isinstance(definition, SheetDef):
            return _sheet(definition, folder)
        return _solid(definition, folder)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith("body '") else f"body '{definition.name}': {text}") from None


def _placed(definition: RopeDef | SheetDef | SolidDef, points: np.ndarray) -> np.ndarray:
    """x = position + R (scale p)."""
    scaled = np.asarray(points, dtype=np.float64) * definition.scale
    if np.any(definition.rotation != 0.0):
        scaled = Rotation.from_rotvec(np.array(definition.rotation)).apply(scaled)
    return np.ascontiguousarray(scaled + definition.position)


def _mesh(definition: RopeDef | SheetDef | SolidDef, folder: Path, name: str) -> SurfaceMesh | TetMesh | LineMesh:
    return read_mesh(folder / Path(getattr(definition, name)).expanduser())


def _lumped(n: int, elements: np.ndarray, measure: np.ndarray, definition: object, what: str) -> np.ndarray:
    """Masses of points: each element's measure times density, shared out among its points."""
    if (measure <= 0.0).any():
        raise InputError(f"element {int(np.argmax(measure <= 0.0))} has no {what}; remove it or move its points apart")
    total = definition.mass if definition.mass is not None else definition.density * measure.sum()
    share = np.repeat(measure / measure.sum() / elements.shape[1], elements.shape[1])
    mass = np.bincount(elements.ravel(), weights=share, minlength=n) * total
    loose = np.flatnonzero(mass == 0.0)
    if len(loose):
        raise InputError(
            f"point {loose[0]} (one of {len(loose)}) belongs to no element and would have no mass; remove it"
        )
    return mass


def _rope(d: RopeDef, folder: Path) -> Body:
    lines = d.lines
    if d.points is not None:
        points = d.points
    elif d.mesh is not None:
        mesh = _mesh(d, folder, "mesh")
        if isinstance(mesh, LineMesh):
            points, lines = mesh.vertices, mesh.lines
        elif isinstance(mesh, SurfaceMesh):
            points, lines = mesh.vertices, unique_edges(mesh.triangles, len(mesh.vertices))
        else:
            raise InputError(f"mesh '{d.mesh}' has tetrahedra; a rope takes lines or the edges of a surface")
    else:
        points = d.start + np.linspace(0.0, 1.0, d.segments + 1)[:, None] * (d.end - d.start)
    n = len(points)
    if lines is None:
        lines = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    lines = np.asarray(lines, dtype=np.int32)
    x = _placed(d, points)
    length = np.linalg.norm(x[lines[:, 1]] - x[lines[:, 0]], axis=1)
    mass = _lumped(n, lines, length, d, "length")
    pairs, k, c = [lines], [np.full(len(lines), d.stretch_stiffness)], [np.full(len(lines), d.damping)]
    if d.bend_stiffness > 0.0 or d.bend_damping > 0.0:
        bend = _two_apart(lines, n)
        pairs.append(bend)
        k.append(np.full(len(bend), d.bend_stiffness))
        c.append(np.full(len(bend), d.bend_damping))
    shape = Shape(d.name, 0, n, lines=lines, color=_color(d))
    return Body(d.name, x, mass, d.velocity, shape, np.concatenate(pairs), np.concatenate(k), np.concatenate(c))


def _two_apart(lines: np.ndarray, n: int) -> np.ndarray:
    """Pairs of points two apart along a line: the other ends of the two lines at each point where just two meet."""
    ends = np.concatenate([lines, lines[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    degree = np.bincount(ends[:, 0], minlength=n)
    first = np.cumsum(degree) - degree
    inner = np.flatnonzero(degree == 2)
    return np.stack([ends[first[inner], 1], ends[first[inner] + 1, 1]], axis=1).astype(np.int32)


def _sheet(d: SheetDef, folder: Path) -> Body:
    shear = np.zeros((0, 2), np.int32)
    if d.size is not None:
        grid = grid_sheet(tuple(d.size), tuple(int(c) for c in d.cells))
        points, triangles, edges, shear, bend = grid.vertices, grid.triangles, grid.structural, grid.shear, grid.bend
    else:
        if d.mesh is not None:
            mesh = _mesh(d, folder, "mesh")
            if not isinstance(mesh, SurfaceMesh):
                raise InputError(f"mesh '{d.mesh}' has no triangles; a {d.type} takes a triangle mesh")
            points, triangles = mesh.vertices, mesh.triangles
        else:
            points, triangles = d.vertices, d.triangles
        edges = unique_edges(triangles, len(points))
        bend = _across_edges(triangles, len(points))
    x = _placed(d, points)
    corner = x[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    mass = _lumped(len(x), triangles, area, d, "area")
    by_hinges = isinstance(d, ClothDef) and d.bend_model == "hinges"
    bend_damping = d.bend_damping if isinstance(d, ClothDef) else None
    kinds = [(edges, d.structural_stiffness, d.damping), (shear, d.shear_stiffness, d.damping)]
    if not by_hinges:
        kinds.append((bend, d.bend_stiffness, d.damping if bend_damping is None else bend_damping))
    springs = [kind for kind in kinds if kind[1] > 0.0 and len(kind[0])]
    pairs = np.concatenate([np.zeros((0, 2), np.int32), *(p for p, _, _ in springs)])
    k = np.concatenate([np.zeros(0), *(np.full(len(p), s) for p, s, _ in springs)])
    damping = np.concatenate([np.zeros(0), *(np.full(len(p), c) for p, _, c in springs)])
    drawn = {"lines": edges} if d.type == "net" else {"triangles": np.asarray(triangles, dtype=np.int32)}
    shape = Shape(d.name, 0, len(x), color=_color(d), **drawn)
    body = Body(d.name, x, mass, d.velocity, shape, pairs.astype(np.int32), k, damping)
    if by_hinges and d.bend_stiffness > 0.0:
        body.hinges, body.hinge_stiffness = hinge_points(triangles, len(x)), d.bend_stiffness
        body.hinge_damping = bend_damping or 0.0
    if isinstance(d, ClothDef) and d.strain_limit is not None:
        body.limited, body.strain_limit = np.concatenate([edges, shear]).astype(np.int32), d.strain_limit
    return body


def _across_edges(triangles: np.ndarray, n: int) -> np.ndarray:
    """Pairs of points opposite each edge that two triangles share."""
    t = np.asarray(triangles, dtype=np.int64)
    ends = np.sort(np.concatenate([t[:, [1, 2]], t[:, [2, 0]], t[:, [0, 1]]]), axis=1)
    opposite = np.concatenate([t[:, 0], t[:, 1], t[:, 2]])
    key = ends[:, 0] * n + ends[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    pairs = np.stack([opposite[order[same]], opposite[order[same + 1]]], axis=1)
    return pairs[pairs[:, 0] != pairs[:, 1]].astype(np.int32)


def _solid(d: SolidDef, folder: Path) -> Body:
    surface: SurfaceMesh | None = None
    notes: list[str] = []
    enclosed = None  # by the user's surface, in the body's own coordinates [m^3]
    if d.box is not None:
        points, cells = box_tetrahedra(tuple(d.box.size), tuple(int(c) for c in d.box.cells))
    elif d.cylinder is not None:
        c = d.cylinder
        points, cells = cylinder_tetrahedra(c.radius, c.length, c.around, c.along)
        points = points[:, [1, 2, 0]]  # the mesh lies along x, the definition stands along z
    elif d.mesh is not None:
        mesh = _mesh(d, folder, "mesh")
        if isinstance(mesh, TetMesh):
            points, cells = mesh.vertices, mesh.tetrahedra
        elif isinstance(mesh, SurfaceMesh):
            surface = mesh
        else:
            raise InputError(f"mesh '{d.mesh}' has lines only; a solid takes a closed surface or tetrahedra")
    elif d.triangles is not None:
        surface = SurfaceMesh(np.array(d.vertices), np.array(d.triangles))
    else:
        points, cells = d.vertices, d.tetrahedra
    if surface is not None:
        vertices, triangles, found = check_surface(surface.vertices, surface.triangles)
        enclosed = found.volume
        if found.flipped or found.duplicates or found.degenerate:
            notes.append(f"surface: {found.summary()}")
        surface = SurfaceMesh(vertices, triangles)
        if d.cage is not None:
            points, cells = cage_near(vertices, triangles, d.cage)
        else:
            edge = None if d.edge_length is None else d.edge_length / d.scale
            points, cells = tetrahedralise(vertices, triangles, edge_length=edge)
    points, cells, report = repair_tetrahedra(points, cells)
    if d.surface is not None:
        finer = _mesh(d, folder, "surface")
        if not isinstance(finer, SurfaceMesh):
            raise InputError(f"surface '{d.surface}' has no triangles")
        surface = finer
    skin = None
    if surface is not None:
        corners, weights = embed(surface.vertices, points, cells)
        skin = Skin(corners, weights, surface.triangles)
    x = _placed(d, points)
    volume = six_volumes(x, cells) / 6.0
    mass = _lumped(len(x), cells, volume, d, "volume")
    if enclosed is not None:  # the mass is that of the surface, however well tetrahedra fill it
        filled = volume.sum() / (enclosed * d.scale**3)
        if d.mass is None:
            mass /= filled
        if d.cage is None and abs(filled - 1.0) > FILLED:
            notes.append(
                f"tetrahedra fill {100.0 * filled:.1f} % of the surface; a smaller edge_length follows it closer"
            )
    if not report.clean:
        notes.append(report.summary())
    shape = Shape(
        d.name, 0, len(x), triangles=boundary_triangles(cells), tetrahedra=np.asarray(cells, dtype=np.int32), skin=skin,
        color=_color(d),
    )  # fmt: skip
    material: tuple[float, ...] = (
        d.k_distance,
        d.k_area,
        d.k_volume,
        d.damping_distance,
        d.damping_area,
        d.damping_volume,
    )
    elastic = None
    if d.material == "corotational":
        material = (0.0,) * 6
        elastic = (float(d.youngs_modulus or 0.0), float(d.poissons_ratio or 0.0), float(d.damping or 0.0))
    repairs = f"{d.name}: {'; '.join(notes)}" if notes else ""
    return Body(
        d.name,
        x,
        mass,
        d.velocity,
        shape,
        tetrahedra=np.asarray(cells, dtype=np.int32),
        material=material,
        repairs=repairs,
        elastic=elastic,
    )


def unique_edges(elements: np.ndarray, n: int) -> np.ndarray:
    """The edges of triangles or tetrahedra over n points, each once, (m, 2) int32."""
    e = np.asarray(elements, dtype=np.int64)
    k = e.shape[1]
    ends = np.concatenate([np.sort(e[:, [a, b]], axis=1) for a in range(k) for b in range(a + 1, k)])
    keys = np.unique(ends[:, 0] * n + ends[:, 1])
    return np.stack([keys // n, keys % n], axis=1).astype(np.int32)


def _color(d: BodyBase) -> tuple[float, float, float] | None:
    return None if d.color is None else tuple(float(c) for c in d.color)  # type: ignore[return-value]


def _rigid(d: RigidDef, folder: Path) -> Body:
    """Its points follow the pose; they have no mass of their own."""
    shape = rigid_shape(d, folder)
    origin, turn = start_pose(d)
    own = turn.apply(shape.vertices) + origin
    drawn = Shape(
        d.name, 0, len(own), triangles=shape.triangles, color=_color(d), local=shape.vertices,
        still=d.motion == "immobile",
    )  # fmt: skip
    return Body(name=d.name, x=own, mass=np.zeros(len(own)), velocity=np.zeros(3), shape=drawn, rigid=shape)


def _obstacle(d: ObstacleDef, folder: Path) -> Body:
    """Its points go where its motion says; they have no mass."""
    motion, triangles = obstacle(d, folder)
    x = motion(0.0)
    shape = Shape(d.name, 0, len(x), triangles=triangles, color=_color(d), still=not motion.moves, drawn=d.drawn)
    return Body(name=d.name, x=x, mass=np.zeros(len(x)), velocity=np.zeros(3), shape=shape, motion=motion)
