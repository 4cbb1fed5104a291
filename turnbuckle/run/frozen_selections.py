"""Point constraints whose points and goals were chosen by where bodies lay, said by numbers instead."""

from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.scene.definitions import (
    AttachDef,
    AttachToDef,
    ConstraintBase,
    ForceDef,
    KeyframesDef,
    NailDef,
    PointRef,
    PointsDef,
    PointsToPointDef,
    PullDef,
    SlideDef,
    SlideOnDef,
    VelocityDef,
)
from turnbuckle.scene.pulls import pulled_points

BY_NUMBER = ("indices", "index", "all")


def frozen(d: ConstraintBase, model: Model, state: State, moved: set[str]) -> ConstraintBase:
    """The constraint as it is, or, where it takes points of bodies that moved, with what it chose at the start."""
    if not _named(d) & moved:
        return d
    group = state.groups[d.name]
    if isinstance(d, NailDef):
        return _with(d, points=_points(d.points, model, group.points), goal=_goal(d, state.positions()[group.points]))
    if isinstance(d, VelocityDef):
        return _with(d, points=_points(d.points, model, group.points))
    if isinstance(d, PointsToPointDef):
        return _joined(d, model, group)
    if isinstance(d, AttachDef):
        return _attached(d, model, state, group)
    if isinstance(d, SlideDef):
        on = d.on
        if on.where is not None:
            first = model.shape(on.body).begin
            elements = state.tables.domains[group.domain].elements - first
            on = SlideOnDef(body=on.body, **{"lines" if elements.shape[1] == 2 else "triangles": elements})
        return _with(d, points=_points(d.points, model, group.points), on=on)
    raise InputError(f"constraint '{d.name}': a {type(d).__name__} cannot be assembled")


def frozen_force(d: ForceDef, model: Model, moved: set[str]) -> ForceDef:
    """The force as it is, or, where it pulls points of bodies that moved, with what it chose at the start."""
    if d.pull is None or not _named(d.pull) & moved:
        return d
    points = pulled_points(d, model.shapes, model.rest)
    goal = _goal(d.pull, model.rest[points])
    return _with(d, pull=_with(d.pull, points=_points(d.pull.points, model, points), goal=goal))


def _named(value: Any) -> set[str]:
    """Names of all bodies in a definition."""
    if isinstance(value, list):
        return set().union(*map(_named, value)) if value else set()
    if not hasattr(type(value), "model_fields"):
        return set()
    found: set[str] = set()
    for field in type(value).model_fields:
        inner = getattr(value, field)
        if field == "body":
            found.add(inner)
        elif field == "bodies":
            found |= set(inner)
        else:
            found |= _named(inner)
    return found


def _with(d: Any, **fields: Any) -> Any:
    """The same definition with other fields, validated."""
    kept = {name: getattr(d, name) for name in type(d).model_fields if name in d.model_fields_set and name != "type"}
    return type(d)(**{**kept, **fields})


def _points(selections: list[PointsDef], model: Model, chosen: np.ndarray) -> list[PointsDef]:
    """Selections by number; ``chosen``: all their points in order."""
    if all(s.given(BY_NUMBER) for s in selections):
        return selections
    body = _bodies(model, chosen)
    cuts = np.flatnonzero(np.diff(body)) + 1
    return [
        PointsDef(body=model.shapes[body[run[0]]].name, indices=chosen[run] - model.shapes[body[run[0]]].begin)
        for run in np.split(np.arange(len(chosen)), cuts)
    ]


def _bodies(model: Model, points: np.ndarray) -> np.ndarray:
    """Number of the shape of each point."""
    return np.searchsorted([shape.begin for shape in model.shapes], points, side="right") - 1


def _goal(d: NailDef | PullDef, start: np.ndarray) -> Any:
    """A goal that does not count from where the points lie at the start."""
    if d.goal is None:
        return start
    if isinstance(d.goal, KeyframesDef) and d.goal.offsets is not None:
        places = start[None] + d.goal.offsets[:, None]
        return KeyframesDef(times=d.goal.times, positions=places, interpolation=d.goal.interpolation)
    return d.goal


def _joined(d: PointsToPointDef, model: Model, group: Any) -> PointsToPointDef:
    if d.groups is not None:
        return d
    body = _bodies(model, group.points)
    refs = [
        PointRef(body=model.shapes[b].name, index=int(p - model.shapes[b].begin))
        for b, p in zip(body, group.points, strict=True)
    ]
    groups = [refs[i:j] for i, j in zip(group.offsets[:-1], group.offsets[1:], strict=True)]
    kept = {name: getattr(d, name) for name in d.model_fields_set if name not in ("zip", "join", "coincident", "type")}
    return PointsToPointDef(**{**kept, "groups": groups})


def _attached(d: AttachDef, model: Model, state: State, group: Any) -> AttachDef:
    table, first = state.tables.attach, model.shape(d.to.body).begin
    count = int(table.count.numpy()[group.rows][0])
    points = table.points.numpy()[group.rows][:, :count]
    weights = -table.weights.numpy()[group.rows][:, 1:count]
    to = AttachToDef(body=d.to.body, elements=points[:, 1:] - first)
    return _with(d, points=_points(d.points, model, points[:, 0]), to=to, weights=weights)
