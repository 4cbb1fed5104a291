"""Contacts that impulses can do something about: those between nails and what is scripted are left to detection.

A row whose blocks are all prescribed has no response. What a script presses there is found as a motion that crosses, halved,
and named when no zone can follow it.
"""

from typing import TYPE_CHECKING

from turnbuckle.data.contact import Contacts

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt


class Pushable:
    """What moves freely in one attempt."""

    def __init__(self, attempt: "Attempt") -> None:
        stepper = attempt.stepper
        fixed = attempt.prescribed.fixed
        self.every = not (fixed & ~stepper.dynamics.never).any()  # no nails: one side of a pair is always free
        if not self.every:
            surfaces = stepper.surfaces
            held = fixed[stepper.dynamics.block_of(surfaces.support)] | (surfaces.weights == 0.0)
            self.held = held.all(axis=1)

    def of(self, contacts: Contacts) -> Contacts:
        """Those of which a vertex is free."""
        if self.every or contacts.count == 0:
            return contacts
        free = ((contacts.coefficients != 0.0) & ~self.held[contacts.vertices]).any(axis=1)
        if free.all():
            return contacts
        return Contacts(*(getattr(contacts, name)[free] for name in Contacts.__dataclass_fields__))
