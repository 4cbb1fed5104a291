"""A coating is a solid, points on its kernel, and one constraint that joins them: so it is written out here.

Every inner point of the solid gets its own point on the kernel (an anchor, numbered after all others), and both become
one by `points_to_point`: exact, and what the material pushes arrives at the kernel.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.data.state import State
from turnbuckle.meshes.embedding import embed
from turnbuckle.meshes.inside import winding_numbers
from turnbuckle.meshes.read import SurfaceMesh, read_mesh
from turnbuckle.meshes.repair import check_surface
from turnbuckle.meshes.shapes import six_volumes
from turnbuckle.meshes.shell import Shell, box_shell, capsule_shell, cylinder_shell, sphere_shell
from turnbuckle.meshes.tetrahedralise import tetrahedralise
from turnbuckle.scene.body_definitions import MaterialFields
from turnbuckle.scene.build_rigid import rigid_shape
from turnbuckle.scene.contact_definitions import TOUCH
from turnbuckle.scene.definitions import CoatingDef, PointsDef, PointsToPointDef, RigidDef, SceneDef, SolidDef
from turnbuckle.scene.trajectories import start_pose

FINER = 3.0  # than the tetrahedra is the surface that is drawn of a coating
FINE = 20_000  # tetrahedra, whose own boundary is fine enough
MATERIAL = (*TOUCH, *MaterialFields.model_fields)


def expand_coatings(definition: SceneDef, folder: Path) -> SceneDef:
    """The scene with each coating replaced by a solid, anchors on its kernel, and the constraint `NAME.kernel`.

    A scene without coatings is returned as it is. Mesh paths are relative to ``folder``. Raises InputError that names
    the coating.
    """
    coatings = [body for body in definition.bodies if isinstance(body, CoatingDef)]
    if not coatings:
        return definition
    bodies: dict[str, Any] = {body.name: body for body in definition.bodies}
    constraints = list(definition.constraints)
    taken = {constraint.name for constraint in constraints}
    for coating in coatings:
        try:
            kernel = bodies[coating.around]
            if not isinstance(kernel, RigidDef):
                raise InputError(f"'{coating.around}' is a {kernel.type}; a coating goes around a rigid body")
            name = f"{coating.name}.kernel"
            if name in taken:
                raise InputError(f"its constraint would be called '{name}', as another is; rename that one")
            shell = coating_shell(coating, kernel, folder)
            anchors = len(rigid_shape(kernel, folder).vertices) + np.arange(len(shell.inner), dtype=np.int32)
            bodies[kernel.name] = _with_anchors(kernel, shell.vertices[shell.inner] / kernel.scale)
            bodies[coating.name] = _solid(coating, kernel, shell)
            pair = [PointsDef(body=coating.name, indices=shell.inner), PointsDef(body=kernel.name, indices=anchors)]
            constraints.append(PointsToPointDef(name=name, zip=pair))
        except InputError as error:
            text = str(error)
            raise InputError(text if text.startswith("body '") else f"coating '{coating.name}': {text}") from None
    return definition.model_copy(update={"bodies": list(bodies.values()), "constraints": constraints})


def carry_coatings(definition: SceneDef, model: Model, state: State) -> None:
    """Let the points of coatings start with the motion of their kernels. ``definition`` is the user's."""
    coatings = [body for body in definition.bodies if isinstance(body, CoatingDef)]
    if not coatings:
        return
    points, velocity = state.now.x.numpy(), state.now.v.numpy()
    x, v, w = state.rigid.x.numpy(), state.rigid.v.numpy(), state.rigid.w.numpy()
    for coating in coatings:
        shape, b = model.shape(coating.name), model.rigid.names.index(coating.around)
        own = slice(shape.begin, shape.end)
        velocity[own] = v[b] + np.cross(w[b], points[own] - x[b])
    state.now.v.assign(velocity)


def dress_coatings(definition: SceneDef, shapes: Sequence[Shape], x: np.ndarray, folder: Path) -> tuple[Shape, ...]:
    """The shapes, those of coatings with a finer outer surface that moves with them. ``definition`` is the user's."""
    coatings = {body.name: body for body in definition.bodies if isinstance(body, CoatingDef)}
    kernels = {body.name: body for body in definition.bodies if isinstance(body, RigidDef)}
    covered = {name for skin in definition.skins for name in skin.bodies}
    dressed = []
    for shape in shapes:
        coating = coatings.get(shape.name)
        if coating is not None and shape.name not in covered:
            kernel = kernels[coating.around]
            vertices, triangles = _fine_surface(coating, kernel, folder)
            origin, turn = start_pose(kernel)
            points, weights = embed(turn.apply(vertices) + origin, x[shape.begin : shape.end], shape.tetrahedra)
            shape = replace(shape, skin=Skin(points + shape.begin, weights, triangles))
        dressed.append(shape)
    return tuple(dressed)


