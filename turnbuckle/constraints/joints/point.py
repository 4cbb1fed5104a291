"""Point to point (Displacement, section 3): ``P_a = P_b``, three rows along the world's axes."""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, force_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def point_rows(rows: RowTable, i: int, sides: Sides, freeze: int):
    """``s = P_a - P_b``."""
    d = sides.p - sides.o
    for k in range(3):
        rows.s[i + k] = d[k]
        if freeze == 1:
            e = vec3()
            e[k] = real(1.0)
            force_row(rows, i + k, sides, sides.p, e)
