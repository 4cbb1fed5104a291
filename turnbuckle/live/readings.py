"""What constraints, joints and contacts tell at the committed state, for lists and marks."""

from dataclasses import replace

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.errors import TurnbuckleError
from turnbuckle.data.rigid import Joint
from turnbuckle.data.tables import Joins
from turnbuckle.geometry.quaternions import multiply, rotate
from turnbuckle.live.frame import Arrows, Marks, Reading
from turnbuckle.step.contact_view import contact_forces
from turnbuckle.step.reactions import reactions
from turnbuckle.step.simulation import Simulation

WITH_AXES = (rigid.SEGMENT, rigid.MOTOR_AXIAL, rigid.MOTOR_TWIST, rigid.TWIST, rigid.ANGLE, rigid.RING, rigid.ROLLING)
AXIS = 0.04  # of the scene's size: how long the axis of a joint is drawn


def read_constraints(
    simulation: Simulation, before: tuple[Reading, ...] = (), changed: bool = False
) -> tuple[Reading, ...]:
    """One reading a group and joint, in the order of the state.

    ``changed``: constraints were added or removed since the last step, so the arrays that joints are measured with do not
    fit until the next one; those of ``before`` are told again.
    """
    state = simulation.state
    out = []
    for name, group in state.groups.items():
        table = getattr(state.tables, group.kind)
        force = table.point_force if isinstance(table, Joins) else table.force
        values = force.numpy()
        if isinstance(table, Joins):
            offsets = table.offsets.numpy()
            first, last = int(offsets[group.rows[0]]), int(offsets[group.rows[-1] + 1])
            values = values[first:last]
        else:
            values = values[group.rows]
        squared = table.position_residual.numpy()[group.rows]
        if group.kind == "velocity":
            squared = table.rate_residual.numpy()[group.rows]
        out.append(
            Reading(
                name, group.kind, group.enabled, group.acting, int(group.broken.sum()), len(group.rows),
                residual=float(np.sqrt(squared.max(initial=0.0))) if group.acting else 0.0,
                force=float(np.sqrt((values**2).sum(axis=1).max(initial=0.0))) if group.acting else 0.0,
            )
        )  # fmt: skip
    if state.joints:
        if changed:
            known = {r.name: r for r in before}
            for name, joint in state.joints.items():
                new = Reading(name, joint.kind, joint.enabled, False, int(joint.broken), 1, 0.0, 0.0)
                out.append(replace(known.get(name, new), on=joint.enabled))
        else:
            out += _read_joints(simulation)
    return tuple(out)


def _read_joints(simulation: Simulation) -> list[Reading]:
    state = simulation.state
    gap, angle = simulation.stepper.articulated.residuals()[:2]
    force, turn = np.zeros((state.parts.count, 3)), np.zeros((state.parts.count, 3))
    if state.steps > 0:
        try:
            force, turn = reactions(simulation.model, state, simulation.stepper.articulated)
        except (TurnbuckleError, np.linalg.LinAlgError):
            pass  # a state without reactions, such as one that flies apart
    out = []
    for name, joint in state.joints.items():
        p = joint.parts
        read = Reading(name, joint.kind, joint.enabled, joint.acting, int(joint.broken), 1, 0.0, 0.0)
        if joint.acting and len(p):
            residual = max(float(gap[p].max()), float(angle[p].max()))
            f, t = (float(np.linalg.norm(values[p].sum(axis=0))) for values in (force, turn))
            read = replace(read, residual=residual, force=f, torque=t)
        out.append(read)
    return out


def read_marks(simulation: Simulation, readings: tuple[Reading, ...]) -> Marks:
    """Where they act: the points of groups, the places of joints, and axes of joints that have one."""
    state = simulation.state
    x = state.positions()
    number = {r.name: i for i, r in enumerate(readings)}
    places, of = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for name, group in state.groups.items():
        if name in number:
            places.append(x[group.points])
            of.append(np.full(len(group.points), number[name]))
    axes, axis_of = [np.zeros((0, 2, 3))], [np.zeros(0, np.int64)]
    known = [(n, j) for n, j in state.joints.items() if n in number and len(j.parts)]
    if known:
        bx, bq = state.rigid.x.numpy(), state.rigid.q.numpy()
        for name, joint in known:
            ends, lines = _joint_marks(simulation, joint, bx, bq)
            places.append(ends)
            of.append(np.full(len(ends), number[name]))
            axes.append(lines)
            axis_of.append(np.full(len(lines), number[name]))
    return Marks(np.concatenate(places), np.concatenate(of), np.concatenate(axes), np.concatenate(axis_of))


def _joint_marks(simulation: Simulation, joint: Joint, x: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of the first part of a joint (2, 3), and its axes with the line between the ends (k, 2, 3)."""
    parts, p = simulation.state.parts, joint.parts
    a, b = parts.a[p], parts.b[p]
    end_a = x[a] + rotate(q[a], parts.p_a[p])
    end_b = x[b] + rotate(q[b], parts.p_b[p])
    ends = np.stack([end_a[0], end_b[0]])
    lines = [np.stack([end_a[:1], end_b[:1]], axis=1)]
    axial = np.isin(parts.kind[p], WITH_AXES)
    if axial.any():
        first = int(np.argmax(axial))
        z = rotate(multiply(q[b[[first]]], parts.q_b[p[[first]]]), np.array([[0.0, 0.0, 1.0]]))
        half = AXIS * simulation.model.size * z
        lines.append(np.stack([end_a[[first]] - half, end_a[[first]] + half], axis=1))
    return ends, np.concatenate(lines)


def read_contacts(simulation: Simulation) -> Arrows:
    """Contact forces of the last step."""
    found = contact_forces(simulation.stepper)
    return Arrows(found.place, found.force)
