"""The classical Runge-Kutta scheme of fourth order on ``(x, v)``, for reference work.

A constant force moves the point by ``h^2 / 2 F / m``. Constraints are met at every stage, which keeps the order.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance


class RK4(Scheme):
    name = "rk4"
    order = 4
    adds_landing = True

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, h

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        sum_x, sum_v = now.x, now.v
        rate_x, rate_v = now.v, accelerations(r, now.force, "a1")
        for stage, (time, weight) in enumerate(((0.5, 1 / 6), (0.5, 1 / 3), (1.0, 1 / 3)), start=1):
            sum_x = advance(r, sum_x, rate_x, weight, r.scratch(f"sum_x{stage}"))
            sum_v = advance(r, sum_v, rate_v, weight, r.scratch(f"sum_v{stage}"))
            x_stage = advance(r, now.x, rate_x, time, r.scratch("x_stage"))
            v_stage = advance(r, now.v, rate_v, time, r.scratch(f"v_stage{stage}"))
            r.forces(x_stage, v_stage, ahead.force, time)
            rate_x, rate_v = v_stage, accelerations(r, ahead.force, f"a{stage + 1}")
        advance(r, sum_x, rate_x, 1 / 6, ahead.x)
        advance(r, sum_v, rate_v, 1 / 6, ahead.v)
