"""Adding, switching, retargeting and removing constraints, in a time that depends on the change alone.

`State.owner[i] = (group number, row)` of the constraint that holds point i, (-1, -1) without. A local pass is exact only
where no point has two owners; so switching on a constraint whose point is taken is a conflict that names both, unless
the model says ``conflicts="solve"``: then such rows are solved together (see `turnbuckle.solvers.joint`).
A point of a sliding domain may be nailed (the nail takes the push) but not held otherwise.
"""

import numpy as np
import warp as wp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from turnbuckle.data.errors import ConflictError, InputError
from turnbuckle.data.groups import Goal, Group
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.data.tables import FULL, JOINT, OFF, TIED, UNLIMITED, Joins, Table, grown, write


def reserve(state: State, kind: str, rows: int, entries: int, device: str) -> np.ndarray:
    """Numbers of ``rows`` new rows of the table ``kind``; it grows to twice its size when it is full."""
    table: Table = getattr(state.tables, kind)
    used_entries = 0
    entry_room = 0
    if isinstance(table, Joins):
        used_entries = int(table.offsets.numpy()[table.rows])
        entry_room = len(table.points)
    if table.rows + rows > len(table.phase) or used_entries + entries > entry_room > 0:
        room = max(2 * table.rows, table.rows + rows)
        entry_room = max(2 * used_entries, used_entries + entries)
        setattr(state.tables, kind, grown(table, kind, room, entry_room, device))
        table = getattr(state.tables, kind)
        state.layout += 1
    first = table.rows
    table.rows += rows
    return np.arange(first, first + rows)


def add_group(model: Model, state: State, group: Group) -> None:
    """Register a group whose rows are filled in, and write its common columns."""
    table: Table = getattr(state.tables, group.kind)
    write(table.limit, group.rows, min(group.break_force, UNLIMITED))
    write(table.ramp.paper, group.rows, group.ramp_paper)
    write(table.ramp.speed, group.rows, min(group.ramp_speed, UNLIMITED))
    state.groups[group.name] = group
    state.group_count += 1
    group.number = state.group_count
    state.layout += 1  # there may be rows of a size, or with a ramp or moving goal, that nothing was recorded for
    if group.wanted(state.time, state.dt):
        try:
            activate(model, state, group)
        except ConflictError:
            del state.groups[group.name]
            raise


def update_windows(model: Model, state: State, dt: float) -> None:
    """Switch on and off what the activation windows ask for in the step that starts now."""
    ordered = sorted(state.groups.values(), key=lambda g: g.wanted(state.time, dt))  # first off, then on
    for group in ordered:
        wanted = group.wanted(state.time, dt)
        if wanted and not group.acting:
            activate(model, state, group)
        elif group.acting and not wanted:
            deactivate(model, state, group)


def activate(model: Model, state: State, group: Group) -> None:
    """Let the unbroken rows of a group act. Raises `ConflictError` (and changes nothing) when a point is taken."""
    alive = ~group.broken
    if model.conflicts == "error":
        check_conflicts(model, state, group, alive)
    table: Table = getattr(state.tables, group.kind)
    rows = group.rows[alive]
    write(table.phase, rows, group.ramp_steps if group.ramp_steps > 0 else FULL)
    tied = tied_rows(state, group)
    if tied.any():
        _check_tied(model, group)
        write(table.phase, group.rows[alive & tied], TIED)
        state.layout += 1
    write(table.ramp.step, rows, 1)
    write(table.force, rows, 0.0)
    group.acting = True
    state.activated = True
    _hold(state, group, alive)
    if model.conflicts == "solve":
        find_joint_rows(state)
    mark_external(state)


def deactivate(model: Model, state: State, group: Group, which: np.ndarray | None = None) -> None:
    """Let the rows of a group (those of the mask ``which``, all by default) act no longer."""
    table: Table = getattr(state.tables, group.kind)
    mask = np.ones(len(group.rows), dtype=bool) if which is None else which
    write(table.phase, group.rows[mask], OFF)
    write(table.force, group.rows[mask], 0.0)
    if isinstance(table, Joins):
        offsets = table.offsets.numpy()
        write(table.point_force, _ranges(offsets[group.rows[mask]], offsets[group.rows[mask] + 1]), 0.0)
    if which is None:
        group.acting = False
    if tied_rows(state, group).any():
        state.layout += 1
    _release(state, group, mask)
    if model.conflicts == "solve":
        find_joint_rows(state)
    mark_external(state)


