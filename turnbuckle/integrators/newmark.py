"""Newmark with beta = 1/4, gamma = 1/2 (average acceleration), solved by Newton's method.

``x* = x + h v + h^2/4 a``, ``v* = v + h/2 a``; ``M a+ = F(x+, v+)`` with ``x+ = x* + h^2/4 a+``, ``v+ = v* + h/2 a+``; each
iteration solves ``(M - h/2 D - h^2/4 K) da = F - M a+``. A linear force takes one. A step whose iterations do not settle
fails. The remembered acceleration is evaluated at the committed state, with constraint forces: carried
over as ``a+`` it would swing between two values for ever after a constraint is switched on.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance, copy

NEWTON = 12  # iterations at most


class Newmark(Scheme):
    name = "newmark"
    order = 2
    implicit = True

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, h

    def restart(self, r: Recorder) -> None:
        r.launch(copy, [accelerations(r, r.now.force, "a1"), r.now.memory])

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        quarter = advance(r, r.scratch("zero"), now.memory, 0.25, r.scratch("quarter"))  # h/4 a
        x_star = advance(r, now.x, now.v, 1.0, r.scratch("x_drift"))
        x_star = advance(r, x_star, quarter, 1.0, r.scratch("x_star"))
        v_star = advance(r, now.v, now.memory, 0.5, r.scratch("v_star"))
        a = r.scratch("a2")
        x_end, v_end = x_star, v_star  # with a+ = 0
        for iteration in range(NEWTON):
            at = (x_end, v_end)
            r.forces(x_end, v_end, ahead.force, 1.0)
            r.solve(0.5, 0.25, 0.0, at=at, free=x_end, force=ahead.force, a_out=a, iteration=iteration, last=NEWTON - 1)
            quarter = advance(r, r.scratch("zero"), a, 0.25, r.scratch("quarter"))
            x_end = advance(r, x_star, quarter, 1.0, ahead.x)
            v_end = advance(r, v_star, a, 0.5, ahead.v)

    def remember(self, r: Recorder) -> None:
        r.launch(copy, [accelerations(r, r.ahead.force, "a1"), r.ahead.memory])
