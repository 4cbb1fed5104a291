"""Velocities that end a step, put on what touches: RATTLE's second multiplier (Andersen 1983) for contacts.

Where the mean velocity u of a step is not the velocity at its end, a body that rests would show one: ``v* + (u - u*)`` of
Newmark alternates. So contacts that push in the step, or end it at their distance, keep what touches from approaching at its end, too, with friction of
their own (Moreau's impacts, without restitution), and equality rows hold at the level of velocities.

Rows that let apart what is too near move it, but must not throw it (split impulses, the pseudo-velocities of rigid body
engines): the same problem, with no row that asks for more than not to approach, gives u for the velocity.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from turnbuckle.data.articulated import AT, EQUAL
from turnbuckle.data.contact import ContactProblem
from turnbuckle.step.contact_equality import point_rows
from turnbuckle.step.contact_joint_looks import look_up
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.contact_limits import stacked
from turnbuckle.step.contact_rows import contact_rows

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt


def end_velocities(attempt: "Attempt", u: np.ndarray) -> np.ndarray:
    """Velocities of all blocks (n, 3) at the end of the step, ``u`` those of the step `without_recovery`."""
    stepper = attempt.stepper
    attempt.kept_velocity = u
    ahead = stepper.dynamics_of.end(attempt, u)
    ahead = u if ahead is None else _on_contacts(attempt, ahead)
    return stepper.joints.project(ahead, attempt.bx1, attempt.q1)


def without_recovery(attempt: "Attempt") -> tuple[np.ndarray, np.ndarray]:
    """Velocities (n, 3) of the step less what only lets bodies apart, and impulses; the solution where that is nothing.

    What counts is the speed that rows ask for, in the mean over impulses: less than the tolerance is lost in it.
    """
    stepper, problem, solution = attempt.stepper, attempt.problem, attempt.solution
    assert solution is not None
    push = np.maximum(solution.impulse[:, 0], 0.0)
    asked = np.maximum(problem.floor, 0.0)
    if not push @ asked > attempt.tolerance * push.sum():
        return attempt.v, solution.impulse
    lowered = replace(problem, floor=np.minimum(problem.floor, 0.0))
    with stepper.timed("contact_solve"):
        found = stepper.solver.solve(
            lowered, solution.impulse, attempt.v.ravel(), attempt.tolerance, stepper.options.max_iterations
        )
    if not (found.converged and np.isfinite(found.velocity).all()):
        return attempt.v, solution.impulse
    return found.velocity.reshape(-1, 3), found.impulse


def _on_contacts(attempt: "Attempt", ahead: np.ndarray) -> np.ndarray:
    stepper = attempt.stepper
    assert attempt.solution is not None
    push = attempt.touching()
    e, wanted = _rows(attempt)
    if not push.any() and (e is None or e.shape[0] == 0):
        return ahead
    contacts = attempt.solved
    arms = stepper.dynamics.arms_of(attempt.x1, attempt.bx1)
    j = contact_rows(stepper.surfaces, contacts, attempt.frame[: contacts.count], arms, stepper.map)
    others, _ = attempt.other_rows(arms)
    j = stacked([j, *others]) if others else j
    touching = np.flatnonzero(push)
    problem = ContactProblem(
        a=attempt.a, free=ahead.ravel(), j=_blocks(j, touching), floor=np.zeros(len(touching)),
        friction=attempt.problem.friction[touching], e=e, wanted=wanted, pairs=stepper.dynamics.pairs,
        fixed=attempt.prescribed.fixed,
    )  # fmt: skip
    with stepper.timed("contact_solve"):
        found = stepper.solver.solve(problem, None, None, attempt.tolerance, stepper.options.max_iterations)
    if not np.isfinite(found.velocity).all():
        return ahead
    attempt.kept_impulse = attempt.kept_impulse.copy()
    attempt.kept_impulse[touching] += found.impulse
    return found.velocity.reshape(-1, 3)


def _blocks(j: sp.bsr_array, rows: np.ndarray) -> sp.bsr_array:
    """Some block rows of J."""
    counts = np.diff(j.indptr)[rows]
    first = np.repeat(j.indptr[rows] - np.r_[0, np.cumsum(counts)[:-1]], counts) if len(rows) else np.zeros(0, int)
    take = first + np.arange(int(counts.sum()))
    indptr = np.r_[0, np.cumsum(counts)].astype(np.int32)
    return sp.bsr_array((j.data[take], j.indices[take], indptr), shape=(3 * len(rows), j.shape[1]))


def _rows(attempt: "Attempt") -> tuple[sp.csr_array | None, np.ndarray]:
    """Equality rows on velocities at the end, and what they ask for."""
    closing, stepper = attempt.closing, attempt.stepper
    e, wanted = [], []
    if closing.points is not None:
        arms = stepper.dynamics.arms_of(attempt.x1, attempt.bx1)
        rows = point_rows(stepper.state, closing.points, attempt.h, attempt.x1, arms, stepper.map).e
        assert rows is not None
        e.append(rows)
        wanted.append(np.einsum("rij,rj->ri", closing.held, closing.points.rate).ravel()[closing.kept])
    joints = _joint_rows(stepper.joints, attempt.bx1, attempt.q1)
    if joints is not None:
        e.append(joints)
        wanted.append(np.zeros(joints.shape[0]))
    if not e:
        return None, np.zeros(0)
    return sp.vstack(e).tocsr(), np.concatenate(wanted)


def _joint_rows(joints: ContactJoints, x: np.ndarray, q: np.ndarray) -> sp.csr_array | None:
    """Strict rows of joints at the end of the step (`ContactJoints.project`)."""
    part, k = np.nonzero((joints.modes == EQUAL) | (joints.modes == AT))
    if not joints.exists or not len(part):
        return None
    end = joints.geometry.rows(x, q)
    if len(joints.looks):
        now = look_up(joints.state, joints.looks, joints.geometry.local(x, q))
        end.force[joints.looks] = joints.geometry.to_world(now.directions, q, joints.looks)
    return joints.geometry.jacobian(end, x, part, k, joints.points, joints.blocks)