def switch(model: Model, state: State, name: str, on: bool) -> None:
    """Switch the group ``name`` on or off, from the next step. Raises `ConflictError` naming both when it cannot act."""
    group = find_group(state, name)
    if on and not group.acting:
        before, group.enabled = group.enabled, True
        try:
            if group.wanted(state.time, state.dt):
                activate(model, state, group)
        except ConflictError:
            group.enabled = before
            raise
    elif not on:
        group.enabled = False
        if group.acting:
            deactivate(model, state, group)
    group.enabled = on


def remove(model: Model, state: State, name: str) -> None:
    """Forget the group ``name``. Its rows stay off."""
    group = find_group(state, name)
    if group.acting:
        deactivate(model, state, group)
    del state.groups[name]


def retarget(state: State, name: str, goal: Goal, moving: bool) -> None:
    """Give a nail or velocity goal another goal from the next step on; a ramp starts anew."""
    group = find_group(state, name)
    if group.kind not in ("nail", "velocity"):
        raise InputError(f"constraint '{name}' is of type {group.kind}, which has no goal to change")
    group.goal, group.moving = goal, moving
    table = getattr(state.tables, group.kind)
    values = goal.position(state.time)
    write(table.goal, group.rows, values)
    write(table.goal_now, group.rows, values)
    if group.kind == "nail":
        write(table.rate, group.rows, 0.0)
        write(table.acceleration, group.rows, 0.0)
    if group.acting and group.ramp_steps > 0:
        alive = group.rows[~group.broken]
        write(table.phase, alive, group.ramp_steps)
        write(table.ramp.step, alive, 1)
    state.activated = state.activated or group.acting
    state.layout += 1


def find_group(state: State, name: str) -> Group:
    """The group ``name``, or a clear error."""
    if name in state.joints:
        raise InputError(f"'{name}' is a joint; a constraint on points is expected here")
    if name not in state.groups:
        known = ", ".join(sorted([*state.groups, *state.joints])) or "none"
        raise InputError(f"there is no constraint '{name}'; known are: {known}")
    return state.groups[name]


def break_rows(model: Model, state: State) -> list[str]:
    """Switch off for good the rows whose force has passed their limit (ramps excluded); names of what broke."""
    broken = []
    for group in state.groups.values():
        if not group.acting or not np.isfinite(group.break_force):
            continue
        table: Table = getattr(state.tables, group.kind)
        phase = table.phase.numpy()[group.rows]
        force = np.linalg.norm(table.force.numpy()[group.rows], axis=1)
        over = ((phase == FULL) | (phase == JOINT) | (phase == TIED)) & (force > group.break_force)
        if over.any():
            deactivate(model, state, group, over)
            group.broken |= over
            broken += [f"{group.name}[{i}]" for i in np.flatnonzero(over)]
    return broken


def check_conflicts(model: Model, state: State, group: Group, alive: np.ndarray) -> None:
    """Raise `ConflictError` when a point of the group is taken, by another constraint or twice by itself."""
    which = np.repeat(alive, np.diff(group.offsets)) & ~state.follows[group.points]
    points = group.points[which]
    row_of = np.repeat(np.arange(len(group.rows)), np.diff(group.offsets))[which]
    unique, first = np.unique(points, return_index=True)
    if len(unique) < len(points):
        second = np.setdiff1d(np.arange(len(points)), first)[0]
        before = first[np.searchsorted(unique, points[second])]
        _refuse(model, points[second], f"{group.name}[{row_of[before]}]", f"{group.name}[{row_of[second]}]")
    taken = np.flatnonzero(state.owner[points, 0] >= 0)
    if len(taken):
        number, row = state.owner[points[taken[0]]]
        _refuse(model, points[taken[0]], f"{_name(state, number)}[{row}]", f"{group.name}[{row_of[taken[0]]}]")
    if group.kind != "nail":
        crossed = np.flatnonzero(state.domain_use[points] > 0)
        if len(crossed):
            slide = next(
                g.name for g in state.groups.values()
                if g.kind == "slide" and g.acting and points[crossed[0]] in state.tables.domains[g.domain].elements
            )  # fmt: skip
            _refuse(model, points[crossed[0]], slide, f"{group.name}[{row_of[crossed[0]]}]")
    if group.kind == "slide":
        surface = np.unique(state.tables.domains[group.domain].elements)
        held = surface[(state.owner[surface, 0] >= 0) & (state.nailed.numpy()[surface] < 0)]
        if len(held):
            number, row = state.owner[held[0]]
            _refuse(model, held[0], f"{_name(state, number)}[{row}]", group.name)


