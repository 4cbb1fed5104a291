"""Velocity Verlet: ``x+ = x + h v + h^2/2 a``, ``v+ = v + h/2 (a + a(x+, v + h a))``.

With constraints this is RATTLE (Andersen 1983): one multiplier lands the positions, one the velocities.
"""

import warp as wp

from turnbuckle.data.state import H
from turnbuckle.integrators.scheme import Recorder, Scheme, copy
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
    """Positions at the end of the step, and velocities good enough to evaluate damping there."""
    i = begin + wp.tid()
    h = params[H]
    kick = force[i] * (h / mass[i])
    x_out[i] = x[i] + (v[i] + kick * real(0.5)) * h
    v_out[i] = v[i] + kick


@wp.kernel
def finish(
    begin: int,
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    v: wp.array(dtype=vec3),
    force: wp.array(dtype=vec3),
    force_end: wp.array(dtype=vec3),
    v_predicted: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
):
    """``v+ = v + h/2 (a + a+)``, plus what landing has given to the predicted velocity under ``response="paper"``."""
    i = begin + wp.tid()
    h = params[H]
    landing = v_out[i] - v_predicted[i]
    v_out[i] = v[i] + (force[i] + force_end[i]) * (real(0.5) * h / mass[i]) + landing


class VelocityVerlet(Scheme):
    name = "velocity_verlet"
    order = 2
    finishes_velocity = True

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, 0.5 * h

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        r.launch(predict, [r.mass, r.params, now.x, now.v, now.force, ahead.x, ahead.v])
        r.launch(copy, [ahead.v, r.scratch("v_predicted")])

    def finish(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        r.forces(ahead.x, ahead.v, ahead.force, 1.0)
        given = [r.mass, r.params, now.v, now.force, ahead.force, r.scratch("v_predicted")]
        r.launch(finish, [*given, ahead.v])
