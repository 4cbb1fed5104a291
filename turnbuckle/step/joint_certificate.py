"""What joints miss by, measured on the committed state with formulas of its own: distances to domains, angles from axes.

Curves, surfaces and domains of the user are looked up on the host: `turnbuckle.step.domain_search` measures those.
"""

import numpy as np
import warp as wp

from turnbuckle.compute import Program, host
from turnbuckle.data.articulated import Bodies, Parts
from turnbuckle.data.rigid import ANGLE, FIXED, FREE, POINT, RING, ROLLING, SEGMENT, SPHERE, TWIST
from turnbuckle.data.state import State
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

UNBOUND = wp.constant(wp.float64(FREE))
NEAR = wp.constant(wp.float64(1e-9))  # [m or rad] from a limit: here the rate must not lead out


@wp.func
def beyond(s: real, lo: real, hi: real):
    """Signed distance of ``s`` from [lo, hi]."""
    if s < lo:
        return s - lo
    if s > hi:
        return s - hi
    return real(0.0)


@wp.func
def leaving(s: real, rate: real, lo: real, hi: real):
    """Speed with which ``s`` leaves [lo, hi] where it is at a limit; the whole rate where both limits are the same."""
    if lo == hi:
        return wp.abs(rate)
    if s < lo + NEAR:
        return wp.max(-rate, real(0.0))
    if s > hi - NEAR:
        return wp.max(rate, real(0.0))
    return real(0.0)


