"""Newmark with beta = 1/4, gamma = 1/2 (average acceleration), one Newton iteration from the predictor.

``x* = x + h v + h^2/4 a``, ``v* = v + h/2 a``; ``(M - h/2 D - h^2/4 K) a+ = F(x*, v*)``; ``x+ = x* + h^2/4 a+``,
``v+ = v* + h/2 a+``. The remembered acceleration is evaluated at the committed state, with constraint forces: carried
over as ``a+`` it would swing between two values for ever after a constraint is switched on.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance, copy


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
        r.forces(x_star, v_star, ahead.force, 1.0)
        a = r.scratch("a2")
        r.solve(alpha=0.5, beta=0.25, push=0.0, at=(x_star, v_star), free=(x_star, v_star), force=ahead.force, a_out=a)
        advance(r, v_star, a, 0.5, ahead.v)
        quarter = advance(r, r.scratch("zero"), a, 0.25, r.scratch("quarter"))
        advance(r, x_star, quarter, 1.0, ahead.x)

    def remember(self, r: Recorder) -> None:
        r.launch(copy, [accelerations(r, r.ahead.force, "a1"), r.ahead.memory])
