"""Forces on points: what the elements around each point exert on it, gathered in a fixed order, plus gravity."""

import warp as wp

from turnbuckle.data.state import GRAVITY
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.kernel
def gather_forces(
    begin: int,
    mass: wp.array(dtype=real),
    offsets: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    element_force: wp.array(dtype=vec3),
    params: wp.array(dtype=real),
    force_out: wp.array(dtype=vec3),
):
    """``F_i = m_i g + sum_slots +-element_force`` [N]; a slot ``~s`` (negative) subtracts slot s."""
    i = known(begin + wp.tid())
    m = mass[i]
    fx = m * params[GRAVITY]  # numbers, not a vector: the sums stay in registers
    fy = m * params[GRAVITY + 1]
    fz = m * params[GRAVITY + 2]
    for k in range(offsets[i], offsets[i + 1]):
        slot = slots[known(k)]
        f = element_force[wp.max(slot, -slot - 1)]
        if slot < 0:
            f = -f
        fx += f[0]
        fy += f[1]
        fz += f[2]
    force_out[i] = vec3(fx, fy, fz)
