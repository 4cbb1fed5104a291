"""Jacobians of corotational tetrahedra in 3 x 3 blocks; `corotational` has energy, forces and notation.

The paper's ``-dF/dq = R K_e R^T`` has the blocks ``V (lambda y_i y_j^T + mu (y_i . y_j I + y_j y_i^T))`` with ``y_i = R g_i``. It
lacks what the turning of R adds to the second variation of E: ``w^T T w``, ``T = 4 V (mu I - (2 mu - lambda tr e) G^-1)``, with
``w = sum_i g_i x R^T dx_i / 2``: zero at rest, positive where the element is stretched, negative where it is squeezed. Its
positive part is added ("tension") to elements strained by more than `SMALL`: without it a solid at twice its length is no
longer stable at the large steps of Contact, and its energy grows (at half as much again it still is). With T
itself everywhere K would be exact.

Damping has ``-dF/dv = beta B^T C B``, B from velocities to dS/dt.

All are positive semi-definite, and blind to translations: only blocks of corners i < j are stored.
"""

import warp as wp

from turnbuckle.bodies.corotational import Elements, Strain, axial, deformation, strain_of, strain_rate, stress
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
mat63 = wp.types.matrix(shape=(6, 3), dtype=wp.float64)
SMALL = wp.constant(wp.float64(0.1))  # |e|, the Frobenius norm of the strain
BLOCKS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))  # corners of the blocks that are stored


@wp.func_native(
    """
    // Cyclic Jacobi on numbers that stay in registers; three or four sweeps.
    double a = m.data[0][0], b = m.data[1][1], c = m.data[2][2];
    double d = m.data[1][2], e = m.data[0][2], f = m.data[0][1];
    const double size = a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f);
    double q[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
#define TURNBUCKLE_ROTATE(P, Q, OFF, LEFT, RIGHT, I, J)                                        \\
    if (OFF != 0.0) {                                                                          \\
        const double gap = Q - P, twice = 2.0 * OFF;                                           \\
        const double root = sqrt(gap * gap + twice * twice);                                   \\
        const double t = twice / (gap < 0.0 ? gap - root : gap + root);                        \\
        const double cs = 1.0 / sqrt(t * t + 1.0), sn = t * cs;                                \\
        const double left = LEFT, right = RIGHT;                                               \\
        P -= t * OFF;                                                                          \\
        Q += t * OFF;                                                                          \\
        OFF = 0.0;                                                                             \\
        LEFT = cs * left - sn * right;                                                         \\
        RIGHT = sn * left + cs * right;                                                        \\
        for (int k = 0; k < 3; ++k) {                                                          \\
            const double x = q[k][I], y = q[k][J];                                             \\
            q[k][I] = cs * x - sn * y;                                                         \\
            q[k][J] = sn * x + cs * y;                                                         \\
        }                                                                                      \\
    }
    for (int sweep = 0; sweep < 8; ++sweep) {
        if (d * d + e * e + f * f <= 1e-22 * size) break;
        TURNBUCKLE_ROTATE(a, b, f, e, d, 0, 1)
        TURNBUCKLE_ROTATE(a, c, e, f, d, 0, 2)
        TURNBUCKLE_ROTATE(b, c, d, f, e, 1, 2)
    }
#undef TURNBUCKLE_ROTATE
    const double value[3] = {a > 0.0 ? a : 0.0, b > 0.0 ? b : 0.0, c > 0.0 ? c : 0.0};
    wp::mat_t<3, 3, double> r;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            double total = 0.0;
            for (int k = 0; k < 3; ++k) total += q[i][k] * value[k] * q[j][k];
            r.data[i][j] = total;
        }
    return r;
"""
)
def positive_part(m: mat33) -> mat33:
    """A symmetric matrix with its negative eigenvalues put to zero."""
    ...


@wp.func
def tension(e: Elements, s: int, q: Strain) -> mat33:
    """The positive part of T in world axes [J] (see the top of this file)."""
    mu = e.mu[s]
    if wp.trace(q.turning) == real(0.0):  # inside out
        return mat33()
    zero = real(0.0)
    t = q.turning * (e.lam[s] * q.trace - real(2.0) * mu) + mat33(mu, zero, zero, zero, mu, zero, zero, zero, mu)
    r = q.rotation
    return positive_part(r * t * wp.transpose(r)) * real(4.0)


@wp.func
def pair_block(e: Elements, s: int, weight: real, a: vec3, b: vec3) -> mat33:
    """``weight V (lambda a b^T + mu (a . b I + b a^T))``."""
    mu = e.mu[s] * weight
    d = mu * wp.dot(a, b)
    zero = real(0.0)
    m = wp.outer(a * (e.lam[s] * weight), b) + wp.outer(b * mu, a)
    return m + mat33(d, zero, zero, zero, d, zero, zero, zero, d)


@wp.func
def turn_block(t: mat33, weight: real, a: vec3, b: vec3) -> mat33:
    """``weight [a]x^T t [b]x / 4``: how w depends on the corners, ``w = sum_i y_i x dx_i / 2``."""
    return wp.transpose(wp.skew(a)) * t * wp.skew(b) * (real(0.25) * weight)


@wp.func
def rate_map(q: Strain, g: vec3) -> mat63:
    """dS/dt that a corner with gradient ``g`` gives by moving along each world axis, as (xx, yy, zz, sqrt(2) yz, zx, xy)."""
    r = mat63()
    root = real(1.4142135623730951)
    for k in range(3):
        a = vec3(q.rotation[k, 0], q.rotation[k, 1], q.rotation[k, 2])
        m = strain_rate(q, wp.outer(a, g))
        r[0, k] = m[0, 0]
        r[1, k] = m[1, 1]
        r[2, k] = m[2, 2]
        r[3, k] = root * m[1, 2]
        r[4, k] = root * m[2, 0]
        r[5, k] = root * m[0, 1]
    return r


