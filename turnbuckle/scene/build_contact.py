"""Which surfaces of a scene keep apart, at what distance, with what friction: ``SceneDef -> Surfaces``."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from turnbuckle.contact.surface import SurfacePart, find_edges, make_surfaces
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
    SolidDef,
)

EDGE_PART = 0.1  # of the mean length of the edges at a vertex: the distance kept where none is given
SIZE_PART = 0.005  # of the body's size: and at most this
JOINING = (BodyPairDef, AttachDef, PointsToPointDef, SlideDef)


def contact_options(d: ContactDef | None) -> ContactOptions:
    """The options of a scene."""
    if d is None:
        return ContactOptions()
    return ContactOptions(**{name: getattr(d, name) for name in ContactOptions.__dataclass_fields__})


def contact_surfaces(
    definition: SceneDef, kernels: dict[str, str], shapes: Sequence[Shape], x: np.ndarray
) -> Surfaces | None:
    """The surfaces of all bodies that touch anything, None where contact is off.

    ``definition``: coatings written out as solids, so that body i has shape i; shapes beyond (skins) touch nothing.
    ``kernels``: of each coating, the body inside. ``x`` (points, 3): all points at the start [m].
    """
    options = definition.contact
    if options is None:
        return None
    collides = _collides(definition, kernels, len(shapes))
    touching = [
        (body, _part(i, body, shape))
        for i, (body, shape) in enumerate(zip(definition.bodies, shapes, strict=False))
        if collides[i].any()
    ]
    deltas = _deltas(touching, options, x)
    parts = [replace(part, delta=delta) for (_, part), delta in zip(touching, deltas, strict=True)]
    return make_surfaces(parts, x, collides, _friction(definition, len(shapes)))


def _scripted(body: BodyDef) -> bool:
    """Whether contact cannot move it."""
    return isinstance(body, ObstacleDef) or (isinstance(body, RigidDef) and body.motion != "dynamic")


def _part(number: int, body: BodyDef, shape: Shape) -> SurfacePart:
    """The surface of one body: the finer one that is embedded in it, else its own triangles and lines."""
    if shape.skin is not None and isinstance(body, SolidDef):
        return SurfacePart(number, shape.skin.points, shape.skin.weights, shape.skin.triangles)
    used = np.unique(np.concatenate([shape.triangles.ravel(), shape.lines.ravel()]))
    index = np.zeros(shape.end - shape.begin, dtype=np.int32)
    index[used] = np.arange(len(used))
    return SurfacePart(number, used + shape.begin, None, index[shape.triangles], index[shape.lines])


def _collides(definition: SceneDef, kernels: dict[str, str], count: int) -> np.ndarray:
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
        on[i] = body.contact != "off"
        own[i] = on[i] and not hard and body.contact != "others"
    collides = np.outer(on, on) & ~np.outer(still, still)
    np.fill_diagonal(collides, own)
    if not options.jointed:
        for names in _joined_bodies(definition, kernels):
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


def _joined_bodies(definition: SceneDef, kernels: dict[str, str]) -> Iterator[set[str]]:
    """Bodies that a constraint of the scene joins, by name; what coats one of two jointed bodies joins in."""
    for constraint in definition.constraints:
        if isinstance(constraint, JOINING):
            names = set(_names(constraint))
            names |= {coating for coating, kernel in kernels.items() if kernel in names}
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
    touching: Sequence[tuple[BodyDef, SurfacePart]], options: ContactDef, x: np.ndarray
) -> list[float | np.ndarray]:
    """The distance that each vertex of each part keeps (n,) [m], or one for all."""
    own = [_own_delta(part, x) for _, part in touching]
    moving = [delta for (body, _), delta in zip(touching, own, strict=True) if not _scripted(body) and len(delta)]
    most = np.median(np.concatenate(moving)) if moving else np.inf
    found: list[float | np.ndarray] = []
    for (body, _), delta in zip(touching, own, strict=True):
        if body.contact_delta is not None:
            found.append(body.contact_delta)
        elif options.delta is not None:
            found.append(options.delta)
        else:
            found.append(np.minimum(delta, most) if _scripted(body) else delta)
    return found


def _own_delta(part: SurfacePart, x: np.ndarray) -> np.ndarray:
    """By the lengths of the edges, and by the size of the body (n,) [m]."""
    place = x[part.support] if part.weights is None else np.einsum("sk,skd->sd", part.weights, x[part.support])
    edges, _ = find_edges(part.triangles, part.lines)
    length = np.linalg.norm(place[edges[:, 1]] - place[edges[:, 0]], axis=1)
    n = len(place)
    total = np.bincount(edges.ravel(), weights=np.repeat(length, 2), minlength=n)
    mean = total / np.maximum(np.bincount(edges.ravel(), minlength=n), 1)
    return np.minimum(EDGE_PART * mean, SIZE_PART * np.linalg.norm(np.ptp(place, axis=0)))


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