def tied_rows(state: State, group: Group) -> np.ndarray:
    """Which rows of a group take points of rigid bodies (rows,) bool: they are solved with the joints."""
    if not state.follows.any() or len(group.rows) == 0:
        return np.zeros(len(group.rows), dtype=bool)
    return np.asarray(np.logical_or.reduceat(state.follows[group.points], group.offsets[:-1]))


def _check_tied(model: Model, group: Group) -> None:
    implicit = model.integrator in ("implicit_euler", "newmark")
    if model.surfaces is not None and implicit:
        return  # beside contact all rows are solved together
    if implicit or model.integrator in ("explicit_euler", "beeman"):
        raise InputError(
            f"constraint '{group.name}' takes a point of a rigid body, which integrator {model.integrator!r} cannot tie to "
            "mass points; use verlet, velocity_verlet, euler_cromer, midpoint, rk2 or rk4"
        )
    if model.response == "paper":
        raise InputError(f"constraint '{group.name}' takes a point of a rigid body: use response: exact")


def _refuse(model: Model, point: int, first: str, second: str) -> None:
    shape = next((s for s in model.shapes if s.begin <= point < s.end), None)
    where = f"point {point - shape.begin} of '{shape.name}'" if shape else f"point {point}"
    raise ConflictError(
        f"constraints '{first}' and '{second}' both hold {where}; switch one off, move one to another point, "
        "or set conflicts: solve"
    )


def _name(state: State, number: int) -> str:
    return next(g.name for g in state.groups.values() if g.number == number)


def _hold(state: State, group: Group, alive: np.ndarray, count_domain: bool = True) -> None:
    which = np.repeat(alive, np.diff(group.offsets)) & ~state.follows[group.points]  # rigid points serve many
    row_of = np.repeat(np.arange(len(group.rows)), np.diff(group.offsets))[which]
    points = group.points[which]
    tied = tied_rows(state, group)
    write(state.external, points[tied[row_of]], 1)
    state.owner[points, 0] = group.number
    state.owner[points, 1] = row_of
    if group.kind == "nail":
        write(state.nailed, points, group.rows[row_of])
    if group.kind in ("nail", "velocity"):
        write(state.external, points, 1)
    if group.kind == "slide" and count_domain:
        state.domain_use[np.unique(state.tables.domains[group.domain].elements)] += 1


def _release(state: State, group: Group, mask: np.ndarray) -> None:
    points = group.points[np.repeat(mask, np.diff(group.offsets))]
    mine = points[state.owner[points, 0] == group.number]
    state.owner[mine] = -1
    if group.kind == "nail":
        write(state.nailed, mine, -1)
    if group.kind in ("nail", "velocity"):
        write(state.external, mine, 0)
    if group.kind == "slide" and mask.all():
        state.domain_use[np.unique(state.tables.domains[group.domain].elements)] -= 1


