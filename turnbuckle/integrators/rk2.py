"""Second-order Runge-Kutta (Heun), Local (8) as the real scheme: an Euler step, then the mean of the rates at both ends.

(8) replaces the second evaluation of the force by its Jacobian (and misses ``I`` in B); here the force is evaluated.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance


class RK2(Scheme):
    name = "rk2"
    order = 2
    adds_landing = True

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, h

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        a1 = accelerations(r, now.force, "a1")
        x_end = advance(r, now.x, now.v, 1.0, r.scratch("x_stage"))
        v_end = advance(r, now.v, a1, 1.0, r.scratch("v_stage"))
        r.forces(x_end, v_end, ahead.force, 1.0)
        a2 = accelerations(r, ahead.force, "a2")
        half_x = advance(r, now.x, now.v, 0.5, r.scratch("x_half"))
        advance(r, half_x, v_end, 0.5, ahead.x)
        half_v = advance(r, now.v, a1, 0.5, r.scratch("v_half"))
        advance(r, half_v, a2, 0.5, ahead.v)
