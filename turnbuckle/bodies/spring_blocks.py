"""Springs in an implicit step: force, ``K v`` and a positive semi-definite block (`bodies.springs` has the energy).

With ``n = d / |d|`` and stiffness ``s = k / L^2`` [N/m], damping ``c = k_d / L^2`` [N s/m],

    -dF/dq = s (n n^T + max(0, 1 - L / |d|) (I - n n^T)),        -dF/dv = c n n^T

for the vector d between the ends. Under tension this is the exact derivative of the elastic force; under compression the
negative part is left out (Choi and Ko 2002). Damping acts along the spring only, so it never stops a rotation.
"""

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
TINY = wp.constant(wp.float64(1e-300))


@wp.kernel
def spring_system(
    begin: int,
    pairs: wp.array(dtype=wp.vec2i),
    inverse_length: wp.array(dtype=real),
    k: wp.array(dtype=real),
    k_d: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    coefficients: wp.array(dtype=real),
    force_out: wp.array(dtype=vec3),
    push_out: wp.array(dtype=vec3),
    block_out: wp.array(dtype=mat33),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """Force and ``K v`` on the second point, and the block (first, second) of ``-coefficients[0] D - coefficients[1] K``."""
    s = known(begin + wp.tid())
    pair = pairs[s]
    d = x[pair[1]] - x[pair[0]]
    w = v[pair[1]] - v[pair[0]]
    length = wp.sqrt(wp.dot(d, d) + TINY)
    n = d / length
    inverse = inverse_length[s]
    stretch = length * inverse - real(1.0)
    along = wp.dot(n, w)
    stiff = k[s] * inverse * inverse
    damp = k_d[s] * inverse * inverse
    across = stiff * wp.max(real(0.0), stretch / (stretch + real(1.0)))
    force_out[s] = -n * (k[s] * inverse * stretch + damp * along)
    push_out[s] = -n * ((stiff - across) * along) - w * across
    side = coefficients[1] * across
    main = coefficients[0] * damp + coefficients[1] * stiff - side
    zero = real(0.0)
    block_out[s] = wp.outer(n * (-main), n) - mat33(side, zero, zero, zero, side, zero, zero, zero, side)
    energy_out[s] = real(0.5) * k[s] * stretch * stretch
    power_out[s] = damp * along * along
