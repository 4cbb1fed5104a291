"""Free motion of a body in a step: kick and flight."""

import warp as wp

from turnbuckle.bodies.rotor import free_rotation, paper_rotation
from turnbuckle.data.articulated import Bodies, Islands
from turnbuckle.data.state import GRAVITY, H
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def kick(islands: Islands, bodies: Bodies, params: wp.array(dtype=real), b: int):
    """Velocity and angular momentum of body ``b`` before its flight, without constraints."""
    h = params[H]
    g = vec3(params[GRAVITY], params[GRAVITY + 1], params[GRAVITY + 2])
    part = real(0.5) * h
    q = bodies.q0[b]
    w = bodies.w0[b]
    spin = turned_inertia(q, bodies.inertia[b], w)
    if islands.paper == 1:
        part = h
        torque = bodies.torque[b] - wp.cross(w, spin)
        spin = spin + torque * h
    else:
        spin = spin + bodies.torque[b] * part
    decay = bodies.damping[b]
    v = bodies.v0[b] + (g + bodies.force[b] * bodies.inverse_mass[b]) * part
    bodies.v_free[b] = v * wp.exp(-decay[0] * part)
    bodies.l_free[b] = spin * wp.exp(-decay[1] * part)


@wp.func
def fly(islands: Islands, bodies: Bodies, b: int, h: real):
    """Body ``b`` from the start of the step to its end, with the velocity and angular momentum it has."""
    bodies.x1[b] = bodies.x0[b] + bodies.v1[b] * h
    if islands.paper == 1:
        w = turned_inertia(bodies.q0[b], bodies.inverse_inertia[b], bodies.momentum[b])
        bodies.w1[b] = w
        bodies.q1[b] = paper_rotation(bodies.q0[b], w, h)
    else:
        bodies.q1[b] = free_rotation(bodies.q0[b], bodies.momentum[b], bodies.inertia[b], h)
