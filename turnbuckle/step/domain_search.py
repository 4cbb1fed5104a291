"""Looking up curves, surfaces and user domains: where the nearest permissible point is, and what is held there (4.1.3).

The solver closes ``n.(P - P') = 0`` for given P' and n; looking again from where it has put P, and closing again, converges
like Newton's method. As for all rows, impulses of the flight act along the mean of the held directions at both ends of the step
(`integrators/rigid_flight.py`), those of the velocity stage along the directions at its end.
"""

import numpy as np
import warp as wp

from turnbuckle.data import rigid
from turnbuckle.data.articulated import EQUAL, LIMIT, NONE
from turnbuckle.data.rigid import ROWS, RigidState
from turnbuckle.data.state import State
from turnbuckle.geometry.domains import Held
from turnbuckle.geometry.quaternions import conjugate, multiply, rotate
from turnbuckle.integrators.rigid_flight import close_positions
from turnbuckle.step.articulated_system import System

LOOKS = 40  # in a step at most
SETTLED = 2e-13  # [m] that a point may still be off its domain
NOTHING_HELD = Held(np.zeros((1, 3)), np.eye(3)[None], np.zeros(1, int), np.zeros((1, 3), bool))


class DomainSearch:
    """The parts of a system that are on domains; `parts` is 0 where there are none."""

    def __init__(self, state: State, system: System) -> None:
        self.state, self.system = state, system
        kinds = (rigid.CURVE, rigid.SURFACE, rigid.CALLABLE)
        self.numbers = np.flatnonzero(np.isin(state.parts.kind, kinds))
        self.parts = len(self.numbers)
        self.origin = state.parts.p_b[self.numbers].copy()

    def _local(self, at: RigidState) -> np.ndarray:
        """The points in the frames of their domains (k, 3)."""
        parts, k = self.state.parts, self.numbers
        x, q = at.x.numpy(), at.q.numpy()
        a, b = parts.a[k], parts.b[k]
        d = x[a] + rotate(q[a], parts.p_a[k]) - x[b] - rotate(q[b], self.origin)
        return rotate(conjugate(multiply(q[b], parts.q_b[k])), d)

    def _held(self, p: np.ndarray) -> list[Held]:
        on = self._on()
        return [
            self.state.domains[self.state.parts.domain[k]].held(p[i : i + 1]) if on[i] else NOTHING_HELD
            for i, k in enumerate(self.numbers)
        ]

    def _on(self) -> np.ndarray:
        """Which of the parts act (k,) bool."""
        return self.system.switches(self.state)[self.numbers] > 0

    def residuals(self, at: RigidState) -> np.ndarray:
        """Distances of the points from their domains (k,) [m]; 0 for joints that are off."""
        p = self._local(at)
        on = self._on()
        near = [
            self.state.domains[self.state.parts.domain[k]].nearest(p[i : i + 1])[0] if on[i] else p[i]
            for i, k in enumerate(self.numbers)
        ]
        return np.linalg.norm(p - np.array(near), axis=1)

    def rates(self, at: RigidState) -> np.ndarray:
        """Speeds of the points along what a fresh look holds of them, where limits are held out of the domain only (k,) [m/s]."""
        parts, k = self.state.parts, self.numbers
        x, q, v, w = (getattr(at, name).numpy() for name in "xqvw")
        a, b = parts.a[k], parts.b[k]
        arm = rotate(q[a], parts.p_a[k])
        drift = v[a] + np.cross(w[a], arm) - v[b] - np.cross(w[b], x[a] + arm - x[b])
        drift = rotate(conjugate(multiply(q[b], parts.q_b[k])), drift)
        out = np.zeros(len(k))
        for i, held in enumerate(self._held(self._local(at))):
            along = (held.directions[0] @ drift[i])[: held.count[0]]
            limit = held.one_sided[0, : held.count[0]]
            out[i] = np.linalg.norm(np.where(limit, np.minimum(along, 0.0), along))
        return out

    def begin(self, now: RigidState) -> None:
        """Look from the start of the step."""
        found = self._held(self._local(now))
        self._write(found, found)
        self._start = found

    def settle(self, given: list, ahead: RigidState) -> None:
        """Look again from where the points are, and close, until nothing moves."""
        for _ in range(LOOKS):
            p = self._local(ahead)
            found = self._held(p)
            self._write(found, self._start)
            if self.residuals(ahead).max() <= SETTLED:
                return
            wp.launch(close_positions, self.system.island_count, inputs=[0, *given, 0], device=self.system.device)

    def _write(self, found: list[Held], start: list[Held]) -> None:
        """Nearest points, held directions (aligned with those of the start) and modes, to the device."""
        parts, s = self.state.parts, self.system
        p_b = s.parts.p_b.numpy()
        normal, normal0 = s.parts.normal.numpy(), s.parts.normal0.numpy()
        mode = s.row_table.mode.numpy()
        lo, hi = s.parts.lo.numpy(), s.parts.hi.numpy()
        for i, k in enumerate(self.numbers):
            now, then = found[i], start[i]
            count = int(now.count[0])
            frame = parts.q_b[k]
            p_b[k] = self.origin[i] + rotate(frame[None], now.point)[0]
            directions = now.directions[0].copy()
            if count == int(then.count[0]) and not now.one_sided[0].any():
                directions[:count] = _aligned(directions[:count], then.directions[0][:count])
                normal0[3 * k : 3 * k + 3] = then.directions[0]
            else:
                normal0[3 * k : 3 * k + 3] = directions
            normal[3 * k : 3 * k + 3] = directions
            lo[k], hi[k] = 0.0, rigid.FREE
            for r in range(ROWS):
                held = int(LIMIT) if now.one_sided[0, r] else int(EQUAL)
                mode[ROWS * k + r] = held if r < count else int(NONE)
        for array, values in (
            (s.parts.p_b, p_b), (s.parts.normal, normal), (s.parts.normal0, normal0), (s.row_table.mode, mode),
            (s.parts.lo, lo), (s.parts.hi, hi),
        ):  # fmt: skip
            array.assign(values)


def _aligned(directions: np.ndarray, like: np.ndarray) -> np.ndarray:
    """The same plane, with the basis turned as near to ``like`` as can be."""
    if len(directions) == 0:
        return directions
    u, _, vt = np.linalg.svd(like @ directions.T)
    return (u @ vt) @ directions
