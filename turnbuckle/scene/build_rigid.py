"""From the definition of a rigid body to its mass, centre, inertia and surface, all in its own frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.mass_properties import (
    MassProperties,
    box_mass,
    capsule_mass,
    cylinder_mass,
    mass_properties,
    sphere_mass,
)
from turnbuckle.meshes.read import SurfaceMesh, TetMesh, read_mesh
from turnbuckle.meshes.solids import box_surface, capsule_surface, cylinder_surface, sphere_surface
from turnbuckle.scene.definitions import PartDef, RigidDef
from turnbuckle.scene.rigid_definitions import ShapeDef

DENSITY = 1000.0  # [kg/m^3]


@dataclass(frozen=True)
class RigidShape:
    """A rigid body in its own frame, `scale` applied."""

    mass: float  # [kg]
    center: np.ndarray  # (3,) centre of mass [m]
    inertia: np.ndarray  # (3, 3) about the centre, in the frame's axes [kg m^2]
    vertices: np.ndarray  # (n, 3) markers, then the vertices of the surface, then anchors [m]
    triangles: np.ndarray  # (m, 3) int32, into vertices


@dataclass(frozen=True)
class _Solid:
    """One part: its surface, and its mass properties, None where they were not asked for."""

    vertices: np.ndarray
    triangles: np.ndarray
    moments: MassProperties | None


def rigid_shape(definition: RigidDef, folder: Path) -> RigidShape:
    """Mass, centre, inertia and surface of a rigid body; mesh paths are relative to ``folder``.

    Parts of a compound add up, also where they overlap. A given `mass` scales all densities alike. A given `inertia`
    or `center` is taken instead of the shape's; where mass, inertia and center are all given the surface need not be
    closed. `scale` applies to all coordinates, `markers`, `anchors` and `center` included, not to a given mass or inertia.
    Raises InputError that names the body.
    """
    try:
        return _shape(definition, folder)
    except InputError as error:
        raise InputError(f"body '{definition.name}': {error}") from None


def _shape(d: RigidDef, folder: Path) -> RigidShape:
    needed = d.mass is None or d.inertia is None or d.center is None
    density = DENSITY if d.density is None else d.density
    solids = []
    if d.parts is None:
        solids.append(_solid(d, folder, d.scale, density, needed))
    for number, part in enumerate(d.parts or ()):
        try:
            solids.append(_part(part, folder, d.scale, density if part.density is None else part.density, needed))
        except InputError as error:
            raise InputError(f"parts[{number}]: {error}") from None
    markers = np.zeros((0, 3)) if d.markers is None else d.markers * d.scale
    begins = np.cumsum([len(markers), *(len(s.vertices) for s in solids)])
    anchors = np.zeros((0, 3)) if d.anchors is None else d.anchors * d.scale
    vertices = np.concatenate([markers, *(s.vertices for s in solids), anchors])
    triangles = np.concatenate([s.triangles + begin for s, begin in zip(solids, begins[:-1], strict=True)])
    if needed:
        mass, center, inertia = _sum([s.moments for s in solids if s.moments is not None])
        if d.mass is not None:
            inertia = inertia * (d.mass / mass)
            mass = d.mass
    if d.mass is not None:
        mass = d.mass
    if d.center is not None:
        center = d.center * d.scale
    if d.inertia is not None:
        inertia = np.diag(d.inertia) if d.inertia.ndim == 1 else np.array(d.inertia)
    return RigidShape(mass, np.array(center), inertia, vertices, triangles.astype(np.int32))


def _sum(parts: list[MassProperties]) -> MassProperties:
    """Masses add; inertias add about the common centre (parallel axes)."""
    mass = float(sum(m for m, _, _ in parts))
    center = np.sum([m * c for m, c, _ in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in parts:
        r = c - center
        inertia += own + m * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, center, inertia


def _part(part: PartDef, folder: Path, scale: float, density: float, needed: bool) -> _Solid:
    """A part in the body's frame."""
    solid = _solid(part, folder, scale, density, needed)
    turn = Rotation.from_rotvec(np.array(part.rotation)).as_matrix()
    shift = part.position * scale
    moments = solid.moments
    if moments is not None:
        mass, center, inertia = moments
        moments = mass, turn @ center + shift, turn @ inertia @ turn.T
    return _Solid(solid.vertices @ turn.T + shift, solid.triangles, moments)


def _solid(d: ShapeDef, folder: Path, scale: float, density: float, needed: bool) -> _Solid:
    """One shape in its own coordinates, scaled. The primitives' moments are in closed form, not of their triangles."""
    if d.box is not None:
        return _Solid(*box_surface(d.box * scale), box_mass(d.box * scale, density))
    if d.sphere is not None:
        return _Solid(*sphere_surface(d.sphere * scale), sphere_mass(d.sphere * scale, density))
    if d.cylinder is not None:
        sizes = d.cylinder.radius * scale, d.cylinder.length * scale
        return _Solid(*cylinder_surface(*sizes), cylinder_mass(*sizes, density))
    if d.capsule is not None:
        sizes = d.capsule.radius * scale, d.capsule.length * scale
        return _Solid(*capsule_surface(*sizes), capsule_mass(*sizes, density))
    vertices, triangles = surface_of(d, folder)
    vertices = vertices * scale
    return _Solid(vertices, triangles, mass_properties(vertices, triangles, density) if needed else None)


def surface_of(d: ShapeDef, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a shape given as `mesh`, or as `vertices` and `triangles`; not scaled."""
    if d.mesh is None:
        return np.asarray(d.vertices), np.asarray(d.triangles, dtype=np.int32)
    mesh = read_mesh(folder / Path(d.mesh).expanduser())
    if isinstance(mesh, SurfaceMesh):
        return mesh.vertices, mesh.triangles
    if isinstance(mesh, TetMesh):
        used, index = np.unique(mesh.boundary, return_inverse=True)
        return mesh.vertices[used], index.reshape(-1, 3).astype(np.int32)
    raise InputError(f"mesh '{d.mesh}' has lines only; a rigid body takes a closed surface or tetrahedra")
