"""Closing joints at the end of a flight, near singular poses."""

import warp as wp

from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import EACH, MOTOR, SOFT, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.integrators.rigid_motion import fly
from turnbuckle.integrators.rigid_rows import CLOSED, follow_twist, residual_of
from turnbuckle.linalg.block_ldl import RANK, BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.types import real
from turnbuckle.solvers.equality import acts, clear_right_side, factor_island, solve_island

wp.set_module_options({"enable_backward": False})


@wp.func
def push_at_start(
    islands: Islands,
    parts: Parts,
    rows: RowTable,
    bodies: Bodies,
    points: TiedPoints,
    m: BlockMatrix,
    island: int,
    h: real,
):
    """Give the impulses of the solution to the start of the flight, each along one line for both bodies, and fly again."""
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        s = m.scalar[known(parts.node[p])]
        a = known(parts.a[p])
        b = known(parts.b[p])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            impulse = -m.x[known(s + r)]
            if parts.on[p] == 0 or impulse == real(0.0) or acts(parts, rows, p, k) == 0:
                continue
            line = rows.line[k] * impulse
            if parts.tie[p + 1] > parts.tie[p]:
                for e in range(parts.tie[p], parts.tie[p + 1]):
                    w = parts.tie_weight[e]
                    body = parts.tie_body[e]
                    if body < 0:
                        t = parts.tie_point[e]
                        j = points.point[t]
                        points.blow[t] = points.blow[t] + line * w
                        points.x[j] = points.x[j] + line * (w * h / points.mass[t])
                    elif parts.tie_place[e] >= 0:
                        arm = bodies.x1[body] + wp.quat_rotate(bodies.q1[body], parts.tie_local[e]) - bodies.x0[body]
                        bodies.v1[body] = bodies.v1[body] + line * (w * bodies.inverse_mass[body])
                        bodies.momentum[body] = bodies.momentum[body] + wp.cross(arm, line) * w
                continue
            turn = rows.t_a[k] * impulse
            force = int(0)
            if wp.length_sq(line) > real(0.0):
                force = 1
            if parts.place_a[p] >= 0:
                if force == 1:
                    turn = wp.cross(rows.at[k] - bodies.x0[a], line)
                bodies.v1[a] = bodies.v1[a] + line * bodies.inverse_mass[a]
                bodies.momentum[a] = bodies.momentum[a] + turn
            if parts.place_b[p] >= 0:
                if force == 1:
                    turn = wp.cross(rows.at[k] - bodies.x0[b], line)
                bodies.v1[b] = bodies.v1[b] - line * bodies.inverse_mass[b]
                bodies.momentum[b] = bodies.momentum[b] - turn
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        fly(islands, bodies, known(islands.body[known(i)]), h)


@wp.func
def close_at_end(
    islands: Islands,
    parts: Parts,
    rows: RowTable,
    bodies: Bodies,
    points: TiedPoints,
    m: BlockMatrix,
    island: int,
    h: real,
):
    """Close what the flight could not, with directions of the iterate: near singular poses, where directions turn as fast as
    they are. It keeps momenta too, energy to the size of the gap. Returns the residual left."""
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    worst = real(0.0)
    count = int(0)
    going = int(1)
    while going == 1:
        worst = real(0.0)
        clear_right_side(islands, m, island)
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 0:
                continue
            evaluate(parts, rows, bodies, points, p, 1, 1)
            follow_twist(parts, rows, p)
            s = m.scalar[known(parts.node[p])]
            for r in range(parts.rows[p]):
                k = known(EACH * p + r)
                if acts(parts, rows, p, k) == 1 and rows.mode[k] != SOFT and rows.mode[k] != MOTOR:
                    g = residual_of(parts, rows, p, k, h)
                    m.x[known(s + r)] = -g / h
                    worst = wp.max(worst, wp.abs(g))
        if worst < real(2.0) * CLOSED or count == 20 or not (worst < real(1e3)):
            going = 0
        else:
            count += 1
            factor_island(islands, parts, rows, bodies, points, m, island, 1, h, RANK)
            solve_island(islands, m, island)
            push_at_start(islands, parts, rows, bodies, points, m, island, h)
    return worst
