"""Mass, centre and inertia of solids of constant density.

Every function takes a density [kg/m^3] and returns the mass [kg], the centre of mass (3,) [m], and the inertia about
it (3, 3) [kg m^2], in the axes of the given coordinates.
"""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.read import weld
from turnbuckle.meshes.repair import check_surface

MassProperties = tuple[float, np.ndarray, np.ndarray]
NO_VOLUME = 1e-12  # of the cube of the extent


def box_mass(size: np.ndarray, density: float) -> MassProperties:
    """A box of lengths ``size`` (3,), centred on the origin."""
    x, y, z = (float(s) for s in size)
    mass = density * x * y * z
    return mass, np.zeros(3), mass / 12.0 * np.diag([y * y + z * z, z * z + x * x, x * x + y * y])


def sphere_mass(radius: float, density: float) -> MassProperties:
    """A ball centred on the origin."""
    mass = density * 4.0 / 3.0 * np.pi * radius**3
    return mass, np.zeros(3), 0.4 * mass * radius**2 * np.eye(3)


def cylinder_mass(radius: float, length: float, density: float) -> MassProperties:
    """A cylinder along z, its middle at the origin."""
    mass = density * np.pi * radius**2 * length
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return mass, np.zeros(3), np.diag([across, across, 0.5 * mass * radius**2])


def capsule_mass(radius: float, length: float, density: float) -> MassProperties:
    """A cylinder with half balls beyond its ends.

    A half ball's centre is 3 r / 8 from its disc, its inertia across the axis about the disc's centre 2 m r^2 / 5; moved
    to the middle: 2 m r^2 / 5 + m (l/2)^2 + m (l/2) (3 r / 4).
    """
    mass, _, inertia = cylinder_mass(radius, length, density)
    caps = density * 4.0 / 3.0 * np.pi * radius**3
    along = 0.4 * caps * radius**2
    across = along + caps * (0.25 * length**2 + 0.375 * length * radius)
    return mass + caps, np.zeros(3), inertia + np.diag([across, across, along])


def mass_properties(vertices: np.ndarray, triangles: np.ndarray, density: float) -> MassProperties:
    """A closed surface: vertices [m] (n, 3), triangles (m, 3) with normals outwards; a part turned inwards is a cavity.

    Exact for the polyhedron: the sum over the tetrahedra between a reference point and each triangle, whose moments are
    polynomials in the corners a, b, c:
      int 1 = D/6,  int x = D/24 (a+b+c),  int x x^T = D/120 (a a^T + b b^T + c c^T + s s^T),
    D = a . (b x c), s = a + b + c. Parts that overlap count twice where they do.
    Raises InputError for a surface that is open, one-sided, inverted, of no volume, or that touches itself in an edge.
    """
    vertices, triangles = check_solid(vertices, triangles)
    used = vertices[triangles]
    origin = 0.5 * (used.min(axis=(0, 1)) + used.max(axis=(0, 1)))  # close by, so that nothing cancels
    a, b, c = np.moveaxis(used - origin, 1, 0)
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    s = a + b + c
    volume = six.sum() / 6.0
    center = (six @ s) / 24.0 / volume
    second = sum(np.einsum("i,ij,ik->jk", six, p, p) for p in (a, b, c, s)) / 120.0 - volume * np.outer(center, center)
    return density * float(volume), center + origin, density * (np.trace(second) * np.eye(3) - second)


def check_solid(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface, vertices of one place welded and triangles without area between two vertices dropped.

    Raises InputError (one sentence, what to do) unless it bounds a solid and all its normals point out of it.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    if not np.isfinite(vertices).all():
        raise InputError("surface: a vertex is not finite; repair the mesh")
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        raise InputError(f"surface: a triangle names a vertex out of 0..{len(vertices) - 1}; repair the mesh")
    vertices, index = weld(vertices)
    triangles = index[triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    if not len(triangles):
        raise InputError("surface: encloses no volume; give it triangles with three different corners")
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forward = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    edges, inverse, uses = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    balance = np.bincount(inverse.ravel(), weights=forward, minlength=len(edges))
    middle = vertices[edges].mean(axis=1)
    odd = np.flatnonzero(uses % 2)
    if len(odd):
        raise InputError(
            f"surface: is not closed: {len(odd)} open edges, one near {_place(middle[odd[0]])}; close its holes, or give "
            "mass, center and inertia"
        )
    turned = np.flatnonzero((uses == 2) & (balance != 0))
    if len(turned):
        raise InputError(
            f"surface: is inverted in parts: the triangles at {len(turned)} edges disagree about outside, one near "
            f"{_place(middle[turned[0]])}; make its normals point outwards"
        )
    corner = vertices[triangles] - vertices[triangles].mean(axis=(0, 1))
    volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6.0
    if abs(volume) <= NO_VOLUME * np.ptp(corner, axis=(0, 1)).max() ** 3:
        raise InputError("surface: encloses no volume; give it a thickness, or give mass, center and inertia")
    shared = np.flatnonzero(uses > 2)
    if len(shared):
        raise InputError(
            f"surface: touches itself: {uses[shared[0]]} triangles share the edge near {_place(middle[shared[0]])}; "
            "merge the parts that touch, or move them apart"
        )
    flipped = check_surface(vertices, triangles)[2].flipped
    if flipped:
        part = "is inverted" if flipped == len(triangles) else f"is inverted in parts ({flipped} triangles)"
        raise InputError(f"surface: {part}: its normals point inwards; turn its triangles round")
    return vertices, triangles


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in point) + ")"
