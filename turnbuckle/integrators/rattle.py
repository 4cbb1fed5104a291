"""A step of rigid bodies with joints: half kick, constraint impulses, exact free flight, half kick, projected velocities.

    v_1/2 = v_0 + h/2 M^-1 f_0 + M^-1 J_0^T P         P such that the joints are closed at the end of the flight
    x_1, R_1 = free flight of h from there             (`bodies/rotor.py`: exact)
    v_1 = v_1/2 + h/2 M^-1 f_1 + M^-1 J_1^T P'        P' such that J_1 v_1 is what it should be

This is RATTLE (Andersen 1983) around the splitting of kicks and flight: of order 2, symmetric, and with force directions
frozen at the start of the flight (SHAKE) it keeps both momenta and does not drift in energy. P is found by Newton's method
with the matrix ``J_0 M^-1 J_0^T``, factored once. Limits are an active set; soft rows and motors go through the same system:
a soft row has the impulse ``h/2 f`` at both ends of the flight, ``f = -k (d_0 + d_1)/2 - c (d_1 - d_0)/h``, d being how far s is
outside of [lo, hi] (the implicit midpoint rule: stable at any stiffness, without damping of its own).
With ``paper`` the flight is (1)-(4) of Displacement: all kick first, Euler's equations to first order.
"""

import warp as wp

from turnbuckle.bodies.rotor import free_rotation, paper_rotation
from turnbuckle.constraints.joints.evaluate import MOTOR_TWIST, TWIST, evaluate
from turnbuckle.data.articulated import (
    AT,
    EACH,
    LIMIT,
    MOTOR,
    SOFT,
    Bodies,
    Islands,
    Parts,
    RowTable,
    TiedPoints,
)
from turnbuckle.data.state import GRAVITY, H
from turnbuckle.linalg.block_ldl import BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.rotation import rotation_log, turned_inertia, wrapped
from turnbuckle.math.types import real, vec3
from turnbuckle.solvers.equality import (
    acts,
    clear_right_side,
    factor_island,
    rate_of,
    scatter_part,
    solve_island,
)

wp.set_module_options({"enable_backward": False})

ITERATIONS = wp.constant(60)  # of Newton's method at most
CLOSED = wp.constant(wp.float64(2e-13))  # [m or rad] a row may be left with; round-off of large coordinates is added
ROUND = wp.constant(wp.float64(1e-15))
PASSES = wp.constant(30)  # over the active set at most
CHANGES = wp.constant(4)  # of a row's activity in a step before it stays on
TOUCH = wp.constant(wp.float64(1e-9))  # [m or rad] from a limit on which velocities obey it


@wp.func
def outside(s: real, lo: real, hi: real):
    """How far ``s`` is outside of [lo, hi], signed."""
    return wp.max(s - hi, real(0.0)) + wp.min(s - lo, real(0.0))


@wp.func
def kick(islands: Islands, bodies: Bodies, params: wp.array(dtype=real), b: int):
    """Velocity and angular momentum of body ``b`` before its flight, without constraints."""
    h = params[H]
    g = vec3(params[GRAVITY], params[GRAVITY + 1], params[GRAVITY + 2])
    part = real(0.5) * h
    q = bodies.q0[b]
    w = bodies.w0[b]
    spin = turned_inertia(q, bodies.inertia[b], w)
    if islands.paper == 1:
        part = h
        torque = bodies.torque[b] - wp.cross(w, spin)
        spin = spin + torque * h
    else:
        spin = spin + bodies.torque[b] * part
    decay = bodies.damping[b]
    v = bodies.v0[b] + (g + bodies.force[b] * bodies.inverse_mass[b]) * part
    bodies.v_free[b] = v * wp.exp(-decay[0] * part)
    bodies.l_free[b] = spin * wp.exp(-decay[1] * part)


