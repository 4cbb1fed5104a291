"""Explicit Euler: ``x+ = x + h v``, ``v+ = v + h F / m``.

A force at t does not move the point before ``t + 2h`` (c = 0), so constraints are imposed there: on
``x+ + h v+``, with ``F = (m / h^2) (goal - x+ - h v*)``. They hold exactly from the second step on.
"""

import warp as wp

from turnbuckle.data.state import H, Kinematics
from turnbuckle.integrators.scheme import Recorder, Scheme, advance
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def predict(
    begin: int,
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    force: wp.array(dtype=vec3),
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
):
    """One step of the scheme."""
    i = begin + wp.tid()
    h = params[H]
    x_out[i] = x[i] + v[i] * h
    v_out[i] = v[i] + force[i] * (h / mass[i])


class ExplicitEuler(Scheme):
    name = "explicit_euler"
    order = 1
    lands_later = True

    def response(self, h: float) -> tuple[float, float]:
        return h * h, h

    def predict(self, r: Recorder) -> None:
        r.launch(predict, [r.mass, r.params, r.now.x, r.now.v, r.now.force, r.ahead.x, r.ahead.v])
        advance(r, r.ahead.x, r.ahead.v, 1.0, r.scratch("next_x"))

    def landing(self, r: Recorder) -> Kinematics:
        return Kinematics(r.scratch("next_x"), r.ahead.v, r.ahead.force, r.ahead.memory)