def find_joint_rows(state: State) -> None:
    """Mark the rows that share points with others (`JOINT`), the others `FULL`; only under ``conflicts="solve"``.

    Constraints that are solved together act fully from their first step: a ramp has no meaning for one of several.
    """
    acting = [g for g in state.groups.values() if g.acting]
    uses = np.zeros(len(state.owner), dtype=np.int64)
    tied = _reached_by_ties(state, acting)
    for g in acting:
        np.add.at(uses, g.points[np.repeat(~g.broken, np.diff(g.offsets))], 1)
        if g.kind == "slide":  # may come to use any point of its domain
            uses[np.unique(state.tables.domains[g.domain].elements)] += 1
    state.owner[:] = -1
    write(state.nailed, slice(None), -1)
    write(state.external, slice(None), 0)
    for g in acting:
        _hold(state, g, ~g.broken, count_domain=False)
        table: Table = getattr(state.tables, g.kind)
        shared = np.add.reduceat(uses[g.points] > 1, g.offsets[:-1]) > 0
        held = np.logical_or.reduceat(tied[g.points], g.offsets[:-1]) | tied_rows(state, g)
        if g.kind == "slide":
            shared |= bool((uses[np.unique(state.tables.domains[g.domain].elements)] > 1).any())
        phase = table.phase.numpy()[g.rows]
        phase = np.where(phase == OFF, OFF, np.where(shared, JOINT, np.where(phase == JOINT, FULL, phase)))
        phase = np.where((phase != OFF) & held, TIED, np.where((phase == TIED) & ~held, FULL, phase))
        write(table.phase, g.rows, phase)
    state.layout += 1


def _reached_by_ties(state: State, acting: list[Group]) -> np.ndarray:
    """Mass points that hang on a rigid body through constraints that share points (points,) bool."""
    reached = np.zeros(len(state.owner), dtype=bool)
    before = -1
    while int(reached.sum()) != before:
        before = int(reached.sum())
        for g in acting:
            rows = tied_rows(state, g) | np.asarray(np.logical_or.reduceat(reached[g.points], g.offsets[:-1]))
            reached[g.points[np.repeat(rows, np.diff(g.offsets))]] = True
        reached &= ~state.follows
    return reached


def mark_external(state: State) -> None:
    """Spread ``external`` over points that constraints tie to nails: where rows share points, and under nailed slides.

    Such rows pass the push of a nail on, so they are not internal: the momentum of their points may change.
    """
    acting = [g for g in state.groups.values() if g.acting]
    linked = [g for g in acting if g.kind == "slide"]
    joint: list[tuple[np.ndarray, np.ndarray]] = []  # (row, point) pairs, rows numbered over all groups
    rows = 0
    for g in acting:
        table: Table = getattr(state.tables, g.kind)
        shared = table.phase.numpy()[g.rows] == JOINT if rows or linked or len(g.rows) else np.zeros(0, dtype=bool)
        if shared.any():
            which = np.repeat(shared, np.diff(g.offsets))
            joint.append((rows + np.repeat(np.arange(len(g.rows)), np.diff(g.offsets))[which], g.points[which]))
            rows += len(g.rows)
    for g in linked:
        points = np.union1d(g.points, np.unique(state.tables.domains[g.domain].elements))
        joint.append((np.full(len(points), rows), points))
        rows += 1
    if not joint:
        return
    row, point = (np.concatenate(parts) for parts in zip(*joint, strict=True))
    n = len(state.owner)
    graph = coo_array((np.ones(len(row)), (row, rows + point)), shape=(rows + n, rows + n))
    _, label = connected_components(graph, directed=False)
    held = state.external.numpy().copy()
    for g in acting:
        if g.kind in ("nail", "velocity"):
            held[g.points[np.repeat(~g.broken, np.diff(g.offsets))]] = 1
    reached = np.unique(label[rows + np.unique(point)][held[np.unique(point)] != 0])
    spread = np.unique(point)[np.isin(label[rows + np.unique(point)], reached)]
    write(state.external, spread, 1)


def has_joint_rows(state: State) -> bool:
    """Whether some rows are solved together."""
    return any((table.phase.numpy()[: table.rows] == JOINT).any() for table in state.tables.by_kind().values())


def _ranges(lows: np.ndarray, highs: np.ndarray) -> np.ndarray:
    lengths = highs - lows
    starts = np.repeat(lows - np.r_[0, np.cumsum(lengths)[:-1]], lengths)
    return starts + np.arange(lengths.sum())


def new_owner(points: int, device: str) -> tuple[np.ndarray, np.ndarray, wp.array, wp.array]:
    """Empty `owner`, `domain_use`, `nailed`, `external` for a state."""
    return (
        np.full((points, 2), -1, dtype=np.int64),
        np.zeros(points, dtype=np.int32),
        wp.full(points, -1, dtype=wp.int32, device=device),
        wp.zeros(points, dtype=wp.uint8, device=device),
    )
