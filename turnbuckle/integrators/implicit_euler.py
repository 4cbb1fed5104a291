"""Implicit Euler with linearised forces (Baraff and Witkin 1998): ``(M - h D - h^2 K) dv = h (F + h K v)``.

With ``a = dv / h`` this is ``(M - h D - h^2 K) a = F + h K v``; then ``v+ = v + h a``, ``x+ = x + h v+``. K = dF/dx and
D = dF/dv at the start of the step. By default constraints are rows of the same system: they are solved through A, so the
static shape does not depend on dt. ``response="paper"`` lands afterwards with ``c = h^2 / m`` (10), which is exact in
position and wrong in physics.
"""

from turnbuckle.integrators.scheme import Recorder, Scheme, advance


class ImplicitEuler(Scheme):
    name = "implicit_euler"
    order = 1
    implicit = True
    goal_rate = "backward"

    def response(self, h: float) -> tuple[float, float]:
        return h * h, h

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        x_free = advance(r, now.x, now.v, 1.0, r.scratch("x_free"))
        a = r.scratch("a1")
        r.solve(1.0, 1.0, 1.0, at=(now.x, now.v), free=x_free, force=now.force, a_out=a, iteration=0, last=None)
        advance(r, now.v, a, 1.0, ahead.v)
        advance(r, now.x, ahead.v, 1.0, ahead.x)
