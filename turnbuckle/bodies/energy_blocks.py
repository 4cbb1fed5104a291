"""Areas and volumes of Teschner, Heidelberger, Mueller, Gross 2004 in an implicit step (`bodies.tetrahedra` has the energies).

``E = k C^2 / 2`` with ``g = dC/dx``. The Jacobians are made of outer products ``z z^T`` over the points of an element:

* ``k g g^T`` and ``k_d g g^T``, the part that is positive semi-definite always (Gauss-Newton);
* of a stretched area, what it resists leaving its plane with: ``k C / (2 A0 |n|) sum_t (N^T t)(N^T t)^T`` with t the two
  directions in the plane and ``N = dn/dx``. Without it a taut membrane's waves would be treated explicitly.

(The other parts of the second derivatives have both signs. Distances are springs, see `bodies.spring_blocks`.)
"""

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1e-300))


@wp.kernel
def area_system(
    begin: int,
    triangles: wp.array(dtype=wp.vec3i),
    area: wp.array(dtype=real),
    k: wp.array(dtype=real),
    k_d: wp.array(dtype=real),
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
    """Forces and ``K v`` on three points at ``first + 3 s``; three vectors z, each over three points, at ``first_vector + 9 s``."""
    s = known(begin + wp.tid())
    c = triangles[s]
    x0 = x[c[0]]
    e1 = x[c[1]] - x0
    e2 = x[c[2]] - x0
    w1 = v[c[1]] - v[c[0]]
    w2 = v[c[2]] - v[c[0]]
    n = wp.cross(e1, e2)
    size = wp.sqrt(wp.dot(n, n) + TINY)
    m = n / size
    half = real(0.5) / area[s]
    strain = size * half - real(1.0)
    g1 = wp.cross(e2, m) * half
    g2 = wp.cross(m, e1) * half
    rate = wp.dot(g1, w1) + wp.dot(g2, w2)
    f = -(k[s] * strain + k_d[s] * rate)
    root = wp.sqrt(coefficients[0] * k_d[s] + coefficients[1] * k[s])
    taut = k[s] * wp.max(strain, real(0.0)) * half / size
    t1 = e1 / wp.sqrt(wp.dot(e1, e1) + TINY)
    t2 = wp.cross(m, t1)
    p1 = wp.cross(e2, t1)
    p2 = wp.cross(t1, e1)
    q1 = wp.cross(e2, t2)
    q2 = wp.cross(t2, e1)
    p = wp.dot(p1, w1) + wp.dot(p2, w2)
    q = wp.dot(q1, w1) + wp.dot(q2, w2)
    push1 = g1 * (-k[s] * rate) - (p1 * p + q1 * q) * taut
    push2 = g2 * (-k[s] * rate) - (p2 * p + q2 * q) * taut
    side = wp.sqrt(coefficients[1] * taut)
    to = first + 3 * s
    force_out[to] = -(g1 + g2) * f
    force_out[to + 1] = g1 * f
    force_out[to + 2] = g2 * f
    push_out[to] = -(push1 + push2)
    push_out[to + 1] = push1
    push_out[to + 2] = push2
    at = first_vector + 9 * s
    vector_out[at] = -(g1 + g2) * root
    vector_out[at + 1] = g1 * root
    vector_out[at + 2] = g2 * root
    vector_out[at + 3] = -(p1 + p2) * side
    vector_out[at + 4] = p1 * side
    vector_out[at + 5] = p2 * side
    vector_out[at + 6] = -(q1 + q2) * side
    vector_out[at + 7] = q1 * side
    vector_out[at + 8] = q2 * side
    energy_out[s] = real(0.5) * k[s] * strain * strain
    power_out[s] = k_d[s] * rate * rate


@wp.kernel
def volume_system(
    begin: int,
    corners: wp.array(dtype=wp.vec4i),
    volume: wp.array(dtype=real),
    k: wp.array(dtype=real),
    k_d: wp.array(dtype=real),
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
    """Forces and ``K v`` on four points at ``first + 4 s``, the vector z over them at ``first_vector + 4 s``."""
    s = known(begin + wp.tid())
    c = corners[s]
    x0 = x[c[0]]
    v0 = v[c[0]]
    a = x[c[1]] - x0
    b = x[c[2]] - x0
    d = x[c[3]] - x0
    scale = real(1.0) / (real(6.0) * volume[s])
    g1 = wp.cross(b, d) * scale
    g2 = wp.cross(d, a) * scale
    g3 = wp.cross(a, b) * scale
    g0 = -(g1 + g2 + g3)
    strain = wp.dot(a, g1) - real(1.0)
    rate = wp.dot(g1, v[c[1]] - v0) + wp.dot(g2, v[c[2]] - v0) + wp.dot(g3, v[c[3]] - v0)
    f = -(k[s] * strain + k_d[s] * rate)
    push = -k[s] * rate
    root = wp.sqrt(coefficients[0] * k_d[s] + coefficients[1] * k[s])
    to = first + 4 * s
    force_out[to] = g0 * f
    force_out[to + 1] = g1 * f
    force_out[to + 2] = g2 * f
    force_out[to + 3] = g3 * f
    push_out[to] = g0 * push
    push_out[to + 1] = g1 * push
    push_out[to + 2] = g2 * push
    push_out[to + 3] = g3 * push
    at = first_vector + 4 * s
    vector_out[at] = g0 * root
    vector_out[at + 1] = g1 * root
    vector_out[at + 2] = g2 * root
    vector_out[at + 3] = g3 * root
    energy_out[s] = real(0.5) * k[s] * strain * strain
    power_out[s] = k_d[s] * rate * rate
