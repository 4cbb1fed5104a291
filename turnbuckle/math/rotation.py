"""Rotations on single values: exponential, logarithm, and the swing-twist angle. Quaternions are xyzw, of unit length."""

import warp as wp

from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

quat = wp.quatd
mat33 = wp.mat33d


@wp.func
def rotation_exp(r: vec3) -> quat:
    """The rotation about ``r`` by the angle ``|r|`` [rad]."""
    angle = wp.length(r)
    s = real(0.5) - angle * angle / real(48.0)  # sin(angle / 2) / angle, to angle^4
    c = real(1.0) - angle * angle / real(8.0)
    if angle > real(1e-4):
        s = wp.sin(real(0.5) * angle) / angle
        c = wp.cos(real(0.5) * angle)
    return wp.normalize(quat(r[0] * s, r[1] * s, r[2] * s, c))


@wp.func
def rotation_log(q: quat) -> vec3:
    """The rotation vector of ``q``, of an angle of at most pi."""
    v = vec3(q[0], q[1], q[2])
    w = q[3]
    if w < real(0.0):
        v = -v
        w = -w
    s = wp.length(v)
    factor = real(2.0) / w * (real(1.0) - s * s / (real(3.0) * w * w))
    if s > real(1e-5):
        factor = real(2.0) * wp.atan2(s, w) / s
    return v * factor


@wp.func
def twist_angle(q: quat) -> real:
    """Of ``q = swing twist``, the angle of the twist about z, in (-pi, pi] [rad]."""
    z = q[2]
    w = q[3]
    if w < real(0.0):
        z = -z
        w = -w
    return real(2.0) * wp.atan2(z, w)


@wp.func
def wrapped(angle: real) -> real:
    """The angle in (-pi, pi] [rad]."""
    turn = real(6.283185307179586)
    return angle - turn * wp.round(angle / turn)


@wp.func
def turned_inertia(q: quat, principal: vec3, a: vec3) -> vec3:
    """``R diag(principal) R^T a``: a tensor of inertia (or its inverse) in world axes, times ``a``."""
    b = wp.quat_rotate_inv(q, a)
    return wp.quat_rotate(q, vec3(principal[0] * b[0], principal[1] * b[1], principal[2] * b[2]))
