"""Beeman: ``x+ = x + h v + h^2/6 (4 a - a_prev)``, ``v+ = v + h/6 (2 a(x+, v*) + 5 a - a_prev)``, ``v* = v + h/2 (3 a - a_prev)``.

The remembered acceleration holds the constraint forces: without them a nailed point at rest reports 15 N for 10 N of
weight. The start, and every change of dt, is ``a_prev = a``.
"""

import warp as wp

from turnbuckle.data.state import H
from turnbuckle.integrators.scheme import Recorder, Scheme, accelerations, copy
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def predict(
    begin: int,
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    a: wp.array(dtype=vec3),
    a_previous: wp.array(dtype=vec3),
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
    v_predicted_out: wp.array(dtype=vec3),
):
    """Positions at the end of the step, and velocities good enough to evaluate damping there."""
    i = begin + wp.tid()
    h = params[H]
    x_out[i] = x[i] + v[i] * h + (real(4.0) * a[i] - a_previous[i]) * (h * h / real(6.0))
    v_star = v[i] + (real(3.0) * a[i] - a_previous[i]) * (real(0.5) * h)
    v_out[i] = v_star
    v_predicted_out[i] = v_star


@wp.kernel
def finish(
    begin: int,
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    v: wp.array(dtype=vec3),
    a: wp.array(dtype=vec3),
    a_previous: wp.array(dtype=vec3),
    force_end: wp.array(dtype=vec3),
    v_predicted: wp.array(dtype=vec3),
    paper: real,
    v_out: wp.array(dtype=vec3),
    memory_out: wp.array(dtype=vec3),
):
    """The velocity at the end; remembers ``a``, with the landing force under ``response="paper"``."""
    i = begin + wp.tid()
    h = params[H]
    landing = (v_out[i] - v_predicted[i]) * paper  # 5 h / 6 F / m
    a_end = force_end[i] / mass[i]
    v_out[i] = v[i] + (real(2.0) * a_end + real(5.0) * a[i] - a_previous[i]) * (h / real(6.0)) + landing
    memory_out[i] = a[i] + landing * (real(6.0) / (real(5.0) * h))


class Beeman(Scheme):
    name = "beeman"
    order = 2
    adds_landing = True
    finishes_velocity = True

    def response(self, h: float) -> tuple[float, float]:
        return 2.0 / 3.0 * h * h, 5.0 / 6.0 * h

    def restart(self, r: Recorder) -> None:
        r.launch(copy, [accelerations(r, r.now.force, "a1"), r.now.memory])

    def change_dt(self, r: Recorder) -> None:
        self.restart(r)

    def predict(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        a = accelerations(r, now.force, "a1")
        given = [r.params, now.x, now.v, a, now.memory]
        r.launch(predict, [*given, ahead.x, ahead.v, r.scratch("v_predicted")])

    def finish(self, r: Recorder) -> None:
        now, ahead = r.now, r.ahead
        r.forces(ahead.x, ahead.v, ahead.force, 1.0)
        given = [r.mass, r.params, now.v, r.scratch("a1"), now.memory, ahead.force, r.scratch("v_predicted")]
        r.launch(finish, [*given, wp.float64(r.paper), ahead.v, ahead.memory])
