"""From the definition of a skin to a surface over the points of the state (Displacement, 5.1).

Control points are fixed in the bodies: in a rigid body as an affine combination of four of its points, which moves
exactly as the body does; in a coating or solid by barycentric weights in a tetrahedron. The surface is linear in its
control points, hence in the positions of the points of the state.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.meshes.embedding import embed
from turnbuckle.meshes.spline_surface import spline_surface
from turnbuckle.scene.definitions import CoatingDef, RigidDef, SceneDef, SkinDef, SolidDef
from turnbuckle.scene.skin_rings import automatic_rings, given_rings

FLAT = 1e-9  # of the cube of a body's size: points that span no space


def add_skins(definition: SceneDef, shapes: Sequence[Shape], x: np.ndarray) -> tuple[Shape, ...]:
    """The shapes, what skins cover no longer drawn, and one more for each skin, which has no points of its own.

    ``definition`` is the user's (coatings not written out); ``x`` (points, 3) are all points at the start [m]. Raises
    InputError that names the skin.
    """
    if not definition.skins:
        return tuple(shapes)
    by_name = {shape.name: shape for shape in shapes}
    kernels = {body.name: body.around for body in definition.bodies if isinstance(body, CoatingDef)}
    covered: set[str] = set()
    made = []
    for skin in definition.skins:
        try:
            made.append(_skin(skin, definition, by_name, x))
        except InputError as error:
            raise InputError(f"skin '{skin.name}': {error}") from None
        covered.update(skin.bodies)
        covered.update(kernels[name] for name in skin.bodies if name in kernels)
    return (*(replace(s, drawn=s.drawn and s.name not in covered) for s in shapes), *made)


def _skin(d: SkinDef, definition: SceneDef, shapes: dict[str, Shape], x: np.ndarray) -> Shape:
    bodies = {body.name: body for body in definition.bodies}
    for name in d.bodies:
        if not isinstance(bodies[name], RigidDef | CoatingDef | SolidDef):
            raise InputError(f"'{name}' is a {bodies[name].type}; a skin covers rigid bodies, coatings and solids")
    if d.sections is not None:
        rings, poles = given_rings(d, bodies)
    else:
        rings, poles = automatic_rings(d, [shapes[name] for name in d.bodies], x)
    owners = [ring.body for ring in rings for _ in range(d.around)] + [rings[0].body, rings[-1].body]
    controls = _carried(np.concatenate([*(ring.controls for ring in rings), poles]), owners, shapes, x)
    surface = spline_surface(len(rings), d.around, d.resolution)
    color = None if d.color is None else tuple(float(c) for c in d.color)
    skin = padded(csr_array(surface.weights @ controls), surface.triangles)
    return Shape(d.name, 0, 0, skin=skin, color=color)  # type: ignore[arg-type]


def _carried(controls: np.ndarray, owners: Sequence[str], shapes: dict[str, Shape], x: np.ndarray) -> csr_array:
    """Weights of the points of the state in each control point, (controls, points)."""
    points, weights = np.zeros((len(controls), 4), dtype=np.int64), np.zeros((len(controls), 4))
    for name in dict.fromkeys(owners):
        rows = np.array([k for k, owner in enumerate(owners) if owner == name])
        shape = shapes[name]
        own = x[shape.begin : shape.end]
        if len(shape.tetrahedra):
            corners, weights[rows] = embed(controls[rows], own, shape.tetrahedra)
            points[rows] = corners + shape.begin
        else:
            four = spanning_points(own, name)
            points[rows] = four + shape.begin
            weights[rows] = _affine(own[four], controls[rows])
    row = np.repeat(np.arange(len(controls)), 4)
    return csr_array((weights.ravel(), (row, points.ravel())), shape=(len(controls), len(x)))


def spanning_points(points: np.ndarray, name: str) -> np.ndarray:
    """Four of the points (n, 3), far apart, not in one plane, (4,) int. Raises InputError where there are none."""
    a = 0
    b = int(np.argmax(((points - points[a]) ** 2).sum(axis=1)))
    ab = points[b] - points[a]
    c = int(np.argmax((np.cross(points - points[a], ab) ** 2).sum(axis=1)))
    height = (points - points[a]) @ np.cross(ab, points[c] - points[a])
    d = int(np.argmax(np.abs(height)))
    if abs(height[d]) <= FLAT * np.linalg.norm(ab) ** 3:
        raise InputError(
            f"the points of '{name}' lie in one plane, which cannot carry a surface; give it a marker off it"
        )
    return np.array([a, b, c, d])


def _affine(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights (n, 4) of sum 1 that make the points of the four corners."""
    three = np.linalg.solve((corners[1:] - corners[0]).T, (points - corners[0]).T).T
    return np.c_[1.0 - three.sum(axis=1), three]


def padded(weights: csr_array, triangles: np.ndarray) -> Skin:
    """A sparse map (n, points) as a `Skin`; short rows repeat their first point with weight 0."""
    weights.sum_duplicates()
    weights.eliminate_zeros()
    count = np.diff(weights.indptr)
    place = np.arange(count.max()) < count[:, None]
    points = np.repeat(weights.indices[weights.indptr[:-1], None], count.max(), axis=1).astype(np.int32)
    values = np.zeros(place.shape)
    points[place], values[place] = weights.indices, weights.data
    return Skin(points, values, triangles)
