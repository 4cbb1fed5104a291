"""Euler-Cromer (semi-implicit, symplectic Euler), Local (9): ``v+ = v + h F / m``, ``x+ = x + h v+``."""

import warp as wp

from turnbuckle.data.state import H
from turnbuckle.integrators.scheme import Recorder, Scheme
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
    v_new = v[i] + force[i] * (h / mass[i])
    v_out[i] = v_new
    x_out[i] = x[i] + v_new * h


class EulerCromer(Scheme):
    name = "euler_cromer"
    order = 1
    goal_rate = "backward"

    def response(self, h: float) -> tuple[float, float]:
        return h * h, h

    def predict(self, r: Recorder) -> None:
        r.launch(predict, [r.mass, r.params, r.now.x, r.now.v, r.now.force, r.ahead.x, r.ahead.v])
