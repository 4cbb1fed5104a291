"""Point to segment (Displacement, 4.1.1): ``P_a = P_b + lambda z_b``, lambda in [lo, hi].

With e_x, e_y, e_z the axes of the frame of b and ``d = P_a - P_b``: ``e_x.d = 0``, ``e_y.d = 0``, ``lo <= e_z.d <= hi``.
The e turn with b, so the rate of ``e.d`` is that of the material points of both bodies *at P_a*: the common point.
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, force_row
from turnbuckle.data.articulated import RowTable

wp.set_module_options({"enable_backward": False})


@wp.func
def segment_rows(rows: RowTable, i: int, count: int, sides: Sides, freeze: int):
    """Rows across the line, and the place along it where ``count`` is 3."""
    d = sides.p - sides.o
    for k in range(count):
        e = axis(sides.frame_b, k)
        rows.s[i + k] = wp.dot(e, d)
        if freeze == 1:
            force_row(rows, i + k, sides, sides.p, e)


@wp.func
def place_row(rows: RowTable, i: int, sides: Sides, freeze: int):
    """The place along the line alone."""
    e = axis(sides.frame_b, 2)
    rows.s[i] = wp.dot(e, sides.p - sides.o)
    if freeze == 1:
        force_row(rows, i, sides, sides.p, e)
