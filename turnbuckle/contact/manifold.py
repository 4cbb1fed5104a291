"""Constraint manifold refinement (Contact, section 4): rows are added until a step crosses nothing.

A local, conservative bound of what is free is made of linear rows: those near at the start, then those of whatever the
tentative motion crosses. It knows neither of dynamics nor of solvers: give it a function that answers a set of contacts
with the end of the step, and one that finds what the way there crosses.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from turnbuckle.data.contact import VERTEX_FACE, Contacts


@dataclass
class Refined:
    """What refinement ended with."""

    contacts: Contacts  # all rows, the first ones first
    crossed: Contacts  # what the last tentative motion still crosses; none when it is clear
    rounds: int  # solutions made
    solved: bool = True  # False where no solution was found

    @property
    def clear(self) -> bool:
        """Whether there is a last tentative motion, and it crosses nothing."""
        return self.solved and self.crossed.count == 0


def joined(first: Contacts, second: Contacts) -> Contacts:
    """Both after each other."""
    names = Contacts.__dataclass_fields__
    return Contacts(*(np.concatenate([getattr(first, n), getattr(second, n)]) for n in names))


def no_contacts() -> Contacts:
    """None."""
    i, f = np.int32, np.float64
    return Contacts(
        np.zeros(0, i), np.zeros(0, i), np.zeros(0, i), np.zeros((0, 4), i), np.zeros((0, 4), f), np.zeros((0, 3), f),
        np.zeros(0, f), np.zeros(0, f),
    )  # fmt: skip


def first_met(found: Contacts) -> Contacts:
    """Of what a motion crosses, that which each vertex and each edge meets first.

    A vertex that goes through a body meets its front before its back, and a row for the back would hold it inside. What is
    left out and still in the way is found in the next round.
    """
    rows = np.arange(found.count)
    edges = rows[found.kind != VERTEX_FACE]
    row = np.concatenate([rows, edges])  # as a vertex or the first edge, then as the second edge
    place = np.concatenate([found.a, found.b[edges]])
    order = np.lexsort((row, found.time[row], place, found.kind[row]))
    place, kind = place[order], found.kind[row[order]]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (place[1:] != place[:-1]) | (kind[1:] != kind[:-1])
    return found.part(np.unique(row[order[first]]))


def refine(
    contacts: Contacts,
    solve: Callable[[Contacts], np.ndarray | None],
    crossed: Callable[[np.ndarray], Contacts | None],
    rounds: int = 5,
    choose: Callable[[Contacts], Contacts] = first_met,
) -> Refined:
    """Refine ``contacts`` until the motion that ``solve`` answers them with crosses nothing, at most ``rounds`` times.

    ``solve(contacts)`` gives positions (s, 3) [m] of the surface vertices at the end of the step, or None where it finds
    none (refinement ends, not clear); ``crossed(x1)`` what the straight way there comes too near to, or None where there
    is no motion after all; ``choose`` which of these become rows, at least one.
    """
    found = no_contacts()
    for n in range(1, rounds + 1):
        x1 = solve(contacts)
        if x1 is None:
            return Refined(contacts, contacts, n, False)
        found = crossed(x1)
        if found is None:
            return Refined(contacts, contacts, n, False)
        if found.count == 0:
            return Refined(contacts, found, n)
        if n < rounds:
            contacts = joined(contacts, choose(found))
    return Refined(contacts, found, rounds)