@wp.func
def weighted(e: Elements, s: int, weight: real, m: mat63) -> mat63:
    """``weight V C m``: the elastic law on each column."""
    double = real(2.0) * weight * e.mu[s]
    lam = weight * e.lam[s]
    r = m * double
    for k in range(3):
        trace = lam * (m[0, k] + m[1, k] + m[2, k])
        r[0, k] = r[0, k] + trace
        r[1, k] = r[1, k] + trace
        r[2, k] = r[2, k] + trace
    return r


@wp.kernel
def corotational_system(
    begin: int,
    elements: Elements,
    first: int,
    first_block: int,
    stretched: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    coefficients: wp.array(dtype=real),
    force_out: wp.array(dtype=vec3),
    push_out: wp.array(dtype=vec3),
    block_out: wp.array(dtype=mat33),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """Forces and ``K v`` on the corners, and the blocks of ``-coefficients[0] D - coefficients[1] K`` for `BLOCKS`.

    K has the tension part where ``stretched`` is 1. ``force_out``, ``push_out``: ``first + 4 s + k``; ``block_out``:
    ``first_block + 6 s + k``.
    """
    s = known(begin + wp.tid())
    q = strain_of(elements, s, x)
    turned = wp.transpose(q.rotation) * deformation(elements, s, v)
    rate = (turned + wp.transpose(turned)) * real(0.5)
    sigma = stress(elements, s, rate, wp.trace(rate))
    k1 = -(q.rotation * (sigma * elements.gradient[s, 0]))
    k2 = -(q.rotation * (sigma * elements.gradient[s, 1]))
    k3 = -(q.rotation * (sigma * elements.gradient[s, 2]))
    f1 = -q.p1
    f2 = -q.p2
    f3 = -q.p3
    stiff = coefficients[1]
    y0 = -(q.y1 + q.y2 + q.y3)
    b01 = pair_block(elements, s, stiff, y0, q.y1)
    b02 = pair_block(elements, s, stiff, y0, q.y2)
    b03 = pair_block(elements, s, stiff, y0, q.y3)
    b12 = pair_block(elements, s, stiff, q.y1, q.y2)
    b13 = pair_block(elements, s, stiff, q.y1, q.y3)
    b23 = pair_block(elements, s, stiff, q.y2, q.y3)
    if stretched == 1 and wp.ddot(q.stretch, q.stretch) - real(2.0) * q.trace - real(3.0) > SMALL * SMALL:  # e:e
        t = tension(elements, s, q)
        b01 += turn_block(t, stiff, y0, q.y1)
        b02 += turn_block(t, stiff, y0, q.y2)
        b03 += turn_block(t, stiff, y0, q.y3)
        b12 += turn_block(t, stiff, q.y1, q.y2)
        b13 += turn_block(t, stiff, q.y1, q.y3)
        b23 += turn_block(t, stiff, q.y2, q.y3)
        c = elements.corners[s]
        v0 = v[c[0]]
        w = wp.cross(q.y1, v[c[1]] - v0) + wp.cross(q.y2, v[c[2]] - v0) + wp.cross(q.y3, v[c[3]] - v0)
        tw = t * w * real(0.25)
        k1 += wp.cross(q.y1, tw)
        k2 += wp.cross(q.y2, tw)
        k3 += wp.cross(q.y3, tw)
    power = real(0.0)
    beta = elements.damping[s]
    if beta > real(0.0):
        rate = strain_rate(q, turned)
        sigma = stress(elements, s, rate, wp.trace(rate)) * beta
        turn = q.turning * axial(sigma * q.stretch)
        f1 -= q.rotation * (sigma * elements.gradient[s, 0] - wp.cross(turn, elements.gradient[s, 0]))
        f2 -= q.rotation * (sigma * elements.gradient[s, 1] - wp.cross(turn, elements.gradient[s, 1]))
        f3 -= q.rotation * (sigma * elements.gradient[s, 2] - wp.cross(turn, elements.gradient[s, 2]))
        power = wp.ddot(sigma, rate)
        damp = coefficients[0] * beta
        m1 = rate_map(q, elements.gradient[s, 0])
        m2 = rate_map(q, elements.gradient[s, 1])
        m3 = rate_map(q, elements.gradient[s, 2])
        n1 = weighted(elements, s, damp, m1)
        n2 = weighted(elements, s, damp, m2)
        n3 = weighted(elements, s, damp, m3)
        n0 = wp.transpose(n1 + n2 + n3)
        b01 -= n0 * m1
        b02 -= n0 * m2
        b03 -= n0 * m3
        b12 += wp.transpose(n1) * m2
        b13 += wp.transpose(n1) * m3
        b23 += wp.transpose(n2) * m3
    to = first + 4 * s
    force_out[to] = -(f1 + f2 + f3)
    force_out[to + 1] = f1
    force_out[to + 2] = f2
    force_out[to + 3] = f3
    push_out[to] = -(k1 + k2 + k3)
    push_out[to + 1] = k1
    push_out[to + 2] = k2
    push_out[to + 3] = k3
    at = first_block + 6 * s
    block_out[at] = b01
    block_out[at + 1] = b02
    block_out[at + 2] = b03
    block_out[at + 3] = b12
    block_out[at + 4] = b13
    block_out[at + 5] = b23
    energy_out[s] = q.energy
    power_out[s] = power
