"""Newton's method on the flight of an island: impulses gathered, imbalance, matrix, step."""

import warp as wp

from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import EACH, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.integrators.rigid_motion import fly
from turnbuckle.linalg.block_ldl import BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3
from turnbuckle.solvers.equality import acts, factor_island, scatter_part

wp.set_module_options({"enable_backward": False})


@wp.func
def gather_impulses(
    islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, island: int, ahead: int
):
    """What the impulses of all rows sum up to on bodies and points, with the directions that rows have."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        bodies.push[b] = vec3()
        bodies.turn[b] = vec3()
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        points.push[islands.point[i]] = vec3()
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        if parts.on[p] == 0:
            continue
        if parts.tie[p + 1] > parts.tie[p]:
            for r in range(parts.rows[p]):
                impulse = rows.impulse[known(EACH * p + r)]
                if impulse != real(0.0):
                    scatter_part(parts, rows, bodies, points, p, r, impulse, ahead)
            continue
        push = vec3()  # all rows of a part together: they share both bodies
        turn_a = vec3()
        turn_b = vec3()
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            impulse = rows.impulse[k]
            push += rows.line[k] * impulse
            turn_a += rows.t_a[k] * impulse
            turn_b += rows.t_b[k] * impulse
        a = known(parts.a[p])
        b = known(parts.b[p])
        if parts.place_a[p] >= 0:
            bodies.push[a] = bodies.push[a] + push
            bodies.turn[a] = bodies.turn[a] + turn_a
        if parts.place_b[p] >= 0:
            bodies.push[b] = bodies.push[b] - push
            bodies.turn[b] = bodies.turn[b] - turn_b


@wp.func
def fly_island(islands: Islands, bodies: Bodies, points: TiedPoints, island: int, h: real):
    """Let an island fly; tied points go where their impulses take them."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        fly(islands, bodies, known(islands.body[known(i)]), h)
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        points.x[points.point[k]] = points.x_free[k] + points.push[k] * (h / points.mass[k])


@wp.func
def take_impulses(islands: Islands, bodies: Bodies, island: int):
    """Velocities and angular momenta of the flight from those without constraints and the impulses gathered."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        bodies.v1[b] = bodies.v_free[b] + bodies.push[b] * bodies.inverse_mass[b]
        bodies.momentum[b] = bodies.l_free[b] + bodies.turn[b]


@wp.func
def balance(islands: Islands, bodies: Bodies, m: BlockMatrix, island: int, h: real, noise: real):
    """Right sides of the equations of motion of the flight; the largest [m or rad] above what round-off makes of an angular
    impulse, ``noise`` [N m s]."""
    worst = real(0.0)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        s = m.scalar[known(islands.body_node[known(i)])]
        dp = bodies.push[b] - (bodies.v1[b] - bodies.v_free[b]) * bodies.mass[b]
        dl = bodies.turn[b] - (bodies.momentum[b] - bodies.l_free[b])
        for k in range(3):
            m.x[known(s + k)] = dp[k]
            m.x[known(s + 3 + k)] = dl[k]
        dw = turned_inertia(bodies.q0[b], bodies.inverse_inertia[b], dl)
        ease = bodies.inverse_inertia[b]
        floor = noise * wp.max(ease[0], wp.max(ease[1], ease[2]))
        worst = wp.max(worst, wp.max(wp.length(dp) * bodies.inverse_mass[b], wp.length(dw) - floor) * h)
    return worst


@wp.func
def take_newton_step(islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, m: BlockMatrix, island: int):
    """Add the solution of the system to velocities, angular momenta and impulses."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        s = m.scalar[known(islands.body_node[known(i)])]
        dv = vec3(m.x[known(s)], m.x[known(s + 1)], m.x[known(s + 2)])
        dw = vec3(m.x[known(s + 3)], m.x[known(s + 4)], m.x[known(s + 5)])
        bodies.v1[b] = bodies.v1[b] + dv
        bodies.momentum[b] = bodies.momentum[b] + turned_inertia(bodies.q0[b], bodies.inertia[b], dw)
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        s = m.scalar[known(parts.node[p])]
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if acts(parts, rows, p, k) == 1:
                rows.impulse[k] = rows.impulse[k] - m.x[known(s + r)]


@wp.func
def factor_flight(
    islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, m: BlockMatrix, island: int,
    h: real, rank: real, start: int,
):  # fmt: skip
    """The matrix of Newton's method: geometric stiffness, and the directions of the middle, which are those of the equations; or
    with ``start`` those of the start, where joints are closed and rows that repeat others show as such (in the middle they do so
    only to order h^2). Rows dropped have no impulse."""
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    if start == 1:
        for i in range(first, last):
            evaluate(parts, rows, bodies, points, known(islands.part[known(i)]), 0, 1)
    factor_island(islands, parts, rows, bodies, points, m, island, 2 * (1 - islands.paper), h, rank)
    for i in range(first, last):
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if rows.dropped[k] == 1:
                rows.impulse[k] = real(0.0)
