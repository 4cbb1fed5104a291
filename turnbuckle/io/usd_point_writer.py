"""Constraints of points as attachments, in the words of the deformables proposed for UsdPhysics.

A stiffness of inf is our exact constraint. Indices are those of the points of the body's prim.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnbuckle.data.groups import Group
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.io.usd_items import ATTACHMENT, OURS, PREFIX
from turnbuckle.scene.definitions import AttachDef, ConstraintBase, NailDef, PointsToPointDef

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Sdf, Usd, Vt

CORNERS = {2: "line", 3: "triangle", 4: "tetrahedron"}
WORDS = {"triangle": "tri", "tetrahedron": "tet", "line": "crv"}


def write_point_constraint(
    stage: Usd.Stage,
    path: str,
    d: ConstraintBase,
    model: Model,
    state: State,
    points: Mapping[str, str],
    bodies: Mapping[str, str],
    notes: list[str],
) -> Usd.Prim:
    """Define an attachment; ``points``: prims with the points of soft bodies, ``bodies``: prims of all, by name."""
    group = state.groups[d.name]
    written: dict[str, Any] | None = None
    if isinstance(d, NailDef):
        written = _nail(group, model, state)
    elif isinstance(d, AttachDef):
        written = _attach(group, model, state)
    elif isinstance(d, PointsToPointDef):
        written = _pairs(group, model)
    prim = stage.DefinePrim(path, OURS if written is None else ATTACHMENT[written["type"]])
    _set(prim, "attachmentEnabled", Sdf.ValueTypeNames.Bool, bool(d.enabled))
    if written is None:
        notes.append(f"constraint '{d.name}': has no counterpart in USD; it is kept for Turnbuckle")
        return prim
    _set(prim, "stiffness", Sdf.ValueTypeNames.Float, float("inf"))
    _set(prim, "damping", Sdf.ValueTypeNames.Float, 0.0)
    for which, name in (("src0", written["src0"]), ("src1", written["src1"])):
        target = "/World" if name is None else points.get(name, bodies.get(name, "/World"))
        prim.CreateRelationship(f"{PREFIX}{which}", custom=False).SetTargets([Sdf.Path(target)])
    for name, values in written["arrays"].items():
        if values.dtype.kind == "i":
            _set(prim, name, Sdf.ValueTypeNames.IntArray, Vt.IntArray.FromNumpy(values.astype(np.int32)))
        else:
            _set(prim, name, Sdf.ValueTypeNames.Vector3fArray, Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
    if written.get("mixed"):
        notes.append(f"constraint '{d.name}': joins several bodies; other programs see those of the first two")
    return prim


def _set(prim: Usd.Prim, name: str, kind: Any, value: Any) -> None:
    prim.CreateAttribute(f"{PREFIX}{name}", kind, custom=False).Set(value)


def _body(model: Model, point: int) -> int:
    """Number of the shape that a point is of."""
    return int(np.searchsorted([shape.begin for shape in model.shapes], point, side="right") - 1)


def _of_one_body(model: Model, chosen: np.ndarray) -> tuple[int, np.ndarray]:
    """The first point's shape, and a mask of the points that are of it."""
    first = model.shapes[_body(model, int(chosen[0]))]
    return model.shapes.index(first), (chosen >= first.begin) & (chosen < first.end)


def _nail(group: Group, model: Model, state: State) -> dict[str, Any] | None:
    chosen = np.asarray(group.points).ravel()
    if not len(chosen):
        return None
    body, mask = _of_one_body(model, chosen)
    shape = model.shapes[body]
    places = state.positions()[chosen[mask]]
    goal = getattr(group.goal, "values", None)
    if goal is not None and np.shape(goal) == (len(chosen), 3):
        places = np.asarray(goal)[mask]
    arrays = {"vtxIndicesSrc0": chosen[mask] - shape.begin, "localPositionsSrc1": places}
    return {"type": "world", "src0": shape.name, "src1": None, "arrays": arrays, "mixed": not mask.all()}


def _attach(group: Group, model: Model, state: State) -> dict[str, Any] | None:
    table = state.tables.attach
    rows = np.asarray(group.rows)
    if not len(rows):
        return None
    count = int(table.count.numpy()[rows][0])
    corners = table.points.numpy()[rows][:, :count].astype(np.int64)
    weights = -table.weights.numpy()[rows][:, 1:count]
    if count - 1 not in CORNERS:
        return None
    kind = CORNERS[count - 1]
    body, mask = _of_one_body(model, corners[:, 0])
    other, mask1 = _of_one_body(model, corners[mask, 1])
    mine, theirs = model.shapes[body], model.shapes[other]
    chosen, weights = corners[mask][mask1], weights[mask][mask1]
    elements = {"line": theirs.lines, "triangle": theirs.triangles, "tetrahedron": theirs.tetrahedra}[kind]
    known = {tuple(sorted(e)): i for i, e in enumerate(elements.tolist())}
    numbers, coordinates = [], np.zeros((len(chosen), 3))
    for i, (row, weight) in enumerate(zip((chosen[:, 1:] - theirs.begin).tolist(), weights.tolist(), strict=True)):
        number = known.get(tuple(sorted(row)), -1)
        numbers.append(number)
        order = elements[number].tolist() if number >= 0 else row
        by_point = dict(zip(row, weight, strict=True))
        own = [by_point[p] for p in order]
        coordinates[i, : min(3, len(own))] = own[:3]
    if min(numbers) < 0:
        return None  # an element that is not drawn: its number would mean nothing
    word = WORDS[kind]
    arrays = {
        "vtxIndicesSrc0": chosen[:, 0] - mine.begin,
        f"{word}IndicesSrc1": np.array(numbers, dtype=np.int64),
        f"{word}CoordsSrc1": coordinates,
    }
    mixed = len(chosen) < len(corners)
    return {"type": kind, "src0": mine.name, "src1": theirs.name, "arrays": arrays, "mixed": mixed}


def _pairs(group: Group, model: Model) -> dict[str, Any] | None:
    """Points joined to one point, as pairs with the first of each."""
    points, offsets = np.asarray(group.points).ravel(), np.asarray(group.offsets).ravel()
    pairs = np.array(
        [(points[i], points[k]) for i, j in zip(offsets[:-1], offsets[1:], strict=True) for k in range(i + 1, j)]
    )
    if not len(pairs):
        return None
    body, mask = _of_one_body(model, pairs[:, 0])
    other, mask1 = _of_one_body(model, pairs[mask, 1])
    mine, theirs = model.shapes[body], model.shapes[other]
    chosen = pairs[mask][mask1]
    arrays = {"vtxIndicesSrc0": chosen[:, 0] - mine.begin, "vtxIndicesSrc1": chosen[:, 1] - theirs.begin}
    mixed = len(chosen) < len(pairs)
    return {"type": "point", "src0": mine.name, "src1": theirs.name, "arrays": arrays, "mixed": mixed}
