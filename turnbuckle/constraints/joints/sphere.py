"""Point in sphere or shell, rod, rope (Displacement, 4.1.3): ``lo <= |P_a - P_b| <= hi``."""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, force_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def sphere_rows(rows: RowTable, i: int, sides: Sides, freeze: int):
    """The distance; its force acts along the line through both points, so that any point of it is common."""
    d = sides.p - sides.o
    distance = wp.length(d)
    rows.s[i] = distance
    if freeze == 1:
        out = axis(sides.frame_b, 2)
        if distance > real(1e-12):
            out = d / distance
        force_row(rows, i, sides, sides.p, out)
