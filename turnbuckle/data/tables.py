"""The tables of constraints: one row a constraint, one table a kind.

Rows are switched, retargeted, added and removed between two steps in a time that depends on the change alone: tables
have spare capacity, and switching is a write into ``phase``.
"""

from dataclasses import dataclass, field, fields

import numpy as np
import warp as wp

# Phases of a row: n > 0 is gradual activation over n steps (Local, 4.5).
FULL = 0  # acts fully
OFF = -1  # does not act
JOINT = -2  # acts fully, and shares points with others: solved together with them (solvers/joint.py)
TIED = -3  # acts fully, and takes points of rigid bodies: solved with the joints (solvers/equality.py)
UNLIMITED = 1e300
ENTRIES = 5  # points in an attachment or slide at most: the point itself and four of a tetrahedron


@dataclass
class Ramp:
    """Gradual activation of each row."""

    step: wp.array  # int32, j of the next step, from 1
    paper: wp.array  # uint8, 1: the paper's j/n of the force; 0: the closing fraction 1/(n-j+1) of the gap
    speed: wp.array  # float64 [m/s], bound on the closing speed


@dataclass
class Table:
    """Columns that every kind has."""

    rows: int  # rows in use (also those switched off); the arrays may be longer
    phase: wp.array  # (capacity,) int32: OFF, FULL, or the n of gradual activation
    ramp: Ramp
    limit: wp.array  # (capacity,) float64, breaks above this force [N]
    force: wp.array  # (capacity,) vec3d [N]: on the point (nail, velocity), on the first point (attach, slide)
    position_residual: wp.array  # (capacity,) float64, SQUARED [m^2], of the committed state, fully active rows
    rate_residual: wp.array  # (capacity,) float64, SQUARED [m^2/s^2]


@dataclass
class Nails(Table):
    """A point at a goal (Local, 4.1)."""

    point: wp.array  # int32
    goal: wp.array  # vec3d [m], at the end of the step
    goal_now: wp.array  # vec3d [m], at its start
    rate: wp.array  # vec3d [m/s], of the goal at the end of the step
    acceleration: wp.array  # vec3d [m/s^2], of the goal at its start


@dataclass
class Joins(Table):
    """n points at one place (Local, 4.2)."""

    offsets: wp.array  # (capacity + 1,) int32 into `points`
    points: wp.array  # (entries,) int32
    point_force: wp.array  # (entries,) vec3d [N]; `force` holds the one of the first point


@dataclass
class Attachments(Table):
    """A point at fixed weights of the points of a line, triangle or tetrahedron (Local, 4.3)."""

    count: wp.array  # int32, points used
    points: wp.array  # (capacity, ENTRIES) int32
    weights: wp.array  # (capacity, ENTRIES) float64: 1, -alpha_1, -alpha_2, ...


@dataclass
class Slides(Attachments):
    """A point that slides on lines or triangles (Local, 4.4); points and weights are found anew each step."""

    domain: wp.array  # int32, which domain the row slides on
    element: wp.array  # int32, the element of the domain where it is, -1 when not known
    directions: wp.array  # mat33d, projector on the directions that are held
    normal: wp.array  # vec3d, the held direction after the last step where it was one only, else 0


@dataclass
class Velocities(Table):
    """A point with a wanted velocity (Local, section 4)."""

    point: wp.array  # int32
    goal: wp.array  # vec3d [m/s], at the end of the step
    goal_now: wp.array  # vec3d [m/s], at its start


@dataclass
class Domain:
    """What a point slides on: segments or triangles of one body."""

    name: str
    elements: np.ndarray  # (n, 2) or (n, 3) int32 points
    rim: np.ndarray  # (n,) int32: bit k is set when edge k (opposite of corner k) / end k bounds the domain


@dataclass
class Tables:
    """All constraints of a state."""

    nail: Nails
    points_to_point: Joins
    attach: Attachments
    slide: Slides
    velocity: Velocities
    domains: list[Domain] = field(default_factory=list)

    def by_kind(self) -> dict[str, Table]:
        """The tables by the names of their kinds."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "domains"}


def _array(kind: object, shape: object, device: str) -> wp.array:
    return wp.zeros(shape, dtype=kind, device=device)


def empty_table(kind: str, capacity: int, device: str, entries: int = 0) -> Table:
    """A table of ``kind`` with no row in use, all rows off. ``entries``: points of all points-to-point rows together."""
    n = max(capacity, 1)
    f64, i32, vec3 = wp.float64, wp.int32, wp.vec3d
    common = {
        "rows": 0,
        "phase": wp.full(n, -1, dtype=i32, device=device),
        "ramp": Ramp(
            _array(i32, n, device), _array(wp.uint8, n, device), wp.full(n, UNLIMITED, dtype=f64, device=device)
        ),
        "limit": wp.full(n, UNLIMITED, dtype=f64, device=device),
        "force": _array(vec3, n, device),
        "position_residual": _array(f64, n, device),
        "rate_residual": _array(f64, n, device),
    }
    point = {"point": _array(i32, n, device), "goal": _array(vec3, n, device), "goal_now": _array(vec3, n, device)}
    placed = {
        "count": _array(i32, n, device),
        "points": _array(i32, (n, ENTRIES), device),
        "weights": _array(f64, (n, ENTRIES), device),
    }
    if kind == "nail":
        return Nails(**common, **point, rate=_array(vec3, n, device), acceleration=_array(vec3, n, device))
    if kind == "velocity":
        return Velocities(**common, **point)
    if kind == "points_to_point":
        e = max(entries, 1)
        return Joins(
            **common,
            offsets=_array(i32, n + 1, device),
            points=_array(i32, e, device),
            point_force=_array(vec3, e, device),
        )
    if kind == "attach":
        return Attachments(**common, **placed)
    if kind == "slide":
        return Slides(
            **common,
            **placed,
            domain=_array(i32, n, device),
            element=wp.full(n, -1, dtype=i32, device=device),
            directions=_array(wp.mat33d, n, device),
            normal=_array(vec3, n, device),
        )
    raise ValueError(f"unknown kind of constraint: {kind}")


def grown(table: Table, kind: str, rows: int, entries: int, device: str) -> Table:
    """A table with room for ``rows`` rows (and entries), holding what ``table`` holds."""
    new = empty_table(kind, rows, device, entries)
    new.rows = table.rows
    for old_columns, new_columns in ((table, new), (table.ramp, new.ramp)):
        for column in fields(old_columns):
            old = getattr(old_columns, column.name)
            if isinstance(old, wp.array):
                wp.copy(
                    getattr(new_columns, column.name), old, count=old.shape[0] * (old.shape[1] if old.ndim > 1 else 1)
                )
    return new


def write(array: wp.array, rows: np.ndarray, values: object) -> None:
    """``array[rows] = values`` from the host."""
    if array.device.is_cpu:
        array.numpy()[rows] = values
    else:
        host = array.numpy()
        host[rows] = values
        array.assign(host)