@wp.func
def fly(islands: Islands, bodies: Bodies, b: int, h: real):
    """Body ``b`` from the start of the step to its end, with the impulses it has."""
    v = bodies.v_free[b] + bodies.push[b] * bodies.inverse_mass[b]
    spin = bodies.l_free[b] + bodies.turn[b]
    bodies.v1[b] = v
    bodies.momentum[b] = spin
    bodies.x1[b] = bodies.x0[b] + v * h
    if islands.paper == 1:
        w = turned_inertia(bodies.q0[b], bodies.inverse_inertia[b], spin)
        bodies.w1[b] = w
        bodies.q1[b] = paper_rotation(bodies.q0[b], w, h)
    else:
        bodies.q1[b] = free_rotation(bodies.q0[b], spin, bodies.inertia[b], h)


@wp.func
def fly_island(
    islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, island: int, h: real
):
    """Gather the impulses of all rows, and let the island fly."""
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        bodies.push[b] = vec3()
        bodies.turn[b] = vec3()
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        points.push[islands.point[i]] = vec3()
    for i in range(islands.part_start[island], islands.part_start[island + 1]):
        p = known(islands.part[known(i)])
        if parts.on[p] == 1:
            for r in range(parts.rows[p]):
                impulse = rows.impulse[known(EACH * p + r)]
                if impulse != real(0.0):
                    scatter_part(parts, rows, bodies, points, p, r, impulse, 0)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        fly(islands, bodies, known(islands.body[known(i)]), h)
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        points.x[points.point[k]] = points.x_free[k] + points.push[k] * (h / points.mass[k])


@wp.func
def wanted_rate(parts: Parts, p: int, s: real, twist: int):
    """The rate that a motor at ``s`` is to drive with."""
    if parts.time_constant[p] <= real(0.0):
        return parts.target[p]
    left = parts.target[p] - s
    if twist == 1:
        left = wrapped(left)
    return left / parts.time_constant[p]


@wp.func
def residual_of(parts: Parts, rows: RowTable, p: int, i: int, h: real):
    """What row ``i`` of part ``p`` is off by at the end of the flight [m or rad]."""
    mode = rows.mode[i]
    s = rows.s[i]
    kind = parts.kind[p]
    if mode == AT:
        s -= parts.lo[p]
        if kind == TWIST:
            s = wrapped(s)
    elif mode == LIMIT:
        if rows.active[i] > 0:
            s -= parts.lo[p]
        else:
            s -= parts.hi[p]
    elif mode == SOFT:
        k = real(0.5) * parts.stiffness[p]
        c = parts.damping[p] / h
        d0 = outside(rows.s0[i], parts.lo[p], parts.hi[p])
        d1 = outside(s, parts.lo[p], parts.hi[p])
        s = d1 + (d0 * (k - c) + real(2.0) / h * rows.impulse[i]) / (k + c)
    elif mode == MOTOR:
        twist = int(0)
        if kind == MOTOR_TWIST:
            twist = 1
        way = s - rows.s0[i]
        rate = wanted_rate(parts, p, rows.s0[i], twist)
        if parts.time_constant[p] > real(0.0):  # exponential approach over the step
            rate *= (real(1.0) - wp.exp(-h / parts.time_constant[p])) * parts.time_constant[p] / h
        if twist == 1:
            way = wrapped(way)
        s = way - rate * h
    return s


