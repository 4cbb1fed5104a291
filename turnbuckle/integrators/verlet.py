"""Verlet, Local (2)-(5): ``x+ = 2 x - x_prev + h^2 F / m``, ``v+ = (x+ - x_prev) / (2 h)``.

Kept in the form ``w = (x - x_prev) / h``: ``w+ = w + h F / m``, ``x+ = x + h w+``, ``v+ = (w + w+) / 2``. This is the same
scheme, but round-off stays that of the velocities and not of ``x / h``. Note that v, as the paper has it, is the velocity
one step ago. The start is ``w = v - h/2 a``, and when dt changes the velocity now, ``w + h/2 a``, is carried over.
"""

import warp as wp

from turnbuckle.data.state import PREVIOUS_H, H
from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, advance
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def predict(
    begin: int,
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force: wp.array(dtype=vec3),
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
    w_out: wp.array(dtype=vec3),
):
    """One step of the scheme: (2) and (3)."""
    i = known(begin + wp.tid())
    h = params[H]
    w_old = w[i]
    kick = force[i] * (h / mass[i])
    w_new = w_old + kick
    x_out[i] = x[i] + w_new * h
    v_out[i] = w_old + kick * real(0.5)
    w_out[i] = w_new


@wp.kernel
def carry_over(begin: int, a: wp.array(dtype=vec3), params: wp.array(dtype=real), w: wp.array(dtype=vec3)):
    """``w`` for the step H from the one for the step before: ``w + (h_before - h) / 2 a``."""
    i = known(begin + wp.tid())
    w[i] = w[i] + a[i] * (real(0.5) * (params[PREVIOUS_H] - params[H]))


class Verlet(Scheme):
    name = "verlet"
    order = 2  # of positions; v lags by one step, as printed in (2)
    velocity_memory = True

    def response(self, h: float) -> tuple[float, float]:
        return h * h, 0.5 * h

    def restart(self, r: Recorder) -> None:
        advance(r, r.now.v, accelerations(r, r.now.force, "a1"), -0.5, r.now.memory)

    def change_dt(self, r: Recorder) -> None:
        r.launch(carry_over, [accelerations(r, r.now.force, "a1"), r.params, r.now.memory])

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        r.launch(predict, [r.mass, r.params, now.x, now.memory, now.force, ahead.x, ahead.v, ahead.memory])
