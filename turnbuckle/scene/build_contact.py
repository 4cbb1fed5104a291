"""Which surfaces of a scene keep apart, at what distance, with what friction: ``SceneDef -> Surfaces``."""

from collections.abc import Iterator, Sequence

import numpy as np

from turnbuckle.data.contact import ContactOptions, Surfaces
from turnbuckle.data.shape import Shape
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.contact_definitions import ContactDef
from turnbuckle.scene.definitions import (
    AttachDef,
    BodyDef,
    BodyPairDef,
    ObstacleDef,
    PointsToPointDef,
    RigidDef,
    SceneDef,
    SlideDef,
)

EDGE_PART = 0.1  # of the mean length of the edges at a vertex: the distance kept where none is given
SIZE_PART = 0.005  # of the body's size: and at most this
JOINING = (BodyPairDef, AttachDef, PointsToPointDef, SlideDef)


def contact_options(d: ContactDef | None) -> ContactOptions:
    """The options of a scene."""
    if d is None:
        return ContactOptions()
    return ContactOptions(**{name: getattr(d, name) for name in ContactOptions.__dataclass_fields__})


def contact_surfaces(definition: SceneDef, shapes: Sequence[Shape], x: np.ndarray) -> Surfaces | None:
    """The surfaces of all bodies that touch anything, None where contact is off.

    ``definition``: coatings written out as solids, so that body i has shape i; shapes beyond (skins) touch nothing.
    ``x`` (points, 3): all points at the start [m].
    """
    options = definition.contact
    if options is None:
        return None
    bodies = definition.bodies
    collides = _collides(definition, len(shapes))
    support, weights, faces, lines, owner = [], [], [], [], []
    count = 0
    for i, (body, shape) in enumerate(zip(bodies, shapes, strict=False)):
        if not collides[i].any():
            continue
        points, parts, triangles, segments = _surface(body, shape)
        support.append(points)
        weights.append(parts)
        faces.append(triangles + count)
        lines.append(segments + count)
        owner.append(np.full(len(points), i))
        count += len(points)
    support = _joined(support, 4, np.int32)
    weights = _joined(weights, 4, np.float64)
    faces, shape_of = _joined(faces, 3, np.int32), np.concatenate([np.zeros(0), *owner]).astype(np.int32)
    edges, edge_faces = edges_of(faces, _joined(lines, 2, np.int32), count)
    places = np.einsum("sk,skd->sd", weights, x[support])
    still = np.array([_scripted(body) for body in bodies] + [True] * (len(shapes) - len(bodies)))
    return Surfaces(
        support=support,
        weights=weights,
        faces=faces,
        edges=edges,
        edge_faces=edge_faces,
        shape=shape_of,
        delta=_deltas(bodies, options, places, edges, shape_of, still),
        collides=collides,
        friction=_friction(definition, len(shapes)),
    )


def edges_of(faces: np.ndarray, lines: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Edges (e, 2) of faces and lines over ``n`` vertices, sorted, each once, and the faces at each (e, 2), else -1."""
    f = np.asarray(faces, dtype=np.int64)
    ends = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]], np.asarray(lines, np.int64)]), axis=1)
    face = np.r_[np.tile(np.arange(len(f)), 3), np.full(len(lines), -1)]
    key = ends[:, 0] * n + ends[:, 1]
    order = np.lexsort((face, key))
    keys, number = np.unique(key, return_inverse=True)
    edge_faces = np.full((len(keys), 2), -1, dtype=np.int32)
    real = order[face[order] >= 0]
    edge = number.ravel()[real]
    rank = np.arange(len(edge)) - np.searchsorted(edge, edge)
    kept = rank < 2
    edge_faces[edge[kept], rank[kept]] = face[real][kept]
    return np.stack([keys // max(n, 1), keys % max(n, 1)], axis=1).astype(np.int32), edge_faces


def _joined(parts: list[np.ndarray], columns: int, kind: type) -> np.ndarray:
    return np.concatenate([np.zeros((0, columns)), *parts]).astype(kind)


def _scripted(body: BodyDef) -> bool:
    """Whether contact cannot move it."""
    return isinstance(body, ObstacleDef) or (isinstance(body, RigidDef) and body.motion != "dynamic")


def _surface(body: BodyDef, shape: Shape) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Supports (s, 4), weights (s, 4), triangles and lines over the s vertices of one body."""
    if shape.skin is not None and shape.skin.points.shape[1] <= 4:
        k = shape.skin.points.shape[1]
        points = np.repeat(shape.skin.points[:, :1], 4, axis=1)
        weights = np.zeros((len(points), 4))
        points[:, :k], weights[:, :k] = shape.skin.points, shape.skin.weights
        return points, weights, shape.skin.triangles, np.zeros((0, 2), np.int32)
    used = np.unique(np.concatenate([shape.triangles.ravel(), shape.lines.ravel()]))
    number = np.zeros(shape.end - shape.begin, dtype=np.int32)
    number[used] = np.arange(len(used))
    points = np.repeat((used + shape.begin)[:, None], 4, axis=1).astype(np.int32)
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(used), 1))
    return points, weights, number[shape.triangles], number[shape.lines]


