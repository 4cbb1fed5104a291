"""Constraints of points as attachments, in the words of the deformables proposed for UsdPhysics.

A stiffness of inf is our exact constraint. An attachment is between two prims, so a constraint of several bodies becomes
one for each pair of them; the first carries the definition, the others say whose part they are.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnbuckle.data.groups import Group
from turnbuckle.data.model import Model
from turnbuckle.data.shape import Shape
from turnbuckle.data.state import State
from turnbuckle.io.imported import Frame
from turnbuckle.io.usd_items import ATTACHMENT, OURS, PART_OF, PREFIX
from turnbuckle.scene.definitions import AttachDef, ConstraintBase, NailDef, PointsToPointDef

with contextlib.suppress(ImportError):  # an optional extra
    from pxr import Sdf, Usd, Vt

CORNERS = {2: "line", 3: "triangle", 4: "tetrahedron"}
WORDS = {"triangle": "tri", "tetrahedron": "tet", "line": "crv"}
Arrays = dict[str, np.ndarray]


@dataclass
class Written:
    """Where the bodies of a scene are in the stage."""

    bodies: dict[str, str]  # prims of all bodies
    frames: dict[str, Frame]  # poses of the rigid ones at the start
    points: dict[str, str]  # prims whose points are those of a soft body
    vertices: dict[str, np.ndarray]  # point of a soft body -> vertex of that prim


@dataclass
class _Attachment:
    kind: str  # key of ATTACHMENT
    src0: str
    src1: str | None  # None is the world
    arrays: Arrays


def write_point_constraint(
    stage: Usd.Stage, path: str, d: ConstraintBase, model: Model, state: State, written: Written, notes: list[str]
) -> Usd.Prim:
    """Define the attachments of ``d``, the first at ``path``, and return that."""
    x, group = state.positions(), state.groups[d.name]
    made: list[_Attachment] | None = None
    if isinstance(d, NailDef):
        made = _nail(group, model, written, x)
    elif isinstance(d, AttachDef):
        made = _attach(group, model, state, written, x)
    elif isinstance(d, PointsToPointDef):
        made = _pairs(group, model, written, x)
    if not made:
        notes.append(f"constraint '{d.name}': has no counterpart in USD; it is kept for Turnbuckle")
        prim = stage.DefinePrim(path, OURS)
        _set(prim, "attachmentEnabled", Sdf.ValueTypeNames.Bool, bool(d.enabled))
        return prim
    prims = []
    for number, one in enumerate(made):
        prim = stage.DefinePrim(path if not number else f"{path}_part_{number}", ATTACHMENT[one.kind])
        _set(prim, "attachmentEnabled", Sdf.ValueTypeNames.Bool, bool(d.enabled))
        _set(prim, "stiffness", Sdf.ValueTypeNames.Float, float("inf"))
        _set(prim, "damping", Sdf.ValueTypeNames.Float, 0.0)
        if number:
            prim.CreateAttribute(PART_OF, Sdf.ValueTypeNames.String, custom=True).Set(d.name)
        for which, name in (("src0", one.src0), ("src1", one.src1)):
            target = "/World" if name is None else written.points.get(name, written.bodies[name])
            prim.CreateRelationship(f"{PREFIX}{which}", custom=False).SetTargets([Sdf.Path(target)])
        for name, values in one.arrays.items():
            if values.dtype.kind == "i":
                _set(prim, name, Sdf.ValueTypeNames.IntArray, Vt.IntArray.FromNumpy(values.astype(np.int32)))
            else:
                _set(prim, name, Sdf.ValueTypeNames.Vector3fArray, Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
        prims.append(prim)
    return prims[0]


def _set(prim: Usd.Prim, name: str, kind: Any, value: Any) -> None:
    prim.CreateAttribute(f"{PREFIX}{name}", kind, custom=False).Set(value)


def _shape_numbers(model: Model, points: np.ndarray) -> np.ndarray:
    """Number of the shape that each point is of."""
    return np.searchsorted([shape.begin for shape in model.shapes], points, side="right") - 1


def _vertices(shape: Shape, points: np.ndarray, written: Written) -> np.ndarray:
    """Points of the state as vertices of the prim of a soft body."""
    return np.asarray(written.vertices[shape.name][points - shape.begin], dtype=np.int64)


def _local(shape: Shape, places: np.ndarray, written: Written) -> np.ndarray:
    """Places in the world [m] in the frame of a body; soft bodies have that of the world."""
    frame = written.frames.get(shape.name, Frame()).inverse()
    return frame.x + frame.turn.apply(np.array(places, dtype=float))


def _nail(group: Group, model: Model, written: Written, x: np.ndarray) -> list[_Attachment] | None:
    """Points held by the world, where they are wanted at the start."""
    chosen = np.asarray(group.points).ravel()
    places = x[chosen]
    goal = getattr(group.goal, "values", None)
    if goal is not None and np.shape(goal) == places.shape:
        places = np.asarray(goal)
    found = []
    numbers = _shape_numbers(model, chosen)
    for number in np.unique(numbers):
        shape, mask = model.shapes[number], numbers == number
        if shape.name not in written.vertices:
            return None  # a point of a rigid body in the world: USD has joints for that, and ours says more
        arrays = {"vtxIndicesSrc0": _vertices(shape, chosen[mask], written), "localPositionsSrc1": places[mask]}
        found.append(_Attachment("world", shape.name, None, arrays))
    return found


def _attach(group: Group, model: Model, state: State, written: Written, x: np.ndarray) -> list[_Attachment] | None:
    """Points held in elements of another body, or at places of a rigid one."""
    table, rows = state.tables.attach, np.asarray(group.rows)
    if not len(rows):
        return None
    count = int(table.count.numpy()[rows][0])
    corners = table.points.numpy()[rows][:, :count].astype(np.int64)
    weights = -table.weights.numpy()[rows][:, 1:count]
    if count - 1 not in CORNERS:
        return None
    pairs = np.stack([_shape_numbers(model, corners[:, 0]), _shape_numbers(model, corners[:, 1])], axis=1)
    found = []
    for a, b in np.unique(pairs, axis=0):
        mask = (pairs == (a, b)).all(axis=1)
        mine, theirs = model.shapes[a], model.shapes[b]
        if mine.name not in written.vertices:
            return None
        arrays: Arrays | None = {"vtxIndicesSrc0": _vertices(mine, corners[mask, 0], written)}
        if theirs.name not in written.vertices:
            places = np.einsum("nk,nkd->nd", weights[mask], x[corners[mask, 1:]])
            arrays |= {"localPositionsSrc1": _local(theirs, places, written)}
            found.append(_Attachment("world", mine.name, theirs.name, arrays))
            continue
        inside = _elements(CORNERS[count - 1], theirs, corners[mask, 1:] - theirs.begin, weights[mask])
        if inside is None:
            return None
        found.append(_Attachment(CORNERS[count - 1], mine.name, theirs.name, arrays | inside))
    return found


def _elements(kind: str, shape: Shape, corners: np.ndarray, weights: np.ndarray) -> Arrays | None:
    """Numbers of the elements, and coordinates in the order of their corners; None for one that is not drawn."""
    elements = {"line": shape.lines, "triangle": shape.triangles, "tetrahedron": shape.tetrahedra}[kind]
    known = {tuple(sorted(e)): i for i, e in enumerate(elements.tolist())}
    numbers = np.array([known.get(tuple(sorted(row)), -1) for row in corners.tolist()], dtype=np.int64)
    if (numbers < 0).any():
        return None
    coordinates = np.zeros((len(corners), 3))
    for i, (row, weight) in enumerate(zip(corners.tolist(), weights.tolist(), strict=True)):
        by_point = dict(zip(row, weight, strict=True))
        own = [by_point[p] for p in elements[numbers[i]].tolist()][:3]
        coordinates[i, : len(own)] = own
    return {f"{WORDS[kind]}IndicesSrc1": numbers, f"{WORDS[kind]}CoordsSrc1": coordinates}


def _pairs(group: Group, model: Model, written: Written, x: np.ndarray) -> list[_Attachment] | None:
    """Points joined to one point, each as a pair with the first; a point of a rigid body is a place in its frame."""
    points, offsets = np.asarray(group.points).ravel(), np.asarray(group.offsets).ravel()
    found_pairs = [
        (points[i], points[k]) for i, j in zip(offsets[:-1], offsets[1:], strict=True) for k in range(i + 1, j)
    ]
    if not found_pairs:
        return None
    pairs = np.array(found_pairs, dtype=np.int64)
    numbers = _shape_numbers(model, pairs.ravel()).reshape(-1, 2)
    swap = [model.shapes[n].name not in written.vertices for n in numbers[:, 0]]
    pairs[swap], numbers[swap] = pairs[swap][:, ::-1], numbers[swap][:, ::-1]
    found = []
    for a, b in np.unique(numbers, axis=0):
        mask = (numbers == (a, b)).all(axis=1)
        mine, theirs = model.shapes[a], model.shapes[b]
        if mine.name not in written.vertices:
            return None  # both are rigid
        arrays = {"vtxIndicesSrc0": _vertices(mine, pairs[mask, 0], written)}
        if theirs.name in written.vertices:
            arrays["vtxIndicesSrc1"] = _vertices(theirs, pairs[mask, 1], written)
            found.append(_Attachment("point", mine.name, theirs.name, arrays))
        else:
            arrays["localPositionsSrc1"] = _local(theirs, x[pairs[mask, 1]], written)
            found.append(_Attachment("world", mine.name, theirs.name, arrays))
    return found