def _fine_surface(coating: CoatingDef, kernel: RigidDef, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The outer surface to look at, in the kernel's frame: the user's mesh, or cells a third as long."""
    if coating.thickness is None:
        mesh = read_mesh(folder / Path(str(coating.mesh)).expanduser())
        assert isinstance(mesh, SurfaceMesh)  # looked at before
        vertices, triangles, _ = check_surface(mesh.vertices, mesh.triangles)
        return vertices, triangles
    shell = coating_shell(coating, kernel, folder)
    if len(shell.tetrahedra) > FINE:
        return shell.outside()
    finer = coating.model_copy(update={"edge_length": shell.edge / FINER, "layers": 1})
    return coating_shell(finer, kernel, folder).outside()


def coating_shell(coating: CoatingDef, kernel: RigidDef, folder: Path) -> Shell:
    """The material of a coating in the kernel's frame. Raises InputError."""
    scale, edge, layers = kernel.scale, coating.edge_length, coating.layers or 1
    if coating.thickness is None:
        return _filled(coating, kernel, folder)
    grown = coating.thickness, layers, edge
    if kernel.box is not None:
        return box_shell(kernel.box * scale, *grown)
    if kernel.sphere is not None:
        return sphere_shell(kernel.sphere * scale, *grown)
    if kernel.cylinder is not None:
        return cylinder_shell(kernel.cylinder.radius * scale, kernel.cylinder.length * scale, *grown)
    if kernel.capsule is not None:
        return capsule_shell(kernel.capsule.radius * scale, kernel.capsule.length * scale, *grown)
    raise InputError(
        f"thickness is measured around a box, sphere, cylinder or capsule, which '{kernel.name}' is not; "
        "give the outer surface as mesh"
    )


def _filled(coating: CoatingDef, kernel: RigidDef, folder: Path) -> Shell:
    """The user's outer surface filled with tetrahedra, less those all of whose corners are in the kernel."""
    mesh = read_mesh(folder / Path(str(coating.mesh)).expanduser())
    if not isinstance(mesh, SurfaceMesh):
        raise InputError(f"mesh '{coating.mesh}' has no triangles; give the closed outer surface")
    outer, triangles, found = check_surface(mesh.vertices, mesh.triangles)
    points, cells = tetrahedralise(outer, triangles, edge_length=coating.edge_length)
    shape = rigid_shape(kernel, folder)
    inside = winding_numbers(points, shape.vertices, shape.triangles) > 0.5
    kept = cells[~inside[cells].all(axis=1)]
    if not len(kept):
        raise InputError(f"mesh '{coating.mesh}' lies in the kernel '{kernel.name}'; give a surface around it")
    used, index = np.unique(kept, return_inverse=True)
    inner = np.flatnonzero(inside[used]).astype(np.int32)
    held = points[used[inner]]
    if len(inner) < 3 or np.linalg.matrix_rank(held - held.mean(axis=0), tol=1e-6 * np.ptp(outer)) < 2:
        raise InputError(
            f"only {len(inner)} points of its tetrahedra lie in the kernel '{kernel.name}', too few to hold it; "
            "give a smaller edge_length, or move the mesh around the kernel"
        )
    points, kept = points[used], index.reshape(-1, 4).astype(np.int32)
    volume = float(six_volumes(points, kept).sum() / 6.0)
    solid = shape.vertices[np.unique(shape.triangles)]
    if (winding_numbers(solid, outer, triangles) > 0.5).all():
        # Elements cut by the kernel's surface lie in part inside it; the material itself does not.
        corner = shape.vertices[shape.triangles]
        volume = found.volume - float(np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6.0)
    return Shell(points, kept, inner, volume)


def _with_anchors(kernel: RigidDef, points: np.ndarray) -> RigidDef:
    anchors = points if kernel.anchors is None else np.concatenate([kernel.anchors, points])
    anchors.setflags(write=False)
    return kernel.model_copy(update={"anchors": anchors})


def _solid(coating: CoatingDef, kernel: RigidDef, shell: Shell) -> SolidDef:
    """The solid of the shell's tetrahedra where the kernel is. Its mass is that of the true volume."""
    mass = coating.mass if coating.mass is not None else float(coating.density or 0.0) * shell.volume
    origin, turn = start_pose(kernel)
    return SolidDef(
        name=coating.name,
        position=origin,
        rotation=turn.as_rotvec(),
        color=kernel.color if coating.color is None else coating.color,
        vertices=shell.vertices,
        tetrahedra=shell.tetrahedra,
        mass=mass,
        **{name: getattr(coating, name) for name in MATERIAL if name in coating.model_fields_set},
    )