def _collides(definition: SceneDef, count: int) -> np.ndarray:
    """Which bodies touch which (shapes, shapes)."""
    options, bodies = definition.contact, definition.bodies
    assert options is not None
    number = {body.name: i for i, body in enumerate(bodies)}
    on = np.zeros(count, dtype=bool)
    own = np.zeros(count, dtype=bool)
    still = np.ones(count, dtype=bool)
    for i, body in enumerate(bodies):
        still[i] = _scripted(body)
        hard = isinstance(body, ObstacleDef | RigidDef)
        on[i] = body.contact is not False
        own[i] = on[i] and not hard and body.contact != "self off"
    collides = np.outer(on, on) & ~np.outer(still, still)
    np.fill_diagonal(collides, own)
    if not options.jointed:
        for names in _joined_bodies(definition):
            for a in names:
                for b in names:
                    if a != b:
                        collides[number[a], number[b]] = False
    for pairs, value in ((options.ignore, False), (options.collide, True)):
        for pair in pairs:
            i, j = (number[name] for name in pair.between)
            if i != j and not (still[i] and still[j]):
                collides[i, j] = collides[j, i] = value
    return collides


def _joined_bodies(definition: SceneDef) -> Iterator[set[str]]:
    """Bodies that a constraint of the scene joins, by name."""
    for constraint in definition.constraints:
        if isinstance(constraint, JOINING):
            names = set(_names(constraint))
            if len(names) > 1:
                yield names


def _names(value: object) -> Iterator[str]:
    """Names of bodies anywhere in a constraint."""
    if isinstance(value, Definition):
        for name in type(value).model_fields:
            inner = getattr(value, name)
            if name in ("body", "body0", "body1") and isinstance(inner, str):
                yield inner
            elif name == "bodies":
                yield from inner
            else:
                yield from _names(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _names(inner)


def _deltas(
    bodies: Sequence[BodyDef],
    options: ContactDef,
    x: np.ndarray,
    edges: np.ndarray,
    shape: np.ndarray,
    still: np.ndarray,
) -> np.ndarray:
    """The distance that each vertex keeps (s,) [m]."""
    n = len(x)
    length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    total = np.bincount(edges.ravel(), weights=np.repeat(length, 2), minlength=n)
    delta = EDGE_PART * total / np.maximum(np.bincount(edges.ravel(), minlength=n), 1)
    for i in np.unique(shape):
        own = shape == i
        delta[own] = np.minimum(delta[own], SIZE_PART * np.linalg.norm(np.ptp(x[own], axis=0)))
    if options.delta is not None:
        delta[:] = options.delta
    elif (~still[shape]).any():
        delta[still[shape]] = np.minimum(delta[still[shape]], np.median(delta[~still[shape]]))
    for i, body in enumerate(bodies):
        if body.contact_delta is not None:
            delta[shape == i] = body.contact_delta
    return delta


def _friction(definition: SceneDef, count: int) -> np.ndarray:
    """Static and dynamic coefficients of each pair (shapes, shapes, 2)."""
    options, bodies = definition.contact, definition.bodies
    assert options is not None
    usual = options.friction if options.dynamic_friction is None else options.dynamic_friction
    own = np.tile([options.friction, usual], (count, 1))
    for i, body in enumerate(bodies):
        if body.static_friction is not None:
            own[i] = body.static_friction
        if body.dynamic_friction is not None:
            own[i, 1] = body.dynamic_friction
            own[i, 0] = max(own[i])
    friction = np.sqrt(own[:, None] * own[None, :])
    rank = np.zeros((count, count), dtype=int)  # how many of the two names are those of bodies, plus one
    for pair in definition.frictions:
        first, second = (_meant(name, bodies) for name in pair.between)
        for i, exact_i in first:
            for j, exact_j in second:
                if 1 + exact_i + exact_j >= rank[i, j]:
                    rank[i, j] = rank[j, i] = 1 + exact_i + exact_j
                    friction[i, j] = friction[j, i] = pair.static, pair.static if pair.dynamic is None else pair.dynamic
    return friction


def _meant(name: str, bodies: Sequence[BodyDef]) -> list[tuple[int, int]]:
    """Bodies of this name (1), and of this material (0)."""
    return [(i, int(body.name == name)) for i, body in enumerate(bodies) if name in (body.name, body.friction)]
