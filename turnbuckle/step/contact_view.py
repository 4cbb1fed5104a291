"""Contact forces of the last step, for looking at: where they act and how large they are. Changes nothing."""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.contact import VERTEX_FACE
from turnbuckle.step.contact_step import ContactStepper
from turnbuckle.step.step import Stepper


@dataclass(frozen=True)
class ContactForces:
    """One row a pair of features that push each other."""

    place: np.ndarray  # (n, 3) on the side of a [m]
    force: np.ndarray  # (n, 3) on a; b takes the opposite [N]
    sliding: np.ndarray  # (n,) bool


def contact_forces(stepper: Stepper | ContactStepper) -> ContactForces:
    """Forces that contacts put on their side a in the last step, impulses over its length; none where contact is off.

    Of a step that was halved, those of its last part. A pair of edges is shown at the middle of its first edge.
    """
    if not isinstance(stepper, ContactStepper) or not stepper.state.dt > 0.0:
        return ContactForces(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=bool))
    memory, surfaces = stepper.memory, stepper.surfaces
    pushes = np.flatnonzero((memory.impulse != 0.0).any(axis=1))
    kind, a, _ = (values[pushes] for values in memory.pairs())
    at_vertex = kind == VERTEX_FACE
    s = surfaces.positions(stepper.state.positions())
    place = np.zeros((len(pushes), 3))
    place[at_vertex] = s[a[at_vertex]]
    place[~at_vertex] = s[surfaces.edges[a[~at_vertex]]].mean(axis=1)
    return ContactForces(place, memory.impulse[pushes] / stepper.state.dt, memory.sliding[pushes])