@wp.func
def revise(parts: Parts, rows: RowTable, p: int, i: int, h: real):
    """Whether row ``i`` should act, from its coordinate and impulse; 1 when that or its impulse changed."""
    mode = rows.mode[i]
    if parts.on[p] == 0 or (mode != LIMIT and mode != SOFT and mode != MOTOR):
        return 0
    active = rows.active[i]
    lo = parts.lo[p]
    hi = parts.hi[p]
    s = rows.s[i]
    wanted = int(active)
    again = int(0)
    if mode == LIMIT:
        slack = CLOSED
        if active == 0:
            if s < lo - slack:
                wanted = 1
            elif s > hi + slack:
                wanted = -1
        elif rows.impulse[i] * real(active) < real(0.0) and rows.changes[i] < CHANGES:
            wanted = 0
        if wanted == 0:
            rows.impulse[i] = real(0.0)
    elif mode == SOFT:
        wanted = 0
        if s < lo:
            wanted = 1
        elif s > hi:
            wanted = -1
        if lo == hi:
            wanted = 1
        if active != 0 and wanted == 0 and rows.changes[i] >= CHANGES:
            wanted = active
        if wanted == 0:  # it pushes for the part of the step in which it was outside
            d0 = outside(rows.s0[i], lo, hi)
            push = -real(0.5) * h * d0 * (real(0.5) * parts.stiffness[p] - parts.damping[p] / h)
            if push != rows.impulse[i]:
                rows.impulse[i] = push
                again = 1
    else:
        most = real(0.5) * h * parts.max_force[p]
        if active == 0:
            if rows.impulse[i] > most:
                wanted = 1
            elif rows.impulse[i] < -most:
                wanted = -1
        elif residual_of(parts, rows, p, i, h) * real(active) > CLOSED and rows.changes[i] < CHANGES:
            wanted = 0  # saturated, and faster than wanted
        if wanted != 0 and rows.impulse[i] != most * real(wanted):
            rows.impulse[i] = most * real(wanted)
            again = 1
    if wanted != active:
        rows.active[i] = wanted
        rows.changes[i] += 1
        again = 1
    return again


