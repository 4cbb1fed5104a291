"""All rows of an island in one sparse symmetric system, solved directly.

    [ M  J^T ] [ dv ]   [ 0 ]
    [ J  -C  ] [  y ] = [ -g ],      y = -(impulse),

M: masses and world inertias, with the geometric stiffness of the flight where the caller adds it; J: the rows with the directions
that the caller has put into the table (`line`, `t_a`, `t_b`: of the start, the middle or the end of the step); C: the
flexibility of soft rows. A row that does not act (a limit that is not reached) has a zero Jacobian and the pivot -1. `turnbuckle.linalg.elimination` orders the blocks;
rows that repeat others are found by their pivots and dropped.
"""

import warp as wp

from turnbuckle.data.articulated import EACH, LIMIT, MOTOR, NONE, SOFT, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.linalg.block_ldl import BlockMatrix, backward_node, factor_node, forward_node
from turnbuckle.math.index import known
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


@wp.func
def acts(parts: Parts, rows: RowTable, p: int, i: int):
    """1 where row ``i`` of part ``p`` is in the system."""
    mode = rows.mode[i]
    if parts.on[p] == 0 or mode == NONE:
        return 0
    if mode == LIMIT or mode == SOFT:
        return wp.abs(rows.active[i])
    if mode == MOTOR:
        return 1 - wp.abs(rows.active[i])
    return 1


@wp.func
def put_row(
    m: BlockMatrix, place: int, above: int, r: int, count: int, columns: int, linear: vec3, angular: vec3, factor: real
):
    """Add ``factor (linear, angular)`` as row ``r`` of a Jacobian block."""
    for c in range(columns):
        value = real(0.0)
        if c < 3:
            value = linear[c]
        else:
            value = angular[c - 3]
        k = known(place + r * columns + c)
        if above == 1:
            k = known(place + c * count + r)
        m.value[k] += value * factor


@wp.func
def mobility(bodies: Bodies, q: wp.quatd, b: int, linear: vec3, angular: vec3):
    """``(linear, angular) M^-1 (linear, angular)`` of a body."""
    free = turned_inertia(q, bodies.inverse_inertia[b], angular)
    return wp.length_sq(linear) * bodies.inverse_mass[b] + wp.dot(free, angular)


@wp.func
def tie_arm(parts: Parts, bodies: Bodies, e: int, b: int, ahead: int):
    """From the centre of body ``b`` to its point of the tie, at the start (0), the end (1) or in the middle (2) of the step."""
    if ahead == 0:
        return wp.quat_rotate(bodies.q0[b], parts.tie_local[e])
    if ahead == 1:
        return wp.quat_rotate(bodies.q1[b], parts.tie_local[e])
    there = wp.quat_rotate(bodies.q0[b], parts.tie_local[e])
    return (there + wp.quat_rotate(bodies.q1[b], parts.tie_local[e])) * real(0.5)


@wp.func
def stiffen(m: BlockMatrix, place: int, arm: vec3, pull: vec3):
    """Add the stiffness that a pull gives to the rotation of a body about its centre (geometric stiffness).

    The torque ``arm x pull`` of a force that keeps its direction changes by ``-K dtheta`` when the arm turns. K is symmetrised
    and freed of its negative part: with the angle phi between both and b halfway between them,
    ``K = |arm| |pull| (1 + cos phi) / 2 (I - b b^T)``. It steers Newton's method and is in no equation of motion.
    """
    a = wp.length(arm)
    f = wp.length(pull)
    if a * f > real(0.0):
        b = arm / a + pull / f
        n = wp.length_sq(b)  # 2 + 2 cos phi
        if n > real(1e-6):
            k = a * f * n * real(0.25)
            for r in range(3):
                for c in range(3):
                    value = -k * b[r] * b[c] / n
                    if r == c:
                        value += k
                    m.value[known(place + 21 + 6 * r + c)] += value


