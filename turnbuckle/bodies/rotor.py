"""Free motion of a rigid body's attitude.

`free_rotation` is exact to round-off: the angular momentum L stays as it is in the world, and with u = R^T L, w = J^-1 u
in the body's principal axes

    u' = u x w,    q' = q w / 2

are polynomial, so their Taylor series follows from products of series:
``(k+1) u_{k+1} = sum_j u_j x w_{k-j}``, ``(k+1) q_{k+1} = 1/2 sum_j q_j w_{k-j}``. Steps are cut so that the series
converge like ``0.2^k / k!``. `paper_rotation` is (4) of Displacement, with R made orthonormal again.
"""

import warp as wp

from turnbuckle.math.rotation import quat, rotation_exp
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

ORDER = 10
ANGLE = 0.2  # [rad], of a substep at most
MOST = 160  # substeps
_Vectors = wp.types.matrix(shape=(ORDER + 1, 3), dtype=wp.float64)
_Quaternions = wp.types.matrix(shape=(ORDER + 1, 4), dtype=wp.float64)


@wp.func
def free_rotation(q0: quat, momentum: vec3, principal: vec3, h: real) -> quat:
    """Attitude after ``h`` [s] of a body with angular momentum ``momentum`` [kg m^2/s, world] and principal moments [kg m^2]."""
    inverse = vec3(real(1.0) / principal[0], real(1.0) / principal[1], real(1.0) / principal[2])
    size = wp.length(momentum)
    angle = size * wp.max(inverse[0], wp.max(inverse[1], inverse[2])) * h
    if angle < real(1e-16):
        return q0
    steps = int(wp.min(angle / real(ANGLE), real(MOST))) + 1  # more is no motion, but a solver gone astray
    dt = h / real(steps)
    q = q0
    for _step in range(steps):
        b = wp.quat_rotate_inv(q, momentum)
        u = _Vectors()
        w = _Vectors()
        p = _Quaternions()
        for d in range(3):
            u[0, d] = b[d]
            w[0, d] = b[d] * inverse[d] * dt  # time in units of the substep
            p[0, d] = q[d]
        p[0, 3] = q[3]
        sx = q[0]
        sy = q[1]
        sz = q[2]
        sw = q[3]
        k = int(0)
        going = int(1)
        while going == 1:
            ux = real(0.0)
            uy = real(0.0)
            uz = real(0.0)
            px = real(0.0)
            py = real(0.0)
            pz = real(0.0)
            pw = real(0.0)
            for j in range(k + 1):
                i = k - j
                ux += u[j, 1] * w[i, 2] - u[j, 2] * w[i, 1]
                uy += u[j, 2] * w[i, 0] - u[j, 0] * w[i, 2]
                uz += u[j, 0] * w[i, 1] - u[j, 1] * w[i, 0]
                px += p[j, 3] * w[i, 0] + p[j, 1] * w[i, 2] - p[j, 2] * w[i, 1]
                py += p[j, 3] * w[i, 1] + p[j, 2] * w[i, 0] - p[j, 0] * w[i, 2]
                pz += p[j, 3] * w[i, 2] + p[j, 0] * w[i, 1] - p[j, 1] * w[i, 0]
                pw -= p[j, 0] * w[i, 0] + p[j, 1] * w[i, 1] + p[j, 2] * w[i, 2]
            f = real(1.0) / real(k + 1)
            k += 1
            u[k, 0] = ux * f
            u[k, 1] = uy * f
            u[k, 2] = uz * f
            w[k, 0] = ux * f * inverse[0] * dt
            w[k, 1] = uy * f * inverse[1] * dt
            w[k, 2] = uz * f * inverse[2] * dt
            f = real(0.5) * f
            p[k, 0] = px * f
            p[k, 1] = py * f
            p[k, 2] = pz * f
            p[k, 3] = pw * f
            sx += p[k, 0]
            sy += p[k, 1]
            sz += p[k, 2]
            sw += p[k, 3]
            left = wp.abs(p[k, 0]) + wp.abs(p[k, 1]) + wp.abs(p[k, 2]) + wp.abs(p[k, 3])
            if k == ORDER or (k > 1 and left < real(1e-18)):
                going = 0
        q = wp.normalize(quat(sx, sy, sz, sw))
    return q


@wp.func
def paper_rotation(q0: quat, w: vec3, h: real) -> quat:
    """``(I + h w~) R`` made orthonormal (4): the nearest rotation turns by ``atan(h |w|)``."""
    angle = wp.length(w) * h
    if angle < real(1e-16):
        return q0
    return wp.normalize(rotation_exp(w * (h * wp.atan(angle) / angle)) * q0)
