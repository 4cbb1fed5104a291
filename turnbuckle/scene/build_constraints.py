"""From the definition of a constraint to rows of a table; also for constraints added while the simulation runs."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from turnbuckle.constraints.activation import add_group, reserve
from turnbuckle.data.errors import ConflictError, InputError
from turnbuckle.data.groups import Group
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.data.tables import Domain, Joins, write
from turnbuckle.meshes.embedding import embed
from turnbuckle.scene.definitions import (
    AttachDef,
    ConstraintBase,
    NailDef,
    PointsDef,
    PointsToPointDef,
    SlideDef,
    VelocityDef,
)
from turnbuckle.scene.goals import Goal, nail_goal, velocity_goal
from turnbuckle.scene.nearest import nearest_element, projection_weights
from turnbuckle.scene.points import select, where_mask


def add_constraints(model: Model, state: State, definitions: Sequence[ConstraintBase]) -> None:
    """Add constraints; those that act now are switched on. Raises InputError, and `ConflictError` naming both."""
    groups = [_make(model, state, d) for d in definitions]
    for group in groups:
        _refuse_scripted(model, group)
    if model.conflicts == "error":
        check_windows(model, state, [*state.groups.values(), *groups])
    for group in groups:
        add_group(model, state, group)


def add_constraint(model: Model, state: State, definition: ConstraintBase) -> None:
    """Add one constraint to a running simulation; selections and goals mean where points are now."""
    if definition.name in state.groups or definition.name in state.joints:
        raise InputError(f"there is a constraint '{definition.name}' already; remove it or take another name")
    add_constraints(model, state, [definition])


def goal_of(definition_goal: object, group: Group, state: State) -> Goal:
    """A goal as the user writes it, for an existing nail or velocity constraint."""
    if group.kind == "velocity":
        return velocity_goal(definition_goal, len(group.rows), f"constraint {group.name!r}")
    return nail_goal(definition_goal, state.positions()[group.points], f"constraint {group.name!r}")


def check_windows(model: Model, state: State, groups: Sequence[Group]) -> None:
    """Raise `ConflictError` when two enabled constraints will hold one point at one time."""
    enabled = [g for g in groups if g.enabled]
    if not enabled:
        return
    which = np.concatenate([np.full(len(g.points), i) for i, g in enumerate(enabled)])
    row = np.concatenate([np.repeat(np.arange(len(g.rows)), np.diff(g.offsets)) for g in enabled])
    points = np.concatenate([g.points for g in enabled])
    start = np.array([g.start for g in enabled])[which]
    end = np.array([g.end for g in enabled])[which]
    free = model.body_of[points] < 0  # a point of a rigid body may serve many
    which, row, points, start, end = which[free], row[free], points[free], start[free], end[free]
    order = np.lexsort((start, points))
    same = points[order][1:] == points[order][:-1]
    clash = np.flatnonzero(same & (start[order][1:] < end[order][:-1]))
    if len(clash):
        a, b = order[clash[0]], order[clash[0] + 1]
        shape = next(s for s in model.shapes if s.begin <= points[a] < s.end)
        raise ConflictError(
            f"constraints '{enabled[which[a]].name}[{row[a]}]' and '{enabled[which[b]].name}[{row[b]}]' both hold point "
            f"{points[a] - shape.begin} of '{shape.name}' at t = {max(start[a], start[b]):g} s; give them other points or "
            "time windows, or set conflicts: solve"
        )


def _make(model: Model, state: State, d: ConstraintBase) -> Group:
    try:
        if isinstance(d, NailDef | VelocityDef):
            return _pointwise(model, state, d)
        if isinstance(d, PointsToPointDef):
            return _joins(model, state, d)
        if isinstance(d, AttachDef):
            return _attachments(model, state, d)
        assert isinstance(d, SlideDef)
        return _slides(model, state, d)
    except InputError as error:
        text = str(error)
        raise InputError(text if d.name in text else f"constraint '{d.name}': {text}") from None


def _refuse_scripted(model: Model, group: Group) -> None:
    """Raise InputError for a row that takes points of obstacles only."""
    for script in model.scripted:
        mine = (group.points >= script.begin) & (group.points < script.end)
        if mine.any() and np.logical_and.reduceat(mine, group.offsets[:-1]).any():
            raise InputError(
                f"constraint '{group.name}': holds points of the obstacle '{script.name}' alone, which goes where its script "
                "says; take points of another body, too"
            )


def _group(d: ConstraintBase, rows: np.ndarray, offsets: np.ndarray, points: np.ndarray, **more: object) -> Group:
    ramp = {}
    if d.ramp is not None:
        speed = np.inf if d.ramp.max_speed is None else d.ramp.max_speed
        ramp = {"ramp_steps": d.ramp.steps, "ramp_paper": d.ramp.mode == "paper", "ramp_speed": speed}
    return Group(
        name=d.name, kind=d.type, rows=rows, offsets=offsets, points=points.astype(np.int64), enabled=d.enabled, start=d.start,
        end=np.inf if d.end is None else d.end, break_force=np.inf if d.break_force is None else d.break_force,
        definition=d, **ramp, **more,
    )  # fmt: skip


def _points(model: Model, state: State, selections: Sequence[PointsDef], name: str) -> np.ndarray:
    """Numbers of selected points among all points of the model, in the order given."""
    x = state.positions()
    out = []
    for s in selections:
        shape = model.shape(s.body)
        out.append(select(s, x[shape.begin : shape.end], f"constraint {name!r}") + shape.begin)
    points = np.concatenate(out)
    values, first = np.unique(points, return_index=True)
    if len(values) < len(points):
        twice = np.setdiff1d(np.arange(len(points)), first)[0]
        raise InputError(
            f"constraint '{name}': two selections take the same point ({points[twice]}); name each point once"
        )
    return points


def _pointwise(model: Model, state: State, d: NailDef | VelocityDef) -> Group:
    points = _points(model, state, d.points, d.name)
    if isinstance(d, NailDef):
        goal = nail_goal(d.goal, state.positions()[points], f"constraint {d.name!r}")
    else:
        goal = velocity_goal(d.goal, len(points), f"constraint {d.name!r}")
    rows = reserve(state, d.type, len(points), 0, model.device)
    table = getattr(state.tables, d.type)
    write(table.point, rows, points)
    for column in (table.goal, table.goal_now):
        write(column, rows, goal.position(state.time))
    return _group(d, rows, np.arange(len(points) + 1), points, goal=goal, moving=goal.moves)


def _joins(model: Model, state: State, d: PointsToPointDef) -> Group:
    if d.groups is not None:
        sizes = np.array([len(g) for g in d.groups])
        points = np.array([_one_point(model, ref.body, ref.index) for g in d.groups for ref in g])
    elif d.zip is not None:
        columns = [_points(model, state, [s], d.name) for s in d.zip]
        if len({len(c) for c in columns}) > 1:
            counts = ", ".join(str(len(c)) for c in columns)
            raise InputError(
                f"constraint '{d.name}': zip joins selections point by point, but they have {counts} points"
            )
        sizes = np.full(len(columns[0]), len(columns))
        points = np.stack(columns, axis=1).ravel()
    elif d.join is not None:
        points = _points(model, state, d.join, d.name)
        sizes = np.array([len(points)])
    else:
        assert d.coincident is not None
        sizes, points = _coincident(model, state, d.coincident.bodies, d.coincident.tolerance)
    if len(sizes) == 0 or sizes.min() < 2:
        raise InputError(f"constraint '{d.name}': finds no two points to join")
    rows = reserve(state, d.type, len(sizes), len(points), model.device)
    table = state.tables.points_to_point
    assert isinstance(table, Joins)
    base = int(table.offsets.numpy()[rows[0]])
    offsets = np.r_[0, np.cumsum(sizes)]
    write(table.offsets, np.r_[rows, rows[-1] + 1], base + offsets)
    write(table.points, base + np.arange(len(points)), points)
    return _group(d, rows, offsets, points)


def _one_point(model: Model, body: str, index: int) -> int:
    shape = model.shape(body)
    if index >= shape.end - shape.begin:
        raise InputError(f"there is no point {index} in '{body}', which has {shape.end - shape.begin} points")
    return shape.begin + index


def _coincident(model: Model, state: State, bodies: Sequence[str], tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    chosen = np.concatenate([np.arange(model.shape(b).begin, model.shape(b).end) for b in bodies])
    x = state.positions()[chosen]
    pairs = cKDTree(x).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(x), len(x)))
    count, label = connected_components(graph, directed=False)
    sizes = np.bincount(label, minlength=count)
    order = np.argsort(label, kind="stable")
    keep = sizes > 1
    return sizes[keep], chosen[order[keep[label[order]]]]


def _attachments(model: Model, state: State, d: AttachDef) -> Group:
    points = _points(model, state, d.points, d.name)
    x, shape = state.positions(), model.shape(d.to.body)
    weights = d.weights
    if d.to.elements is not None:
        elements = d.to.elements.astype(np.int64)
        if len(elements) not in (1, len(points)):
            raise InputError(f"constraint '{d.name}': to.elements has {len(elements)} rows for {len(points)} points")
        if elements.max() >= shape.end - shape.begin:
            raise InputError(f"constraint '{d.name}': to.elements names point {elements.max()}, but '{d.to.body}' has "
                             f"{shape.end - shape.begin} points")  # fmt: skip
        elements = np.broadcast_to(elements, (len(points), elements.shape[1])) + shape.begin
        weights = None if weights is None else np.broadcast_to(weights, elements.shape)
    elif d.to.nearest == "tetrahedron":
        if len(shape.tetrahedra) == 0:
            raise InputError(f"constraint '{d.name}': '{d.to.body}' has no tetrahedra")
        elements, weights = embed(x[points], x[shape.begin : shape.end], shape.tetrahedra)
        elements = elements.astype(np.int64) + shape.begin
    else:
        candidates = shape.lines if d.to.nearest == "line" else shape.triangles
        if len(candidates) == 0:
            raise InputError(f"constraint '{d.name}': '{d.to.body}' has no {d.to.nearest}s")
        elements = candidates[nearest_element(x[points], x[shape.begin : shape.end][candidates])] + shape.begin
    if weights is None:
        weights = projection_weights(x[points], x[elements])
    own = np.flatnonzero((elements == points[:, None]).any(axis=1))
    if len(own):
        raise InputError(f"constraint '{d.name}': point {points[own[0]] - shape.begin} would be attached to itself")
    rows = reserve(state, "attach", len(points), 0, model.device)
    _write_places(state.tables.attach, rows, np.c_[points, elements], np.c_[np.ones(len(points)), -weights])
    k = 1 + elements.shape[1]
    return _group(d, rows, np.arange(len(points) + 1) * k, np.c_[points, elements].ravel())


def _write_places(table: object, rows: np.ndarray, points: np.ndarray, weights: np.ndarray) -> None:
    k = points.shape[1]
    write(table.count, rows, k)
    all_points, all_weights = table.points.numpy(), table.weights.numpy()
    all_points[rows] = points[:, :1]  # unused entries name the point itself, with weight 0
    all_weights[rows] = 0.0
    all_points[rows, :k] = points
    all_weights[rows, :k] = weights
    table.points.assign(all_points)
    table.weights.assign(all_weights)


def _slides(model: Model, state: State, d: SlideDef) -> Group:
    points = _points(model, state, d.points, d.name)
    domain = _domain(model, state, d)
    inside = np.intersect1d(points, domain.elements)
    if len(inside):
        shape = model.shape(d.on.body)
        raise InputError(f"constraint '{d.name}': point {inside[0] - shape.begin} would slide on an element of its own")
    if state.follows[points].any() or state.follows[domain.elements].any():
        raise InputError(
            f"constraint '{d.name}': slides are for mass points on mass points; hold a rigid body on a curve or surface with a "
            "joint (curve, surface)"
        )
    state.tables.domains.append(domain)
    state.layout += 1
    rows = reserve(state, "slide", len(points), 0, model.device)
    table = state.tables.slide
    write(table.domain, rows, len(state.tables.domains) - 1)
    write(table.element, rows, -1)
    filled = np.repeat(points[:, None], 5, axis=1)
    _write_places(table, rows, filled[:, :1], np.ones((len(points), 1)))
    return _group(d, rows, np.arange(len(points) + 1), points, domain=len(state.tables.domains) - 1)


def _domain(model: Model, state: State, d: SlideDef) -> Domain:
    shape, on = model.shape(d.on.body), d.on
    n = shape.end - shape.begin
    if on.rope:
        elements = shape.lines
    elif on.surface:
        elements = shape.triangles
    else:
        elements = next(e for e in (on.lines, on.triangles, on.line, on.triangle) if e is not None)
    elements = np.atleast_2d(elements).astype(np.int64)
    if len(elements) == 0:
        raise InputError(f"constraint '{d.name}': '{d.on.body}' has no {'lines' if on.rope else 'surface'} to slide on")
    if elements.max() >= n:
        raise InputError(f"constraint '{d.name}': on names point {elements.max()}, but '{d.on.body}' has {n} points")
    if on.where is not None:
        inside = where_mask(on.where, state.positions()[shape.begin : shape.end])
        elements = elements[inside[elements].all(axis=1)]
        if len(elements) == 0:
            raise InputError(f"constraint '{d.name}': on.where {on.where!r} leaves no element to slide on")
    return Domain(d.name, (elements + shape.begin).astype(np.int32), rim_bits(elements, n))


def rim_bits(elements: np.ndarray, n: int) -> np.ndarray:
    """Which ends of segments, or edges of triangles (opposite of corner k), bound the domain: bit k set."""
    k = elements.shape[1]
    if k == 2:
        degree = np.bincount(elements.ravel(), minlength=n)
        return ((degree[elements] == 1) * (1 << np.arange(2))).sum(axis=1).astype(np.int32)
    e = elements.astype(np.int64)
    edges = np.sort(np.stack([e[:, [1, 2]], e[:, [2, 0]], e[:, [0, 1]]], axis=1), axis=2)
    key = edges[:, :, 0] * n + edges[:, :, 1]
    _, inverse, count = np.unique(key.ravel(), return_inverse=True, return_counts=True)
    single = count[inverse.ravel()].reshape(key.shape) == 1
    return (single * (1 << np.arange(3))).sum(axis=1).astype(np.int32)
