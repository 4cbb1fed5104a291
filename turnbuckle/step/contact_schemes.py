"""Schemes beside contact: what each makes of the dynamics of one step (Contact, 3.1), in one common form.

The unknown of every contact problem is the mean velocity of the step, ``u = (x1 - x0) / h`` (of a rigid body with the
turn that leads from q0 to q1, over h). A scheme gives ``A (u - base) = load + J^T r + E^T l`` about an iterate, and the
velocities that end the step.

* Backward Euler: u is the velocity at the end, ``A = M - h D - h^2 K``. About an iterate u^k, Newton's method on
  ``M (u - v0) = h F(x0 + h u, u)`` has ``base = u^k, load = M (v0 - u^k) + h F(x^k, u^k)``; K and D at the iterate.
* Newmark (average acceleration): with ``v1 = 2 u - v0``, ``M (u - v0) = h / 4 (F(x0, v0) + F(x1, v1))``, so
  ``A = M - h / 2 D - h^2 / 4 K``. First without contact, which gives u*; then the response of the same step to contact.
* Explicit schemes make their step without contact, u* and v*, as they do where contact is off; then ``A = M``.

Where u is not the velocity at the end, that is ``v1 = v* + (u - u*)``, then put on what touches (`contact_velocities`).
"""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from turnbuckle.contact.manifold import no_contacts

if TYPE_CHECKING:
    from turnbuckle.step.contact_attempt import Attempt
    from turnbuckle.step.contact_step import ContactStepper

TRAPEZOID = 2  # Newton iterations of Newmark at least: of order 2 with stiffness matrices that are not exact, too


class ContactScheme(ABC):
    """How the dynamics of an attempt are made."""

    alpha = beta = 1.0  # of `turnbuckle.bodies.implicit_system`
    share = 0.5  # at rest, part of a contact's impulse that moves; the rest is for velocities at the end
    may_gain = False  # energy, where it is linearised from afar
    exact_balance = False  # the state's dissipation is what is missing of its energy
    started: float | None = None  # [J] what there was when the step began, where it is not
    fine = True  # contact is solved to a part of what gravity does in a step, however slow that is

    def __init__(self, stepper: "ContactStepper") -> None:
        self.stepper = stepper

    @abstractmethod
    def begin(self, attempt: "Attempt") -> bool:
        """Make ``a, base, load, given`` of the attempt for its first solve; False where that needs a smaller step."""

    def again(self, attempt: "Attempt") -> bool:
        """Make them anew about the motion of the attempt; False where there is nothing to gain."""
        return False

    @property
    def iterations(self) -> int:
        """Newton iterations with contact."""
        return 1

    def take_back(self, attempt: "Attempt") -> None:  # noqa: B027
        """Undo what `begin` did to the state."""

    def end(self, attempt: "Attempt", u: np.ndarray) -> np.ndarray | None:
        """Velocities (n, 3) at the end without what touches being asked; None where ``u`` (n, 3) is the velocity at the end."""
        return None


class BackwardEuler(ContactScheme):
    """``M (v1 - v0) = h F(x1, v1)``, x1 = x0 + h v1; by default one Newton iteration (3). Force fields at the start."""

    fine = False
    share = 1.0
    may_gain = exact_balance = True

    @property
    def iterations(self) -> int:
        return self.stepper.options.newton + self.stepper.more

    def begin(self, attempt: "Attempt") -> bool:
        dynamics, h = self.stepper.dynamics, attempt.h
        attempt.a = dynamics.refresh(h)
        attempt.energy0, attempt.handed = self._energy(attempt)
        load = dynamics.system.right_side(h).reshape(-1, 3)
        attempt.given = h * dynamics.pushes(attempt.x0, attempt.v0, dynamics.bx0, dynamics.q0, attempt.time0)
        if dynamics.dynamic.any():
            load[dynamics.points + 1 :: 2] += dynamics.turned(h)
        self._finish(attempt, load + attempt.given)
        self.first = _own_blocks(attempt.a, dynamics.points), attempt.base.copy(), attempt.load.copy()
        return True

    def _energy(self, attempt: "Attempt") -> tuple[float, float]:
        """Energy at the start [J], and what prescribed points are given at once: their speed changes from step to step."""
        dynamics = self.stepper.dynamics
        v = dynamics.velocities()
        start = dynamics.energy(v, attempt.x0, dynamics.bx0, dynamics.q0) + self.stepper.joints.elastic_energy()
        p = dynamics.points
        mass = np.maximum(self.stepper.model.mass, 0.0)
        return start, float(mass @ np.einsum("ij,ij->i", attempt.v0[:p] - v[:p], attempt.v0[:p]))

    def _finish(self, attempt: "Attempt", load: np.ndarray) -> None:
        load[self.stepper.dynamics.never] = 0.0
        attempt.load = load
        attempt.base = attempt.v0

    def again(self, attempt: "Attempt") -> bool:
        dynamics, h = self.stepper.dynamics, attempt.h
        p, v = dynamics.points, attempt.v
        attempt.a = dynamics.again(attempt.x1, v[:p], h)
        rigid, base, load = self.first  # linear: its rows about the iterate
        left = load.copy()
        left[p:] -= np.einsum("bij,bj->bi", rigid, (v - base)[p:])
        mass = np.maximum(self.stepper.model.mass, 0.0)[:, None]
        left[:p] = mass * (attempt.v0[:p] - v[:p]) + h * dynamics.system.force[:p] + attempt.given[:p]
        left[dynamics.never] = 0.0
        attempt.load, attempt.base = left, v.copy()
        return True


