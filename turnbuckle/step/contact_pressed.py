"""Contacts that no motion can keep: what scripts press together, found before it has become paper-thin.

Rows never ask for more than the distance at the start and a slow recovery, so where a solution misses one by a part of
the distance that is kept, something with its motion prescribed takes the room.
"""

from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.data.contact import Contacts

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt

MISSED = 0.1  # of delta, by which a row is missed at the end of the step


def pressed_contacts(attempt: "Attempt") -> Contacts:
    """Contacts whose rows the last solution misses by more than solvers leave."""
    contacts, problem, solution = attempt.solved, attempt.problem, attempt.solution
    assert solution is not None
    normal = (problem.j @ solution.velocity)[::3][: contacts.count]
    missed = (problem.floor[: contacts.count] - normal - attempt.tolerance) * attempt.h
    delta = attempt.stepper.detector.deltas(contacts.kind, contacts.a, contacts.b)
    which = np.flatnonzero(missed > MISSED * delta)
    return contacts.part(which)
