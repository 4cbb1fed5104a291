"""The second half of a step of rigid bodies: kick, impulses of the flight, velocities put on the rates of all joints."""

import warp as wp

from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import EACH, LIMIT, MOTOR, SOFT, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.data.rigid import MOTOR_TWIST
from turnbuckle.data.state import GRAVITY, H
from turnbuckle.integrators.rigid_rows import CHANGES, UNBOUND, blocked, follow_twist, outside, wanted_rate
from turnbuckle.linalg.block_ldl import RANK, BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3
from turnbuckle.solvers.equality import acts, clear_right_side, factor_island, rate_of, scatter_part, solve_island

wp.set_module_options({"enable_backward": False})

# [m or rad] by which a limit was passed before the step: it began open, or was switched on
OPEN = wp.constant(wp.float64(1e-7))
TOUCH = wp.constant(wp.float64(1e-9))  # [m or rad] from a limit on which velocities obey it


@wp.func
def spread_impulses(islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, island: int):
    """Velocities at the end of the step from ``v_free``, ``l_free`` and the impulses of the velocity stage."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        bodies.push[b] = vec3()
        bodies.turn[b] = vec3()
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        j = points.point[k]
        dv = points.push[k] / points.mass[k]  # of the last try, taken back
        points.v[j] = points.v[j] - dv
        points.memory[j] = points.memory[j] - dv
        points.push[k] = vec3()
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        if parts.on[p] == 1:
            for r in range(parts.rows[p]):
                impulse = rows.impulse1[known(EACH * p + r)]
                if impulse != real(0.0):
                    scatter_part(parts, rows, bodies, points, p, r, impulse, 1)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        bodies.v1[b] = bodies.v_free[b] + bodies.push[b] * bodies.inverse_mass[b]
        bodies.w1[b] = turned_inertia(bodies.q1[b], bodies.inverse_inertia[b], bodies.l_free[b] + bodies.turn[b])
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        j = points.point[k]
        dv = points.push[k] / points.mass[k]
        points.v[j] = points.v[j] + dv
        points.memory[j] = points.memory[j] + dv


@wp.func
def rate_error(parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, p: int, r: int):
    """``J v`` of a row at the end of the step, minus what it should be."""
    k = known(EACH * p + r)
    rate = rate_of(parts, rows, bodies, points, p, r, 1)
    mode = rows.mode[k]
    if mode == LIMIT:
        if rows.active[k] != 0:
            approach = rows.rate0[k] * real(rows.active[k])
            if approach < real(0.0) and wp.abs(outside(rows.s0[k], parts.lo[p], parts.hi[p])) <= OPEN:
                rate += parts.restitution[p] * rows.rate0[k]
    elif mode == MOTOR:
        twist = int(0)
        if parts.kind[p] == MOTOR_TWIST:
            twist = 1
        rate -= wanted_rate(parts, p, rows.s[k], twist)
    return rate


@wp.kernel
def project_velocities(
    begin: int,
    params: wp.array(dtype=real),
    islands: Islands,
    bodies: Bodies,
    points: TiedPoints,
    parts: Parts,
    rows: RowTable,
    m: BlockMatrix,
):
    """Second half of a step for each island: kick, and velocities put on the rates of all joints."""
    island = begin + wp.tid()
    h = params[H]
    g = vec3(params[GRAVITY], params[GRAVITY + 1], params[GRAVITY + 2])
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    half = real(0.5) * h
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        if islands.paper == 1:
            bodies.v_free[b] = bodies.v1[b]
            bodies.l_free[b] = turned_inertia(bodies.q1[b], bodies.inertia[b], bodies.w1[b])
        else:
            decay = bodies.damping[b]
            v = (bodies.v1[b] + bodies.push[b] * bodies.inverse_mass[b]) * wp.exp(-decay[0] * half)
            spin = (bodies.momentum[b] + bodies.turn[b]) * wp.exp(-decay[1] * half)
            bodies.v_free[b] = v + (g + bodies.force[b] * bodies.inverse_mass[b]) * half
            bodies.l_free[b] = spin + bodies.torque[b] * half
    twice = real(1 - islands.paper)  # impulses of the position stage act in this half too
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        points.push[k] = vec3()
    for i in range(first, last):
        p = known(islands.part[known(i)])
        evaluate(parts, rows, bodies, points, p, 1, 1)
        follow_twist(parts, rows, p)
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            rows.impulse1[k] = real(0.0)
            rows.changes[k] = 0
            mode = rows.mode[k]
            if mode == SOFT:
                rows.impulse1[k] = rows.impulse[k] * (real(1.0) - twice)
                rows.active[k] = 0
            elif mode == MOTOR:
                rows.active[k] = 0
            elif mode == LIMIT and rows.active[k] == 0:
                if rows.s[k] < parts.lo[p] + TOUCH:
                    rows.active[k] = 1
                elif rows.s[k] > parts.hi[p] - TOUCH:
                    rows.active[k] = -1
                if rows.active[k] != 0:
                    rows.changes[k] = 1  # a candidate: it acts if the velocity would leave the domain
    going = int(0)
    if last > first:
        going = 1
    spread_impulses(islands, parts, rows, bodies, points, island)
    rounds = int(0)
    sweeps = int(2)
    while going == 1:
        going = 0
        rounds += 1
        changed = int(0)  # rows with the wrong sign let go, those that would leave the domain act, motors saturate
        factor_island(islands, parts, rows, bodies, points, m, island, 1, h, RANK)
        for _sweep in range(sweeps):  # the second takes out the round-off of the first
            clear_right_side(islands, m, island)
            for i in range(first, last):
                p = known(islands.part[known(i)])
                s = m.scalar[known(parts.node[p])]
                for r in range(parts.rows[p]):
                    if acts(parts, rows, p, EACH * p + r) == 1:
                        m.x[known(s + r)] = -rate_error(parts, rows, bodies, points, p, r)
            solve_island(islands, m, island)
            for i in range(first, last):
                p = known(islands.part[known(i)])
                s = m.scalar[known(parts.node[p])]
                for r in range(parts.rows[p]):
                    k = known(EACH * p + r)
                    if acts(parts, rows, p, k) == 1:
                        rows.impulse1[k] = rows.impulse1[k] - m.x[known(s + r)]
            spread_impulses(islands, parts, rows, bodies, points, island)
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 0:
                continue
            for r in range(parts.rows[p]):
                k = known(EACH * p + r)
                mode = rows.mode[k]
                if mode == LIMIT and rows.active[k] != 0:
                    given = rows.impulse[k] * twice
                    if wp.abs(outside(rows.s0[k], parts.lo[p], parts.hi[p])) > OPEN:
                        continue  # it was open, and is closed by a blow: what that leaves of speed goes, both ways
                    if (given + rows.impulse1[k]) * real(rows.active[k]) < real(0.0) and rows.changes[k] < CHANGES:
                        rows.active[k] = 0
                        rows.impulse1[k] = -given
                        rows.changes[k] += 2
                        changed += 1
                elif mode == LIMIT and rows.changes[k] > 1 and rows.changes[k] < CHANGES:
                    side = int(0)
                    if rows.s[k] < parts.lo[p] + TOUCH:
                        side = 1
                    elif rows.s[k] > parts.hi[p] - TOUCH:
                        side = -1
                    rate = rate_of(parts, rows, bodies, points, p, r, 1)
                    if side != 0 and rate * real(side) < real(-1e-12):
                        rows.active[k] = side
                        rows.changes[k] += 1
                        changed += 1
                elif mode == MOTOR:
                    most = half * parts.max_force[p]
                    against = blocked(parts, rows, p, rows.s[k])
                    if rows.active[k] == 0 and against != 0:
                        if parts.max_force[p] >= UNBOUND:
                            most = real(0.0)
                        rows.active[k] = against
                        rows.impulse1[k] = most * real(against) - rows.impulse[k] * twice
                        changed += 1
                    elif rows.active[k] == 0:
                        side = int(0)
                        given = rows.impulse[k] * twice
                        if given + rows.impulse1[k] > most:
                            side = 1
                        elif given + rows.impulse1[k] < -most:
                            side = -1
                        if side != 0:
                            rows.active[k] = side
                            rows.impulse1[k] = most * real(side) - given
                            changed += 1
        if changed > 0 and rounds < 20:
            going = 1
            spread_impulses(islands, parts, rows, bodies, points, island)
    for i in range(first, last):  # limits that were only candidates do not act at the start of the next step
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if rows.mode[k] == LIMIT and rows.impulse[k] * twice + rows.impulse1[k] == real(0.0):
                rows.active[k] = 0
