"""Bending of cloth: ``E = k (theta - theta_0)^2 / 2`` of the dihedral angle at inner edges.

The points of a hinge are x0, x1 of the shared edge and x2, x3 opposite to it. With ``n1 = (x1 - x0) x (x2 - x0)`` and
``n2 = (x3 - x0) x (x1 - x0)``, which point to the same side where the cloth is flat,

    theta = atan2((n1 x n2) . e, n1 . n2),        e = (x1 - x0) / |x1 - x0|,

zero when flat and never ambiguous short of a full fold. With the heights h1, h2 of x2, x3 over the edge and the unit
normals N1, N2 (Bridson, Marino, Fedkiw 2003; Grinspun et al. 2003)

    dtheta/dx2 = -N1 / h1,   dtheta/dx3 = -N2 / h2,   dtheta/dx0 = N1 (1 - a1) / h1 + N2 (1 - a2) / h2,
    dtheta/dx1 = N1 a1 / h1 + N2 a2 / h2,

where a1, a2 are the places of the feet of the heights along the edge. These sum to zero and have no moment. Where a
triangle or the edge is nearly gone, the gradient is scaled down as a whole, by the smaller height (and the edge) over the
least that counts: forces stay bounded, and keep both sums. The Jacobian is the positive semi-definite ``-dF/dq = k g g^T``, damping ``-dF/dv = k_d g g^T``.
"""

import numpy as np
import warp as wp

from turnbuckle.data.model import Hinges
from turnbuckle.math.index import known
from turnbuckle.math.rotation import wrapped
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1e-300))
LEAST = 1e-2  # of the edge, and of the lower height, at rest: what is smaller than that bends less


@wp.struct
class HingeArrays:
    """Constant data of hinges (see `turnbuckle.data.model.Hinges`)."""

    points: wp.array(dtype=wp.vec4i)
    angle: wp.array(dtype=real)
    k: wp.array(dtype=real)
    k_d: wp.array(dtype=real)
    least_edge: wp.array(dtype=real)  # (n,) [m] a shared edge shorter than that bends less
    least_height: wp.array(dtype=real)  # (n,) [m] triangles with a height below that, too


@wp.struct
class Bend:
    """The angle's offset from rest [rad] and its gradient [rad/m]."""

    angle: real
    g0: vec3
    g1: vec3
    g2: vec3
    g3: vec3


@wp.func
def bend_of(h: HingeArrays, s: int, x: wp.array(dtype=vec3)) -> Bend:
    """Angle and gradient of hinge ``s``."""
    c = h.points[s]
    x0 = x[c[0]]
    d = x[c[1]] - x0
    a = x[c[2]] - x0
    b = x[c[3]] - x0
    size = wp.sqrt(wp.dot(d, d) + TINY)
    e = d / size
    n1 = wp.cross(d, a)
    n2 = wp.cross(b, d)
    l1 = wp.sqrt(wp.dot(n1, n1) + TINY)
    l2 = wp.sqrt(wp.dot(n2, n2) + TINY)
    angle = wp.atan2(wp.dot(wp.cross(n1, n2), e), wp.dot(n1, n2))
    h1 = l1 / size
    h2 = l2 / size
    whole = wp.min(real(1.0), wp.min(h1, h2) / h.least_height[s]) * wp.min(real(1.0), size / h.least_edge[s])
    u1 = n1 * (whole / (h1 * l1))
    u2 = n2 * (whole / (h2 * l2))
    a1 = wp.dot(a, e) / size
    a2 = wp.dot(b, e) / size
    r = Bend()
    r.angle = wrapped(angle - h.angle[s])
    r.g2 = -u1
    r.g3 = -u2
    r.g1 = u1 * a1 + u2 * a2
    r.g0 = u1 + u2 - r.g1
    return r


@wp.func
def rate_of(h: HingeArrays, s: int, b: Bend, v: wp.array(dtype=vec3)) -> real:
    """dtheta/dt [rad/s]."""
    c = h.points[s]
    return wp.dot(b.g0, v[c[0]]) + wp.dot(b.g1, v[c[1]]) + wp.dot(b.g2, v[c[2]]) + wp.dot(b.g3, v[c[3]])


@wp.kernel
def hinge_forces(
    begin: int,
    hinges: HingeArrays,
    first: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """Forces on the four points [N] into ``force_out[first + 4 s + k]``, energy [J], power lost to damping [W]."""
    s = known(begin + wp.tid())
    b = bend_of(hinges, s, x)
    rate = rate_of(hinges, s, b, v)
    f = -(hinges.k[s] * b.angle + hinges.k_d[s] * rate)
    to = first + 4 * s
    force_out[to] = b.g0 * f
    force_out[to + 1] = b.g1 * f
    force_out[to + 2] = b.g2 * f
    force_out[to + 3] = b.g3 * f
    energy_out[s] = real(0.5) * hinges.k[s] * b.angle * b.angle
    power_out[s] = hinges.k_d[s] * rate * rate


@wp.kernel
def hinge_system(
    begin: int,
    hinges: HingeArrays,
    first: int,
    first_vector: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    coefficients: wp.array(dtype=real),
    force_out: wp.array(dtype=vec3),
    push_out: wp.array(dtype=vec3),
    vector_out: wp.array(dtype=vec3),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """As `hinge_forces`; ``K v``; and z with ``z z^T = -coefficients[0] D - coefficients[1] K`` at ``first_vector + 4 s``."""
    s = known(begin + wp.tid())
    b = bend_of(hinges, s, x)
    rate = rate_of(hinges, s, b, v)
    k = hinges.k[s]
    k_d = hinges.k_d[s]
    f = -(k * b.angle + k_d * rate)
    push = -k * rate
    root = wp.sqrt(coefficients[0] * k_d + coefficients[1] * k)
    to = first + 4 * s
    force_out[to] = b.g0 * f
    force_out[to + 1] = b.g1 * f
    force_out[to + 2] = b.g2 * f
    force_out[to + 3] = b.g3 * f
    push_out[to] = b.g0 * push
    push_out[to + 1] = b.g1 * push
    push_out[to + 2] = b.g2 * push
    push_out[to + 3] = b.g3 * push
    at = first_vector + 4 * s
    vector_out[at] = b.g0 * root
    vector_out[at + 1] = b.g1 * root
    vector_out[at + 2] = b.g2 * root
    vector_out[at + 3] = b.g3 * root
    energy_out[s] = real(0.5) * k * b.angle * b.angle
    power_out[s] = k_d * rate * rate


def upload_hinges(hinges: Hinges, rest: np.ndarray, device: str) -> HingeArrays:
    """Arrays on ``device``. ``rest`` (points, 3) [m]: where triangles have their size."""
    x0, x1, x2, x3 = (rest[hinges.points[:, k]] for k in range(4))
    edge = np.maximum(np.linalg.norm(x1 - x0, axis=1), 1e-100)
    areas = [np.linalg.norm(np.cross(x1 - x0, p - x0), axis=1) for p in (x2, x3)]
    out = HingeArrays()
    out.points = wp.array(np.ascontiguousarray(hinges.points, dtype=np.int32), dtype=wp.vec4i, device=device)
    values = {"angle": hinges.angle, "k": hinges.k, "k_d": hinges.k_d}
    values["least_edge"] = LEAST * edge
    values["least_height"] = np.maximum(LEAST * np.minimum(*areas) / edge, 1e-100)
    for name, value in values.items():
        setattr(out, name, wp.array(np.ascontiguousarray(value, dtype=np.float64), dtype=wp.float64, device=device))
    return out
