"""Point to ring (Displacement, 4.1.2): P_a in the plane through P_b with normal z_b, at a distance in [lo, hi] from P_b.

``e_z.d = 0`` and ``lo <= |d - e_z (e_z.d)| <= hi``, with ``d = P_a - P_b``.
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, axis, force_row
from turnbuckle.data.articulated import RowTable
from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def ring_rows(rows: RowTable, i: int, count: int, sides: Sides, freeze: int):
    """The row along the normal, and the radial one where ``count`` is 2."""
    d = sides.p - sides.o
    e = axis(sides.frame_b, 2)
    height = wp.dot(e, d)
    rows.s[i] = height
    if freeze == 1:
        force_row(rows, i, sides, sides.p, e)
    if count == 2:
        radial = d - e * height
        radius = wp.length(radial)
        rows.s[i + 1] = radius
        if freeze == 1:
            out = axis(sides.frame_b, 0)
            if radius > real(1e-12):
                out = radial / radius
            force_row(rows, i + 1, sides, sides.p, out)