@wp.kernel
def measure_joints(
    begin: int,
    on: wp.array(dtype=wp.int32),
    parts: Parts,
    bodies: Bodies,
    position_out: wp.array(dtype=real),
    rotation_out: wp.array(dtype=real),
    speed_out: wp.array(dtype=real),
    spin_out: wp.array(dtype=real),
):
    """Residuals of each part: [m], [rad], and their rates [m/s], [rad/s]."""
    i = known(begin + wp.tid())
    kind = parts.kind[i]
    a = known(parts.a[i])
    b = known(parts.b[i])
    turn_a = wp.quat_to_matrix(bodies.q1[a])
    turn_b = wp.quat_to_matrix(bodies.q1[b])
    axes_a = turn_a * wp.quat_to_matrix(parts.q_a[i])
    axes_b = turn_b * wp.quat_to_matrix(parts.q_b[i])
    z_a = vec3(axes_a[0, 2], axes_a[1, 2], axes_a[2, 2])
    z_b = vec3(axes_b[0, 2], axes_b[1, 2], axes_b[2, 2])
    arm_a = turn_a * parts.p_a[i]
    d = bodies.x1[a] + arm_a - bodies.x1[b] - turn_b * parts.p_b[i]
    v = bodies.v1[a] + wp.cross(bodies.w1[a], arm_a)  # of P_a seen from b
    v = v - bodies.v1[b] - wp.cross(bodies.w1[b], bodies.x1[a] + arm_a - bodies.x1[b])
    w = bodies.w1[a] - bodies.w1[b]
    lo = parts.lo[i]
    hi = parts.hi[i]
    soft = int(0)
    if parts.stiffness[i] > real(0.0) or parts.damping[i] > real(0.0):
        soft = 1
        lo = -UNBOUND
        hi = UNBOUND
    position = real(0.0)
    rotation = real(0.0)
    speed = real(0.0)
    spin = real(0.0)
    if kind == POINT:
        position = wp.length(d)
        speed = wp.length(v)
    elif kind == SEGMENT:
        s = wp.dot(d, z_b)
        across = d - z_b * s
        position = wp.length(across + z_b * beyond(s, lo, hi))
        drift = v - z_b * wp.dot(v, z_b)
        speed = wp.length(drift) + leaving(s, wp.dot(v, z_b), lo, hi)
    elif kind == RING:
        height = wp.dot(d, z_b)
        radial = d - z_b * height
        radius = wp.length(radial)
        position = wp.sqrt(height * height + beyond(radius, lo, hi) * beyond(radius, lo, hi))
        speed = wp.abs(wp.dot(v, z_b))
        if radius > real(0.0):
            speed += leaving(radius, wp.dot(v, radial) / radius, lo, hi)
    elif kind == SPHERE:
        s = wp.length(d)
        position = wp.abs(beyond(s, lo, hi))
        if s > real(0.0):
            speed = leaving(s, wp.dot(v, d) / s, lo, hi)
    elif kind == ANGLE:
        n = wp.cross(z_b, z_a)
        sine = wp.length(n)
        s = wp.atan2(sine, wp.dot(z_a, z_b))
        rotation = wp.abs(beyond(s, lo, hi))
        if lo == real(0.0) and hi == real(0.0):
            spin = wp.length(wp.cross(w, z_b))
        elif sine > real(0.0):
            spin = leaving(s, wp.dot(w, n) / sine, lo, hi)
    elif kind == TWIST:
        x_a = vec3(axes_a[0, 0], axes_a[1, 0], axes_a[2, 0])
        x_b = vec3(axes_b[0, 0], axes_b[1, 0], axes_b[2, 0])
        n = wp.cross(z_b, z_a)  # swing x_b the short way from z_b to z_a: Rodrigues
        x_b = x_b + wp.cross(n, x_b) + wp.cross(n, wp.cross(n, x_b)) / (real(1.0) + wp.dot(z_a, z_b))
        s = wp.atan2(wp.dot(wp.cross(x_b, x_a), z_a), wp.dot(x_a, x_b))
        turn = real(6.283185307179586)
        if s < real(-2.0) and wp.abs(beyond(s + turn, lo, hi)) < wp.abs(beyond(s, lo, hi)):
            s = s + turn
        elif s > real(2.0) and wp.abs(beyond(s - turn, lo, hi)) < wp.abs(beyond(s, lo, hi)):
            s = s - turn
        rotation = wp.abs(beyond(s, lo, hi))
        if lo == hi:
            rotation = wp.abs((s - lo) - turn * wp.round((s - lo) / turn))
        spin = leaving(s, wp.dot(w, z_a + z_b) / (real(1.0) + wp.dot(z_a, z_b)), lo, hi)
    elif kind == FIXED:
        total = vec3()
        for k in range(3):
            total += wp.cross(
                vec3(axes_b[0, k], axes_b[1, k], axes_b[2, k]), vec3(axes_a[0, k], axes_a[1, k], axes_a[2, k])
            )
        rotation = wp.asin(wp.min(real(0.5) * wp.length(total), real(1.0)))
        spin = wp.length(w)
    elif kind == ROLLING:
        down = z_b
        if lo < real(0.5):
            down = wp.normalize(z_b - z_a * wp.dot(z_a, z_b))
        touch = bodies.x1[a] + arm_a - down * hi
        position = wp.abs(wp.dot(touch - bodies.x1[b] - turn_b * parts.p_b[i], z_b))
        slip = bodies.v1[a] + wp.cross(bodies.w1[a], touch - bodies.x1[a])
        speed = wp.length(slip - bodies.v1[b] - wp.cross(bodies.w1[b], touch - bodies.x1[b]))
    if on[i] == 0 or (soft == 1 and (kind == SPHERE or kind == ANGLE or kind == TWIST)):
        position = real(0.0)
        rotation = real(0.0)
        speed = real(0.0)
        spin = real(0.0)
    position_out[i] = position
    rotation_out[i] = rotation
    speed_out[i] = speed
    spin_out[i] = spin


class JointCertificate:
    """Records the measurement of joints, and reads it out."""

    def __init__(self, state: State, device: str) -> None:
        n = max(state.parts.count, 1)
        self.values = [wp.zeros(n, dtype=wp.float64, device=device) for _ in range(4)]
        self.count = state.parts.count

    def record(self, p: Program, on: wp.array, parts: Parts, bodies: Bodies) -> None:
        """Record the measurement of the end of the step; ``on``: which parts act."""
        if self.count:
            p.launch(measure_joints, self.count, [on, parts, bodies, *self.values])

    def read(self) -> np.ndarray:
        """[m], [rad], [m/s], [rad/s] of each part, shape (4, parts)."""
        return np.stack([host(a) for a in self.values])
