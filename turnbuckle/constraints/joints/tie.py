"""Points of rigid bodies and mass points, tied by weights: ``sum_k w_k X_k = goal``.

The point constraints of Local (nail, points to point, attach, slide) where a point of a rigid body takes part: a nail is
one point of weight 1, two joined points have weights 1 and -1, an attachment has 1 and its barycentric weights, negative.
"""

import warp as wp

from turnbuckle.data.articulated import EACH, Bodies, Parts, RowTable, TiedPoints
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def tie_rows(parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, p: int, ahead: int, freeze: int):
    """Three rows along the world's axes, at the end of the step (at its start a tie is as good as kept)."""
    total = -parts.goal[p]
    for e in range(parts.tie[p], parts.tie[p + 1]):
        b = parts.tie_body[e]
        if b < 0:
            total += points.x[points.point[parts.tie_point[e]]] * parts.tie_weight[e]
        elif ahead == 1:
            total += (bodies.x1[b] + wp.quat_rotate(bodies.q1[b], parts.tie_local[e])) * parts.tie_weight[e]
        else:
            total += (bodies.x0[b] + wp.quat_rotate(bodies.q0[b], parts.tie_local[e])) * parts.tie_weight[e]
    i = EACH * p
    for k in range(parts.rows[p]):
        n = vec3()
        n[k] = real(1.0)
        if parts.rows[p] < 3 or wp.length_sq(parts.normal[3 * p]) > real(0.0):
            n = parts.normal[3 * p + k]
        rows.s[i + k] = wp.dot(n, total)
        if freeze == 1:
            rows.line[i + k] = n
