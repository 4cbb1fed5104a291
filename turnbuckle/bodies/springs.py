"""Springs: the distance energy of Teschner, Heidelberger, Mueller, Gross 2004 on pairs of points.

``C = (|x_b - x_a| - L) / L``, ``E = k C^2 / 2``; the force on b is ``-(k C + k_d dC/dt) dC/dx_b`` with
``dC/dx_b = n / L``. A spring of stiffness s [N/m] and damping c [N s/m] has ``k = s L^2``, ``k_d = c L^2``.
"""

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1e-300))


@wp.kernel
def spring_forces(
    begin: int,
    pairs: wp.array(dtype=wp.vec2i),
    inverse_length: wp.array(dtype=real),
    k: wp.array(dtype=real),
    k_d: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    force_out: wp.array(dtype=vec3),
    energy_out: wp.array(dtype=real),
    power_out: wp.array(dtype=real),
):
    """Force on the second point of each spring [N], its energy [J], and the power lost to its damping [W]."""
    s = known(begin + wp.tid())
    pair = pairs[s]
    d = x[pair[1]] - x[pair[0]]
    w = v[pair[1]] - v[pair[0]]
    length = wp.sqrt(wp.dot(d, d) + TINY)
    stretch = length * inverse_length[s] - real(1.0)
    gradient = d * (inverse_length[s] / length)
    rate = wp.dot(gradient, w)
    force_out[s] = -gradient * (k[s] * stretch + k_d[s] * rate)
    energy_out[s] = real(0.5) * k[s] * stretch * stretch
    power_out[s] = k_d[s] * rate * rate