@wp.func
def stiffen_part(
    parts: Parts, rows: RowTable, bodies: Bodies, m: BlockMatrix, node_of: wp.array(dtype=wp.int32), p: int, h: real
):
    """Geometric stiffness of part ``p``, of a flight whose impulses act with the arms of its middle: ``h/2 K``."""
    pull = vec3()
    at = vec3()
    for r in range(parts.rows[p]):
        i = known(EACH * p + r)
        pull += rows.line[i] * (rows.impulse[i] * real(0.5) * h)
        if wp.length_sq(rows.line[i]) > real(0.0):
            at = rows.at[i]
    if parts.tie[p + 1] > parts.tie[p]:
        for e in range(parts.tie[p], parts.tie[p + 1]):
            if parts.tie_body[e] >= 0 and parts.tie_place[e] >= 0:
                b = parts.tie_body[e]
                place = m.diagonal[known(node_of[b])]
                stiffen(m, place, tie_arm(parts, bodies, e, b, 2), pull * parts.tie_weight[e])
        return
    a = known(parts.a[p])
    b = known(parts.b[p])
    if parts.place_a[p] >= 0:
        stiffen(m, m.diagonal[known(node_of[a])], at - (bodies.x0[a] + bodies.x1[a]) * real(0.5), pull)
    if parts.place_b[p] >= 0:
        stiffen(m, m.diagonal[known(node_of[b])], at - (bodies.x0[b] + bodies.x1[b]) * real(0.5), -pull)


@wp.func
def assemble_masses(islands: Islands, bodies: Bodies, points: TiedPoints, m: BlockMatrix, island: int, ahead: int):
    """Diagonal blocks of bodies at the end (``ahead`` 1) or the start of the step, and of mass points; zeros elsewhere."""
    first = islands.node[island]
    last = islands.node[island + 1]
    if last == first:
        return
    for k in range(first, last):
        n = m.size[known(k)]
        d = m.diagonal[known(k)]
        for i in range(n * n):
            m.value[known(d + i)] = real(0.0)
        for e in range(m.column[k], m.column[k + 1]):
            b = m.block[known(e)]
            for i in range(n * m.size[known(m.row[known(e)])]):
                m.value[known(b + i)] = real(0.0)
        s = m.scalar[known(k)]
        for i in range(n):
            m.scale[known(s + i)] = real(0.0)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        d = m.diagonal[known(islands.body_node[known(i)])]
        q = bodies.q0[b]
        if ahead == 1:
            q = bodies.q1[b]
        turn = wp.quat_to_matrix(q)
        j = turn * wp.diag(bodies.inertia[b]) * wp.transpose(turn)
        for r in range(3):
            m.value[known(d + 7 * r)] = bodies.mass[b]
            for c in range(3):
                m.value[known(d + 21 + 6 * r + c)] = j[r, c]
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        d = m.diagonal[known(islands.point_node[known(i)])]
        for r in range(3):
            m.value[known(d + 4 * r)] = points.mass[known(islands.point[known(i)])]


@wp.func
def assemble_part(
    parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, m: BlockMatrix, p: int, ahead: int, soft: real
):
    """Jacobians and pivots of part ``p``; ``soft``: flexibility of its soft rows."""
    count = parts.rows[p]
    node = known(parts.node[p])
    d = m.diagonal[node]
    s = m.scalar[node]
    a = known(parts.a[p])
    b = known(parts.b[p])
    for r in range(count):
        i = known(EACH * p + r)
        k = known(d + r * count + r)
        if acts(parts, rows, p, i) == 0:
            m.value[k] = real(-1.0)
            m.scale[known(s + r)] = real(0.0)
            continue
        scale = real(0.0)
        if rows.mode[i] == SOFT:
            m.value[k] = -soft
        line = rows.line[i]
        if parts.tie[p + 1] > parts.tie[p]:
            for e in range(parts.tie[p], parts.tie[p + 1]):
                w = parts.tie_weight[e]
                body = parts.tie_body[e]
                if body < 0:
                    scale += w * w / points.mass[parts.tie_point[e]]
                    put_row(m, parts.tie_place[e], parts.tie_above[e], r, count, 3, line, line, w)
                elif parts.tie_place[e] >= 0:
                    q = bodies.q0[body]
                    if ahead == 1:
                        q = bodies.q1[body]
                    t = wp.cross(tie_arm(parts, bodies, e, body, ahead), line)
                    scale += w * w * mobility(bodies, q, body, line, t)
                    put_row(m, parts.tie_place[e], parts.tie_above[e], r, count, 6, line, t, w)
        else:
            if parts.place_a[p] >= 0:
                q = bodies.q0[a]
                if ahead == 1:
                    q = bodies.q1[a]
                scale += mobility(bodies, q, a, line, rows.t_a[i])
                put_row(m, parts.place_a[p], parts.above_a[p], r, count, 6, line, rows.t_a[i], real(1.0))
            if parts.place_b[p] >= 0:
                q = bodies.q0[b]
                if ahead == 1:
                    q = bodies.q1[b]
                scale += mobility(bodies, q, b, line, rows.t_b[i])
                put_row(m, parts.place_b[p], parts.above_b[p], r, count, 6, line, rows.t_b[i], real(-1.0))
        m.scale[known(s + r)] = wp.max(scale, real(1e-300))