@wp.kernel
def close_positions(
    begin: int,
    params: wp.array(dtype=real),
    islands: Islands,
    bodies: Bodies,
    points: TiedPoints,
    parts: Parts,
    rows: RowTable,
    m: BlockMatrix,
    restart: int,
):
    """First half of a step for each island: kick, and the flight that ends with all joints closed.

    ``restart`` 0: go on from the impulses found so far (curves and surfaces were looked up again).
    """
    island = begin + wp.tid()
    h = params[H]
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        kick(islands, bodies, params, known(islands.body[known(i)]))
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    warm = islands.warm[0]
    for i in range(first, last):
        p = known(islands.part[known(i)])
        evaluate(parts, rows, bodies, points, p, 0, 1)
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            rows.s0[k] = rows.s[k]
            rows.rate0[k] = rate_of(parts, rows, bodies, points, p, r, 0)
            rows.line_start[k] = rows.line[k]
            rows.t_start[k] = rows.t_a[k]
            if restart == 1:
                rows.changes[k] = 0
                rows.impulse[k] = rows.impulse1[k] * warm
                if acts(parts, rows, p, k) == 0 and rows.mode[k] != MOTOR:
                    rows.impulse[k] = real(0.0)
            if rows.mode[k] == SOFT and restart == 1:
                rows.impulse[k] = real(0.0)
                rows.active[k] = 0
                if parts.lo[p] == parts.hi[p] or outside(rows.s0[k], parts.lo[p], parts.hi[p]) != real(0.0):
                    rows.active[k] = 1
    stale = int(1)
    count = int(0)
    passes = int(0)  # over the active set, without a Newton iteration
    going = int(1)
    worst = real(0.0)
    before = real(1e300)
    while going == 1:
        fly_island(islands, parts, rows, bodies, points, island, h)
        changed = int(0)
        worst = real(0.0)
        size = real(0.0)
        clear_right_side(islands, m, island)
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 0:
                continue
            evaluate(parts, rows, bodies, points, p, 1, 0)
            s = m.scalar[known(parts.node[p])]
            size = wp.max(size, wp.length(bodies.x1[parts.a[p]]))
            for r in range(parts.rows[p]):
                k = known(EACH * p + r)
                changed += revise(parts, rows, p, k, h)
                if acts(parts, rows, p, k) == 1:
                    g = residual_of(parts, rows, p, k, h)
                    m.x[known(s + r)] = -g / h
                    worst = wp.max(worst, wp.abs(g))
        if changed > 0 and passes < PASSES:
            passes += 1
            stale = 1
            before = real(1e300)
            continue
        if worst <= CLOSED + ROUND * size or first == last or count >= ITERATIONS or not (worst < real(1e100)):
            going = 0
        elif worst < real(1e-11) + ROUND * size * real(16.0) and worst > real(0.5) * before:
            going = 0  # round-off
        else:
            before = worst
            count += 1
            if stale == 1:
                factor_island(islands, parts, rows, bodies, points, m, island, 0, h)
                stale = 0
            solve_island(islands, m, island)
            for i in range(first, last):
                p = known(islands.part[known(i)])
                s = m.scalar[known(parts.node[p])]
                for r in range(parts.rows[p]):
                    k = known(EACH * p + r)
                    if acts(parts, rows, p, k) == 1:
                        rows.impulse[k] = rows.impulse[k] - m.x[known(s + r)]
    islands.iterations[island] = count
    islands.worst[island] = worst
    angle = real(0.0)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        angle = wp.max(angle, wp.length(rotation_log(bodies.q1[b] * wp.quat_inverse(bodies.q0[b]))))
        if islands.paper == 0:
            bodies.w1[b] = turned_inertia(bodies.q1[b], bodies.inverse_inertia[b], bodies.momentum[b])
    islands.angle[island] = angle
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        k = known(islands.point[known(i)])
        j = points.point[k]
        dv = points.push[k] / points.mass[k]
        points.v[j] = points.v[j] + dv
        points.memory[j] = points.memory[j] + dv


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
            if approach < real(0.0):
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
            v = bodies.v1[b] * wp.exp(-decay[0] * half)
            spin = bodies.momentum[b] * wp.exp(-decay[1] * half)
            bodies.v_free[b] = v + (g + bodies.force[b] * bodies.inverse_mass[b]) * half
            bodies.l_free[b] = spin + bodies.torque[b] * half
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        points.push[islands.point[i]] = vec3()
    for i in range(first, last):
        p = known(islands.part[known(i)])
        evaluate(parts, rows, bodies, points, p, 1, 1)
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            rows.impulse1[k] = real(0.0)
            rows.changes[k] = 0
            mode = rows.mode[k]
            if mode == SOFT:
                rows.impulse1[k] = rows.impulse[k]
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
        factor_island(islands, parts, rows, bodies, points, m, island, 1, h)
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
                    if rows.impulse1[k] * real(rows.active[k]) < real(0.0) and rows.changes[k] < CHANGES:
                        rows.active[k] = 0
                        rows.impulse1[k] = real(0.0)
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
                    if rows.active[k] == 0:
                        side = int(0)
                        if rows.impulse1[k] > most:
                            side = 1
                        elif rows.impulse1[k] < -most:
                            side = -1
                        if side != 0:
                            rows.active[k] = side
                            rows.impulse1[k] = most * real(side)
                            changed += 1
        if changed > 0 and rounds < 20:
            going = 1
            spread_impulses(islands, parts, rows, bodies, points, island)
    for i in range(first, last):  # limits that were only candidates do not act at the start of the next step
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if rows.mode[k] == LIMIT and rows.impulse1[k] == real(0.0):
                rows.active[k] = 0


@wp.kernel
def place_points(
    begin: int,
    body: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    local: wp.array(dtype=vec3),
    bodies: Bodies,
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
):
    """Points of rigid bodies, where their bodies are at the end of the step."""
    i = known(begin + wp.tid())
    b = known(body[i])
    arm = wp.quat_rotate(bodies.q1[b], local[i])
    x_out[point[i]] = bodies.x1[b] + arm
    v_out[point[i]] = bodies.v1[b] + wp.cross(bodies.w1[b], arm)


@wp.kernel
def remember_points(begin: int, points: TiedPoints):
    """``x_free`` of the tied mass points: where the scheme has put them."""
    i = known(begin + wp.tid())
    points.x_free[i] = points.x[points.point[i]]


@wp.kernel
def row_directions(begin: int, bodies: Bodies, points: TiedPoints, parts: Parts, rows: RowTable):
    """Coordinates and directions of the rows of each part, for the poses at the end of the step."""
    evaluate(parts, rows, bodies, points, begin + wp.tid(), 1, 1)