class Newmark(ContactScheme):
    """Average acceleration, linearised about the free motion of the same step where it meets contact."""

    alpha, beta = 0.5, 0.25
    may_gain = True

    @property
    def iterations(self) -> int:
        return self.stepper.options.newton

    def begin(self, attempt: "Attempt") -> bool:
        dynamics, h, p = self.stepper.dynamics, attempt.h, self.stepper.dynamics.points
        attempt.energy0 = None
        attempt.a = dynamics.refresh(h)
        if self.started is None:  # the first part of a step that was halved
            self.started = dynamics.energy(dynamics.velocities(), attempt.x0, dynamics.bx0, dynamics.q0)
        force = dynamics.system.force.copy()
        self.pushes = dynamics.pushes(attempt.x0, attempt.v0, dynamics.bx0, dynamics.q0, attempt.time0)
        self.turned = dynamics.turned(0.5 * h)
        attempt.given = h * self.pushes
        load = 0.5 * h * (force + self.pushes) + 0.25 * h * h * dynamics.system.push
        load[p + 1 :: 2] += self.turned
        load[dynamics.never] = 0.0
        attempt.base, attempt.load = attempt.v0, load
        self.force, self.rigid, self.base = force, _own_blocks(attempt.a, p), attempt.v0.copy()
        self.rigid_load = load[p:] - 0.5 * h * self.pushes[p:]
        rough, attempt.rough = attempt.rough, False
        for k in range(max(TRAPEZOID, self.iterations)):
            if k > 0:
                self.again(attempt)
                attempt.renewed()
            if attempt.solve(no_contacts()) is None:
                return False
        attempt.rough = rough
        self.free, self.q = attempt.v.copy(), attempt.q1.copy()
        self.again(attempt)
        attempt.renewed()
        return True

    def again(self, attempt: "Attempt") -> bool:
        dynamics, h, p = self.stepper.dynamics, attempt.h, self.stepper.dynamics.points
        u = attempt.v
        v = np.where(attempt.prescribed.fixed[:, None], u, 2.0 * u - attempt.v0)
        attempt.a = dynamics.again(attempt.x1, v[:p], h)
        pushes = 0.5 * (self.pushes + dynamics.pushes(attempt.x1, v, attempt.bx1, attempt.q1, attempt.time0 + h))
        attempt.given = h * pushes
        mass = np.maximum(self.stepper.model.mass, 0.0)[:, None]
        load = np.zeros_like(u)
        load[:p] = mass * (attempt.v0[:p] - u[:p]) + 0.25 * h * (self.force + dynamics.system.force)[:p]
        load[p:] = self.rigid_load - np.einsum("bij,bj->bi", self.rigid, (u - self.base)[p:])
        load += 0.5 * h * pushes
        load[dynamics.never] = 0.0
        attempt.load, attempt.base = load, u.copy()
        return True

    def end(self, attempt: "Attempt", u: np.ndarray) -> np.ndarray:
        """``v* + (u - u*)``; v* of a turning body from its angular momentum, so that the order stays 2."""
        dynamics, p = self.stepper.dynamics, self.stepper.dynamics.points
        moves = dynamics.dynamic
        star = 2.0 * self.free - attempt.v0
        if moves.any():
            before, after = dynamics.inertias(dynamics.q0)[moves], dynamics.inertias(self.q)[moves]
            w0, w = attempt.v0[p + 1 :: 2][moves], self.free[p + 1 :: 2][moves]
            momentum = np.einsum("bij,bj->bi", before, 2.0 * w - w0) - 2.0 * self.turned[moves]
            star[p + 1 + 2 * np.flatnonzero(moves)] = np.linalg.solve(after, momentum[:, :, None])[:, :, 0]
        v = star + u - self.free
        fixed = attempt.prescribed.fixed
        v[fixed] = attempt.prescribed.velocity[fixed]
        if attempt.nails is not None:
            v[attempt.nails.weights.indices] = attempt.nails.rate
        return v


def _own_blocks(a: sp.bsr_array, first: int) -> np.ndarray:
    """The diagonal blocks of rigid bodies, the only ones in their rows."""
    return np.array(a.data[a.indptr[first] :])
