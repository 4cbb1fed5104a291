"""Corotational linear tetrahedra: Mueller and Gross 2004 (Interactive Virtual Materials), with the nearest rotation.

With the gradients g_i of the shape functions at rest, ``F = sum_i x_i g_i^T``, R its nearest rotation (`polar`) and the
strain ``e = sym(R^T F) - I``, an element of rest volume V has the energy and the forces

    E = V (mu e:e + lambda/2 tr(e)^2),        f_i = -R K_e (R^T x - X) = -V R (2 mu e + lambda tr(e) I) g_i.

Because R maximises ``R : F``, it does not move E to first order, and ``f = -dE/dx`` exactly, inverted elements included
(rotations made in another way, as by orthonormalising edges, lack this). The Jacobian of the paper,

    -dF/dq = R K_e R^T,   block ij = V (lambda y_i y_j^T + mu (y_i . y_j I + y_j y_i^T)),   y_i = R g_i,

is positive semi-definite; damping is ``beta`` [s] times it, in the frame of the same rotation. It lacks what R's own
turning adds: with w the axial vector of skew(R^T dF) and ``G = tr(S) I - S``, ``S = R^T F``, a rotation moves by
``2 G^-1 w`` and the second variation of E gains ``w^T T w``, ``T = 4 V (mu I - (2 mu - lambda tr e) G^-1)``: zero at rest,
positive where the element is stretched, negative where it is squeezed. Its positive part is added ("tension"): without
it a step as large as those of Contact treats the transverse waves of stretched solids explicitly, and they grow.

``y_i`` sum to zero, so only the six blocks i < j are stored.
"""

import numpy as np
import warp as wp

from turnbuckle.bodies.polar import from_rows, nearest_rotation
from turnbuckle.data.model import Corotational
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
BLOCKS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))  # corners of the blocks that are stored


@wp.struct
class Elements:
    """Constant data of corotational elements."""

    corners: wp.array(dtype=wp.vec4i)
    gradient: wp.array2d(dtype=vec3)  # (n, 3) [1/m] g_1, g_2, g_3; g_0 = -(g_1 + g_2 + g_3)
    mu: wp.array(dtype=real)  # (n,) [J] V mu
    lam: wp.array(dtype=real)  # (n,) [J] V lambda
    damping: wp.array(dtype=real)  # (n,) [s]


@wp.struct
class Strain:
    """What forces and blocks share. Vectors are in world axes."""

    rotation: mat33
    y1: vec3  # R g_1, ...
    y2: vec3
    y3: vec3
    p1: vec3  # R (2 V mu e + V lambda tr(e) I) g_1, ...: minus the elastic forces
    p2: vec3
    p3: vec3
    stretch: mat33  # S = R^T F, symmetric
    trace: real  # tr(e)
    energy: real


@wp.func
def stress_times(e: Elements, s: int, strain: mat33, trace: real, g: vec3):
    """``V (2 mu strain + lambda trace I) g``."""
    return strain * g * (real(2.0) * e.mu[s]) + g * (e.lam[s] * trace)


@wp.func
def deformation(e: Elements, s: int, y: wp.array(dtype=vec3)) -> mat33:
    """``sum_i y_i g_i^T``: F for positions, its rate for velocities."""
    c = e.corners[s]
    y0 = y[c[0]]
    return (
        wp.outer(y[c[1]] - y0, e.gradient[s, 0])
        + wp.outer(y[c[2]] - y0, e.gradient[s, 1])
        + wp.outer(y[c[3]] - y0, e.gradient[s, 2])
    )


@wp.func
def strain_of(e: Elements, s: int, x: wp.array(dtype=vec3)) -> Strain:
    """Rotation, strain, elastic forces and energy of element ``s``."""
    q = Strain()
    f = deformation(e, s, x)
    r = nearest_rotation(f)
    rt = wp.transpose(r)
    stretch = rt * f
    stretch = (stretch + wp.transpose(stretch)) * real(0.5)
    one = real(1.0)
    zero = real(0.0)
    strain = stretch - mat33(one, zero, zero, zero, one, zero, zero, zero, one)
    trace = wp.trace(strain)
    q.rotation = r
    q.stretch = stretch
    q.trace = trace
    q.y1 = r * e.gradient[s, 0]
    q.y2 = r * e.gradient[s, 1]
    q.y3 = r * e.gradient[s, 2]
    q.p1 = r * stress_times(e, s, strain, trace, e.gradient[s, 0])
    q.p2 = r * stress_times(e, s, strain, trace, e.gradient[s, 1])
    q.p3 = r * stress_times(e, s, strain, trace, e.gradient[s, 2])
    q.energy = e.mu[s] * wp.ddot(strain, strain) + real(0.5) * e.lam[s] * trace * trace
    return q


@wp.func
def turned_rate(e: Elements, s: int, r: mat33, v: wp.array(dtype=vec3)) -> mat33:
    """``sym(R^T dF/dt)``, the rate of strain in the element's frame [1/s]."""
    rate = wp.transpose(r) * deformation(e, s, v)
    return (rate + wp.transpose(rate)) * real(0.5)


@wp.kernel
def corotational_forces(
    begin: int,
    elements: Elements,
    first: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """Forces on the corners [N] into ``force_out[first + 4 s + k]``, energy [J], power lost to damping [W]."""
    s = known(begin + wp.tid())
    q = strain_of(elements, s, x)
    f1 = -q.p1
    f2 = -q.p2
    f3 = -q.p3
    power = real(0.0)
    beta = elements.damping[s]
    if beta > real(0.0):
        rate = turned_rate(elements, s, q.rotation, v)
        trace = wp.trace(rate)
        f1 -= q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 0]) * beta
        f2 -= q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 1]) * beta
        f3 -= q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 2]) * beta
        power = beta * (real(2.0) * elements.mu[s] * wp.ddot(rate, rate) + elements.lam[s] * trace * trace)
    to = first + 4 * s
    force_out[to] = -(f1 + f2 + f3)
    force_out[to + 1] = f1
    force_out[to + 2] = f2
    force_out[to + 3] = f3
    energy_out[s] = q.energy
    power_out[s] = power


