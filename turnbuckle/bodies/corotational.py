"""Corotational linear tetrahedra: Mueller and Gross 2004 (Interactive Virtual Materials), with the nearest rotation.

With the gradients g_i of the shape functions at rest, ``F = sum_i x_i g_i^T``, R its nearest rotation (`polar`) and the
strain ``e = sym(R^T F) - I = S - I``, an element of rest volume V has the energy and the forces

    E = V (mu e:e + lambda/2 tr(e)^2),        f_i = -R K_e (R^T x - X) = -V R (2 mu e + lambda tr(e) I) g_i.

Because R maximises ``R : F``, it does not move E to first order, and ``f = -dE/dx`` exactly, inverted elements included
(rotations made in another way, as by orthonormalising edges, lack this). e commutes with S, so forces have no moment.

Damping is ``beta`` [s] times the same stiffness on the rate of strain. The rate ``sym(R^T dF/dt)`` is that of the paper's
``R K_e R^T v``; but it sees a rigid rotation of a strained element, brakes it and takes angular momentum. What counts here
is dS/dt: with w the axial vector of ``skew(R^T dF/dt)`` and ``G = tr(S) I - S``, R turns by ``omega = 2 G^-1 w`` in its own frame
and

    dS/dt = sym(R^T dF/dt) - sym([omega]x S),        f_i = -beta V R (sigma g_i - G^-1 c x g_i),

``sigma = 2 mu dS/dt + lambda tr(dS/dt) I`` and c the axial vector of ``2 skew(sigma S)``. Both rates are the same at rest. Where G is not safely
positive (elements inside out), the paper's rate is taken. `corotational_blocks` has the Jacobians.
"""

import numpy as np
import warp as wp

from turnbuckle.bodies.polar import from_rows, nearest_rotation
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Corotational
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
SAFE = wp.constant(wp.float64(1e-3))  # of tr(S)^3: a determinant of G below it (8/27 at rest) is not trusted


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
    turning: mat33  # G^-1, zero where G is not safely positive


@wp.func
def stress(e: Elements, s: int, strain: mat33, trace: real) -> mat33:
    """``V (2 mu strain + lambda trace I)`` [J]."""
    d = e.lam[s] * trace
    zero = real(0.0)
    return strain * (real(2.0) * e.mu[s]) + mat33(d, zero, zero, zero, d, zero, zero, zero, d)


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
    sigma = stress(e, s, strain, trace)
    q.p1 = r * (sigma * e.gradient[s, 0])
    q.p2 = r * (sigma * e.gradient[s, 1])
    q.p3 = r * (sigma * e.gradient[s, 2])
    q.turning = inverse_turning(stretch)
    q.energy = e.mu[s] * wp.ddot(strain, strain) + real(0.5) * e.lam[s] * trace * trace
    return q


@wp.func
def inverse_turning(stretch: mat33) -> mat33:
    """``G^-1`` for ``G = tr(S) I - S``; zero where G is not safely positive."""
    zero = real(0.0)
    total = wp.trace(stretch)
    g = mat33(total, zero, zero, zero, total, zero, zero, zero, total) - stretch
    a = vec3(g[0, 0], g[0, 1], g[0, 2])
    b = vec3(g[1, 0], g[1, 1], g[1, 2])
    c = vec3(g[2, 0], g[2, 1], g[2, 2])
    u = wp.cross(b, c)
    det = wp.dot(a, u)
    if total <= zero or det <= SAFE * total * total * total:  # G's smallest eigenvalue is the sum of S's two smallest
        return mat33()
    return from_rows(u, wp.cross(c, a), wp.cross(a, b)) * (real(1.0) / det)


@wp.func
def axial(m: mat33) -> vec3:
    """The axial vector of ``m - m^T``: ``[axial]x = m - m^T``."""
    return vec3(m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])


@wp.func
def strain_rate(q: Strain, rate: mat33) -> mat33:
    """dS/dt of ``rate = R^T dF/dt``."""
    turn = wp.skew(q.turning * axial(rate)) * q.stretch  # axial(rate) = 2 w
    whole = rate - turn
    return (whole + wp.transpose(whole)) * real(0.5)


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
        rate = strain_rate(q, wp.transpose(q.rotation) * deformation(elements, s, v))
        trace = wp.trace(rate)
        sigma = stress(elements, s, rate, trace)
        turn = q.turning * axial(sigma * q.stretch)
        f1 -= q.rotation * (sigma * elements.gradient[s, 0] - wp.cross(turn, elements.gradient[s, 0])) * beta
        f2 -= q.rotation * (sigma * elements.gradient[s, 1] - wp.cross(turn, elements.gradient[s, 1])) * beta
        f3 -= q.rotation * (sigma * elements.gradient[s, 2] - wp.cross(turn, elements.gradient[s, 2])) * beta
        power = beta * wp.ddot(sigma, rate)
    to = first + 4 * s
    force_out[to] = -(f1 + f2 + f3)
    force_out[to + 1] = f1
    force_out[to + 2] = f2
    force_out[to + 3] = f3
    energy_out[s] = q.energy
    power_out[s] = power


def gradients_at_rest(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients g_1, g_2, g_3 (n, 3, 3) [1/m] of the shape functions, and volumes (n,) [m^3], of corners (n, 4, 3)."""
    edges = rest[:, 1:] - rest[:, :1]  # rows are edge vectors: g_i . edge_j = 1 for i = j, else 0
    return np.linalg.inv(edges).transpose(0, 2, 1), np.linalg.det(edges) / 6.0


def lame(solid: Corotational) -> tuple[np.ndarray, np.ndarray]:
    """Lame's constants lambda, mu (n,) [Pa]."""
    e, nu = solid.youngs_modulus, solid.poissons_ratio
    return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))


def upload_corotational(solid: Corotational, device: str) -> Elements:
    """Arrays on ``device``. Raises `InputError` for an element without volume at rest."""
    edges = solid.rest[:, 1:] - solid.rest[:, :1]
    flat = np.flatnonzero(~(np.linalg.det(edges) > 0.0))
    if len(flat):
        corners = ", ".join(str(c) for c in solid.corners[flat[0]])
        raise InputError(
            f"tetrahedron {flat[0]} of corotational solids, of points {corners}, is flat or inside out at rest; mend its mesh"
        )
    gradient, volume = gradients_at_rest(solid.rest)
    lam, mu = lame(solid)
    out = Elements()
    out.corners = wp.array(np.ascontiguousarray(solid.corners, dtype=np.int32), dtype=wp.vec4i, device=device)
    out.gradient = wp.array(np.ascontiguousarray(gradient), dtype=wp.vec3d, device=device)
    for name, value in (("mu", volume * mu), ("lam", volume * lam), ("damping", solid.damping)):
        setattr(out, name, wp.array(np.ascontiguousarray(value, dtype=np.float64), dtype=wp.float64, device=device))
    return out