@wp.func
def factor_island(
    islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, m: BlockMatrix, island: int,
    ahead: int, h: real, rank: real,
):  # fmt: skip
    """Assemble and factor the system of an island, at the end of the step (``ahead`` 1) or for its flight (2)."""
    assemble_masses(islands, bodies, points, m, island, ahead)
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        soft = real(0.0)
        if parts.stiffness[p] > real(0.0) or parts.damping[p] > real(0.0):
            soft = real(2.0) / (h * h * (real(0.5) * parts.stiffness[p] + parts.damping[p] / h))
        assemble_part(parts, rows, bodies, points, m, p, ahead, soft)
        if ahead == 2:
            stiffen_part(parts, rows, bodies, m, islands.node_of, p, h)
    for k in range(islands.node[island], islands.node[island + 1]):
        factor_node(m, k, rank)
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        s = m.scalar[known(parts.node[p])]
        for r in range(parts.rows[p]):
            repeats = int(0)
            if m.inverse[known(s + r)] == real(0.0):
                repeats = 1
            rows.dropped[known(EACH * p + r)] = repeats


@wp.func
def solve_island(islands: Islands, m: BlockMatrix, island: int):
    """Solve with the factor: ``m.x`` from right side to solution."""
    first = islands.node[island]
    last = islands.node[island + 1]
    for k in range(first, last):
        forward_node(m, k)
    for k in range(last - first):
        backward_node(m, last - 1 - k)


@wp.func
def clear_right_side(islands: Islands, m: BlockMatrix, island: int):
    """``m.x = 0`` on the island."""
    for k in range(islands.node[island], islands.node[island + 1]):
        s = m.scalar[known(k)]
        for r in range(m.size[known(k)]):
            m.x[known(s + r)] = real(0.0)


@wp.func
def scatter_part(
    parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, p: int, r: int, impulse: real, ahead: int
):
    """Add an impulse of row ``r`` of part ``p`` to what it acts on."""
    i = known(EACH * p + r)
    line = rows.line[i] * impulse
    if parts.tie[p + 1] > parts.tie[p]:
        for e in range(parts.tie[p], parts.tie[p + 1]):
            w = parts.tie_weight[e]
            body = parts.tie_body[e]
            if body < 0:
                points.push[parts.tie_point[e]] = points.push[parts.tie_point[e]] + line * w
            elif parts.tie_place[e] >= 0:
                arm = tie_arm(parts, bodies, e, body, ahead)
                bodies.push[body] = bodies.push[body] + line * w
                bodies.turn[body] = bodies.turn[body] + wp.cross(arm, line) * w
    else:
        a = known(parts.a[p])
        b = known(parts.b[p])
        if parts.place_a[p] >= 0:
            bodies.push[a] = bodies.push[a] + line
            bodies.turn[a] = bodies.turn[a] + rows.t_a[i] * impulse
        if parts.place_b[p] >= 0:
            bodies.push[b] = bodies.push[b] - line
            bodies.turn[b] = bodies.turn[b] - rows.t_b[i] * impulse


@wp.func
def rate_of(parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, p: int, r: int, ahead: int):
    """``ds/dt`` of row ``r`` at the start or the end of the step (ties: at the end)."""
    i = known(EACH * p + r)
    line = rows.line[i]
    if parts.tie[p + 1] > parts.tie[p]:
        total = -parts.goal_rate[p]
        for e in range(parts.tie[p], parts.tie[p + 1]):
            body = parts.tie_body[e]
            if body < 0:
                total += points.v[points.point[parts.tie_point[e]]] * parts.tie_weight[e]
            else:
                arm = wp.quat_rotate(bodies.q1[body], parts.tie_local[e])
                total += (bodies.v1[body] + wp.cross(bodies.w1[body], arm)) * parts.tie_weight[e]
        return wp.dot(line, total)
    a = known(parts.a[p])
    b = known(parts.b[p])
    if ahead == 1:
        return (
            wp.dot(line, bodies.v1[a] - bodies.v1[b])
            + wp.dot(rows.t_a[i], bodies.w1[a])
            - wp.dot(rows.t_b[i], bodies.w1[b])
        )
    return (
        wp.dot(line, bodies.v0[a] - bodies.v0[b])
        + wp.dot(rows.t_a[i], bodies.w0[a])
        - wp.dot(rows.t_b[i], bodies.w0[b])
    )
