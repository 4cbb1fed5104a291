"""Point on a curve, on a surface, or in a domain of the user (Displacement, 4.1.3).

The host finds the nearest permissible point P_b' and the directions n held there (in b's frame), and looks again until P_a
is in the domain (`turnbuckle.step.domain_search`); between two looks the rows are ``n.(P_a - P_b') = 0``.
"""

import warp as wp

from turnbuckle.constraints.joints.places import Sides, force_row
from turnbuckle.data.articulated import Parts, RowTable

wp.set_module_options({"enable_backward": False})


@wp.func
def domain_rows(parts: Parts, rows: RowTable, part: int, i: int, sides: Sides, ahead: int, freeze: int):
    """One row a held direction."""
    d = sides.p - sides.o
    for k in range(3):
        n = wp.quat_rotate(sides.frame_b, parts.normal[3 * part + k])
        if freeze == 1 and ahead == 0:
            n = wp.quat_rotate(sides.frame_b, parts.normal0[3 * part + k])
        rows.s[i + k] = wp.dot(n, d)
        if freeze == 1:
            force_row(rows, i + k, sides, sides.p, n)
