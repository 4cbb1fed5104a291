"""What can be said of a scene before it runs: counts, and warnings of what will not go well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from turnbuckle.data.groups import Group
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.scene.check_contact import contact_counts, contact_warnings
from turnbuckle.scene.check_rigid import moving_mass, rigid_counts, rigid_warnings
from turnbuckle.scene.joint_limits import idle_limit_warnings
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.stability import step_warning

WEIGHT_TOLERANCE = 1e-9
FAR = 1e-3  # of the scene's size: a gap that is worth a warning
MAX_CONFLICTS = 10  # pairs of constraints named


@dataclass(frozen=True)
class Inspection:
    """Counts as (label, text), and warnings, one sentence each."""

    counts: list[tuple[str, str]]
    warnings: list[str]


def check(scene: Scene) -> list[str]:
    """Warnings, one sentence each: step too large, weights outside [0, 1], conflicts, open joints. Raises `InputError`."""
    return inspect_scene(scene).warnings


def inspect_scene(scene: Scene) -> Inspection:
    """Build a scene, count, and look for what will not go well. Raises `InputError`; simulates nothing."""
    model, state = scene.build()
    definition = scene.definition
    warnings = [*model.repairs]
    too_large = step_warning(model, state.positions(), definition.dt, definition.duration)
    warnings += [too_large] if too_large else []
    warnings += weight_warnings(state)
    warnings += conflict_warnings(list(state.groups.values()), state.follows)
    warnings += far_warnings(model, state)
    warnings += domain_warnings(state)
    warnings += idle_limit_warnings(definition)
    warnings += rigid_warnings(model, state)
    warnings += contact_warnings(model, state)
    return Inspection(counts(scene, model, state), warnings)


def counts(scene: Scene, model: Model, state: State) -> list[tuple[str, str]]:
    """What is in a scene, as (label, text)."""
    definition = scene.definition
    rows = [
        ("scene", definition.name),
        ("integrator", f"{definition.integrator}, dt = {definition.dt:g} s, duration = {definition.duration:g} s"),
        ("bodies", str(len(definition.bodies))),
        ("points", str(model.points)),
        ("springs", str(len(model.springs.pairs))),
        ("tetrahedra", str(len(model.tetrahedra.corners) + len(model.corotational.corners))),
        ("force fields", str(len(definition.forces))),
        ("mass", f"{moving_mass(model):.6g} kg"),
        *rigid_counts(model, state),
        *(contact_counts(model) if model.surfaces is not None or model.scripted else []),
    ]
    for kind in state.tables.by_kind():
        count = sum(len(group.rows) for group in state.groups.values() if group.kind == kind)
        if count:
            rows.append((f"constraints: {kind}", str(count)))
    if not state.groups and not state.joints:
        rows.append(("constraints", "0"))
    return rows


def weight_warnings(state: State) -> Iterator[str]:
    """Attachments with weights outside [0, 1]: the point is outside its element, which can swing it wide."""
    table = state.tables.attach
    weights = -table.weights.numpy()[:, 1:]  # a row is 1, -alpha_1, -alpha_2, ...
    for group in state.groups.values():
        if group.kind != "attach":
            continue
        own = weights[group.rows]
        outside = ((own < -WEIGHT_TOLERANCE) | (own > 1.0 + WEIGHT_TOLERANCE)).any(axis=1)
        if outside.any():
            worst = own[outside].ravel()
            extreme = float(worst[np.argmax(np.abs(worst - 0.5))])
            yield (
                f"constraint {group.name!r}: {int(outside.sum())} of {len(own)} points are outside their elements "
                f"(a weight of {extreme:.4g}); attach them to nearer elements"
            )


def far_warnings(model: Model, state: State) -> Iterator[str]:
    """Constraints without a ramp that start far from satisfied: they are closed in one step, like a blow."""
    x = state.positions()
    for group in state.groups.values():
        if group.ramp_steps > 0 or not group.enabled:
            continue
        ends = np.split(group.points, group.offsets[1:-1])
        if group.kind == "nail" and group.goal is not None:
            gap = np.linalg.norm(x[group.points] - group.goal.position(max(group.start, 0.0)), axis=1).max()
        elif group.kind == "points_to_point":
            gap = max(float(np.linalg.norm(np.ptp(x[p], axis=0))) for p in ends)
        elif group.kind == "attach":
            table = state.tables.attach
            points, weights = table.points.numpy()[group.rows], table.weights.numpy()[group.rows]
            gap = np.linalg.norm(np.einsum("nk,nkd->nd", weights, x[points]), axis=1).max()
        else:
            continue
        if group.start <= 0.0 and gap > FAR * model.size:
            yield (
                f"constraint {group.name!r}: starts {float(gap):.3g} m from satisfied and is closed in one step, like a blow; "
                "give it a ramp, or move its points together"
            )


def conflict_warnings(groups: list[Group], follows: np.ndarray) -> Iterator[str]:
    """Pairs of enabled constraints that hold the same point at the same time.

    ``follows`` (points,) bool: points of rigid bodies, which serve many constraints.
    """
    enabled = [group for group in groups if group.enabled and len(group.points)]
    if not enabled:
        return
    points = np.concatenate([group.points for group in enabled]).astype(np.int64)
    owners = np.repeat(np.arange(len(enabled)), [len(group.points) for group in enabled])
    order = np.lexsort((owners, points))
    order = order[~follows[points[order]]] if len(follows) else order
    points, owners = points[order], owners[order]
    shared: dict[tuple[int, int], int] = {}
    # Only points with several owners are looked at one by one.
    firsts = np.flatnonzero(np.r_[True, points[1:] != points[:-1]])
    lasts = np.r_[firsts[1:], len(points)]
    for begin, end in zip(firsts[lasts - firsts > 1], lasts[lasts - firsts > 1], strict=True):
        holders = owners[begin:end]
        for i, a in enumerate(holders):
            for b in holders[i + 1 :]:
                if _overlap(enabled[a], enabled[b]):
                    shared[int(a), int(b)] = shared.get((int(a), int(b)), 0) + 1
    for number, ((a, b), count) in enumerate(shared.items()):
        if number == MAX_CONFLICTS:
            yield f"... and {len(shared) - MAX_CONFLICTS} more pairs of constraints that share points"
            return
        names = f"{enabled[a].name!r} and {enabled[b].name!r}" if a != b else f"two parts of {enabled[a].name!r}"
        yield f"conflict: the constraints {names} hold {count} point{'s' * (count != 1)} at the same time"


def domain_warnings(state: State) -> Iterator[str]:
    """Constraints that hold points of what others slide on; only nails go together with the push of a sliding point."""
    groups = [group for group in state.groups.values() if group.enabled]
    for slide in (group for group in groups if group.kind == "slide"):
        surface = np.unique(state.tables.domains[slide.domain].elements)
        for other in groups:
            if other.kind in ("nail", "slide") or not _overlap(slide, other):
                continue
            count = int(np.isin(np.unique(other.points), surface).sum())
            if count:
                held = f"{count} point{'s' * (count != 1)} of the elements that {slide.name!r} slides on"
                yield f"conflict: the constraint {other.name!r} holds {held}"


def _overlap(a: Group, b: Group) -> bool:
    return max(a.start, b.start) < min(a.end, b.end)