@wp.func
def positive_part(a: mat33) -> mat33:
    """A symmetric matrix with its negative eigenvalues put to zero (three Jacobi sweeps at most six)."""
    m = a
    zero = real(0.0)
    one = real(1.0)
    q = mat33(one, zero, zero, zero, one, zero, zero, zero, one)
    size = wp.ddot(a, a)
    sweep = int(0)
    going = int(1)
    while going == 1:
        left = zero
        for i in range(2):
            for j in range(i + 1, 3):
                off = m[i, j]
                left += off * off
                if off != zero:
                    ratio = (m[j, j] - m[i, i]) / (real(2.0) * off)
                    t = one / (wp.abs(ratio) + wp.sqrt(ratio * ratio + one))
                    if ratio < zero:
                        t = -t
                    c = one / wp.sqrt(t * t + one)
                    s = t * c
                    k = 3 - i - j
                    aki = m[k, i]
                    akj = m[k, j]
                    m[k, i] = c * aki - s * akj
                    m[i, k] = m[k, i]
                    m[k, j] = s * aki + c * akj
                    m[j, k] = m[k, j]
                    m[i, i] = m[i, i] - t * off
                    m[j, j] = m[j, j] + t * off
                    m[i, j] = zero
                    m[j, i] = zero
                    for n in range(3):
                        qa = q[n, i]
                        qb = q[n, j]
                        q[n, i] = c * qa - s * qb
                        q[n, j] = s * qa + c * qb
        sweep += 1
        if sweep == 8 or left <= real(1e-30) * size:
            going = 0
    r = mat33()
    for k in range(3):
        value = wp.max(m[k, k], zero)
        column = vec3(q[0, k], q[1, k], q[2, k])
        r += wp.outer(column, column) * value
    return r


@wp.func
def tension(e: Elements, s: int, q: Strain) -> mat33:
    """The positive part of T in world axes [J] (see the top of this file)."""
    mu = e.mu[s]
    factor = real(2.0) * mu - e.lam[s] * q.trace
    st = q.stretch
    total = wp.trace(st)
    one = real(1.0)
    zero = real(0.0)
    eye = mat33(one, zero, zero, zero, one, zero, zero, zero, one)
    g = eye * total - st
    # The inverse of G by its adjugate; G loses definiteness only for inverted elements, where nothing is added.
    a = vec3(g[0, 0], g[0, 1], g[0, 2])
    b = vec3(g[1, 0], g[1, 1], g[1, 2])
    c = vec3(g[2, 0], g[2, 1], g[2, 2])
    u = wp.cross(b, c)
    v = wp.cross(c, a)
    w = wp.cross(a, b)
    det = wp.dot(a, u)
    if det <= real(1e-3) * total * total * total or total <= zero:
        return mat33()
    t = eye * mu - from_rows(u, v, w) * (factor / det)
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
    rate = turned_rate(elements, s, q.rotation, v)
    trace = wp.trace(rate)
    k1 = -(q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 0]))
    k2 = -(q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 1]))
    k3 = -(q.rotation * stress_times(elements, s, rate, trace, elements.gradient[s, 2]))
    beta = elements.damping[s]
    f1 = k1 * beta - q.p1
    f2 = k2 * beta - q.p2
    f3 = k3 * beta - q.p3
    power = real(2.0) * elements.mu[s] * wp.ddot(rate, rate) + elements.lam[s] * trace * trace
    stiff = coefficients[1]
    both = coefficients[0] * beta + stiff
    y0 = -(q.y1 + q.y2 + q.y3)
    b01 = pair_block(elements, s, both, y0, q.y1)
    b02 = pair_block(elements, s, both, y0, q.y2)
    b03 = pair_block(elements, s, both, y0, q.y3)
    b12 = pair_block(elements, s, both, q.y1, q.y2)
    b13 = pair_block(elements, s, both, q.y1, q.y3)
    b23 = pair_block(elements, s, both, q.y2, q.y3)
    if stretched == 1:
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
    power_out[s] = beta * power


def gradients_at_rest(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients g_1, g_2, g_3 (n, 3, 3) [1/m] of the shape functions, and volumes (n,) [m^3], of corners (n, 4, 3)."""
    edges = rest[:, 1:] - rest[:, :1]  # rows are edge vectors: g_i . edge_j = 1 for i = j, else 0
    return np.linalg.inv(edges).transpose(0, 2, 1), np.linalg.det(edges) / 6.0


def lame(solid: Corotational) -> tuple[np.ndarray, np.ndarray]:
    """Lame's constants lambda, mu (n,) [Pa]."""
    e, nu = solid.youngs_modulus, solid.poissons_ratio
    return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))


def upload_corotational(solid: Corotational, device: str) -> Elements:
    """Arrays on ``device``."""
    gradient, volume = gradients_at_rest(solid.rest)
    lam, mu = lame(solid)
    out = Elements()
    out.corners = wp.array(np.ascontiguousarray(solid.corners, dtype=np.int32), dtype=wp.vec4i, device=device)
    out.gradient = wp.array(np.ascontiguousarray(gradient), dtype=wp.vec3d, device=device)
    for name, value in (("mu", volume * mu), ("lam", volume * lam), ("damping", solid.damping)):
        setattr(out, name, wp.array(np.ascontiguousarray(value, dtype=np.float64), dtype=wp.float64, device=device))
    return out
