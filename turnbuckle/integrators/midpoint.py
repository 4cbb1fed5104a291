"""Explicit midpoint, Local (7): an Euler half step to ``(x_m, v_m)``, then ``x+ = x + h v_m``, ``v+ = v + h a(x_m, v_m)``.

A constant force moves the point by ``h^2 / 2 F / m``, all of it through the half step.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance


class Midpoint(Scheme):
    name = "midpoint"
    order = 2
    adds_landing = True

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, h

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        a1 = accelerations(r, now.force, "a1")
        x_mid = advance(r, now.x, now.v, 0.5, r.scratch("x_stage"))
        v_mid = advance(r, now.v, a1, 0.5, r.scratch("v_stage"))
        r.forces(x_mid, v_mid, ahead.force, 0.5)
        a2 = accelerations(r, ahead.force, "a2")
        advance(r, now.x, v_mid, 1.0, ahead.x)
        advance(r, now.v, a2, 1.0, ahead.v)
