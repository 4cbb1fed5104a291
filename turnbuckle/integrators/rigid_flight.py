"""A step of rigid bodies with joints: half kick, impulses of joints, exact free flight, and the same again.

    v_1/2 = v_0 + h/2 M^-1 f_0 + M^-1 J^T P           P such that the joints are closed at the end of the flight
    x_1, R_1 = free flight of h from there             (`bodies/rotor.py`: exact)
    v_1 = v_1/2 + M^-1 J^T P + h/2 M^-1 f_1 + M^-1 J_1^T P'   P' such that J_1 v_1 is what it should be

J in both halves is that of the *middle* of the flight: each row acts along the mean of its directions at both ends, at the
mean of its points of action. So work and both momenta balance whatever the step (an energy-momentum scheme, of order 2 and
symmetric), and a taut chain is stable at any step. With directions frozen at the start (SHAKE) both momenta are kept as well,
but the tension T of a link of length l and inertia I makes an oscillator of ``sqrt(T l / I)``, and flight with frozen
directions is unstable for ``h > 2 sqrt(I / (T l))``: a hanging chain of 1,000 links of 0.2 m breaks up at 1/240 s. With
directions of the iterate alone, energy is lost. P' is small: of order h^2 P in smooth motion.

P is found by Newton's method with the matrix ``M + h/2 K, J`` (K: geometric stiffness), factored anew only when it converges
slowly. Limits are an active set; soft rows and motors go through the same system: a soft row has the impulse ``h/2 f`` in both
halves, ``f = -k (d_0 + d_1)/2 - c (d_1 - d_0)/h``, d being how far s is outside of [lo, hi] (the implicit midpoint rule: stable
at any stiffness, without damping of its own). With ``paper`` the flight is (1)-(4) of Displacement: all kick first, Euler's
equations to first order, directions of the start.
"""

import warp as wp

from turnbuckle.bodies.rotor import free_rotation, paper_rotation
from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import EACH, MOTOR, SOFT, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.data.state import GRAVITY, H
from turnbuckle.integrators.rigid_rows import CLOSED, middle_rows, outside, residual_of, revise
from turnbuckle.linalg.block_ldl import RANK, BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.rotation import rotation_log, turned_inertia
from turnbuckle.math.types import real, vec3
from turnbuckle.solvers.equality import acts, clear_right_side, factor_island, rate_of, scatter_part, solve_island

wp.set_module_options({"enable_backward": False})

ITERATIONS = wp.constant(60)  # of Newton's method at most
BALANCED = wp.constant(
    wp.float64(1e-11)
)  # [m or rad] that the equations of motion may be left with before the last flight
TRIES = wp.constant(25)  # iterations before the pose is taken to be singular
SINGULAR = wp.constant(wp.float64(1e-3))  # of a row's own J M^-1 J^T: the rank then
NEARLY = wp.constant(wp.float64(1e-10))  # [m or rad] from which a step of Newton's method that converges fast is the last
OPEN = wp.constant(wp.float64(2e-12))  # [m or rad] from which what is left open is closed at the end of the flight
ROUND = wp.constant(wp.float64(1e-15))  # of the largest coordinate
PASSES = wp.constant(30)  # over the active set at most


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
    """Body ``b`` from the start of the step to its end, with the velocity and angular momentum it has."""
    bodies.x1[b] = bodies.x0[b] + bodies.v1[b] * h
    if islands.paper == 1:
        w = turned_inertia(bodies.q0[b], bodies.inverse_inertia[b], bodies.momentum[b])
        bodies.w1[b] = w
        bodies.q1[b] = paper_rotation(bodies.q0[b], w, h)
    else:
        bodies.q1[b] = free_rotation(bodies.q0[b], bodies.momentum[b], bodies.inertia[b], h)


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
        if parts.on[p] == 1:
            for r in range(parts.rows[p]):
                impulse = rows.impulse[known(EACH * p + r)]
                if impulse != real(0.0):
                    scatter_part(parts, rows, bodies, points, p, r, impulse, ahead)


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
def balance(islands: Islands, bodies: Bodies, m: BlockMatrix, island: int, h: real):
    """Right sides of the equations of motion of the flight; the largest [m or rad]."""
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
        worst = wp.max(worst, wp.max(wp.length(dp) * bodies.inverse_mass[b], wp.length(dw)) * h)
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
    h: real, rank: real,
):  # fmt: skip
    """The matrix of Newton's method: directions of the start, where joints are closed and rows that repeat others show as such
    (those of the middle repeat each other only to order h^2), and geometric stiffness. Rows dropped have no impulse."""
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    for i in range(first, last):
        evaluate(parts, rows, bodies, points, known(islands.part[known(i)]), 0, 1)
    factor_island(islands, parts, rows, bodies, points, m, island, 2 * (1 - islands.paper), h, rank)
    for i in range(first, last):
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if rows.dropped[k] == 1:
                rows.impulse[k] = real(0.0)


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
                        dv = line * (w / points.mass[t])
                        points.x[j] = points.x[j] + dv * h
                        points.v[j] = points.v[j] + dv
                        points.memory[j] = points.memory[j] + dv
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
            rows.line0[k] = rows.line[k]
            rows.at0[k] = rows.at[k]
            rows.t0[k] = rows.t_a[k]
            if restart == 1:
                rows.changes[k] = 0
                if islands.paper == 1:
                    rows.impulse[k] = rows.impulse1[k] * warm
                else:
                    rows.impulse[k] = (rows.impulse[k] + real(0.5) * rows.impulse1[k]) * warm
                if acts(parts, rows, p, k) == 0 and rows.mode[k] != MOTOR:
                    rows.impulse[k] = real(0.0)
            if rows.mode[k] == SOFT and restart == 1:
                rows.impulse[k] = real(0.0)
                rows.active[k] = 0
                if parts.lo[p] == parts.hi[p] or outside(rows.s0[k], parts.lo[p], parts.hi[p]) != real(0.0):
                    rows.active[k] = 1
    middle = 2 * (1 - islands.paper)
    gather_impulses(islands, parts, rows, bodies, points, island, 0)
    take_impulses(islands, bodies, island)
    stale = int(1)
    count = int(0)
    passes = int(0)  # over the active set, without a Newton iteration
    going = int(1)
    worst = real(0.0)
    size = real(0.0)
    missed = real(0.0)  # of rows that were dropped
    rank = real(RANK)
    stepped = int(0)  # 1: the last thing was a step of Newton's method
    before = real(1e300)
    while going == 1:
        fly_island(islands, bodies, points, island, h)
        changed = int(0)
        worst = real(0.0)
        missed = real(0.0)
        size = real(0.0)
        clear_right_side(islands, m, island)
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 0:
                continue
            evaluate(parts, rows, bodies, points, p, 1, 1 - islands.paper)
            if islands.paper == 0:
                middle_rows(parts, rows, bodies, p, 0)
            s = m.scalar[known(parts.node[p])]
            size = wp.max(size, wp.length(bodies.x1[parts.a[p]]))
            for r in range(parts.rows[p]):
                k = known(EACH * p + r)
                changed += revise(parts, rows, p, k, h)
                if acts(parts, rows, p, k) == 1:
                    g = residual_of(parts, rows, p, k, h)
                    m.x[known(s + r)] = -g / h
                    if rows.dropped[k] == 1 and stale == 0:
                        missed = wp.max(missed, wp.abs(g))
                    else:
                        worst = wp.max(worst, wp.abs(g))
        gather_impulses(islands, parts, rows, bodies, points, island, middle)
        if changed > 0 and passes < PASSES:
            take_impulses(islands, bodies, island)
            passes += 1
            stale = 1
            before = real(1e300)
            continue
        left = balance(islands, bodies, m, island, h)
        if worst <= CLOSED + ROUND * size and left <= BALANCED + ROUND * size:
            going = 0
        worst = wp.max(worst, left)
        if first == last or count >= ITERATIONS:
            going = 0
        elif going == 1 and rank < SINGULAR and (count == TRIES or not (worst < real(1e3))):
            # near a singular pose: without the rows that hardly act there, which are closed at the end
            rank = SINGULAR
            count += 1
            stale = 1
            before = real(1e300)
            for i in range(first, last):
                p = known(islands.part[known(i)])
                for r in range(parts.rows[p]):
                    k = known(EACH * p + r)
                    rows.impulse[k] = real(0.0)
                    if rows.mode[k] == MOTOR:
                        rows.active[k] = 0
            gather_impulses(islands, parts, rows, bodies, points, island, 0)
            take_impulses(islands, bodies, island)
            continue
        elif worst < real(1e-11) + ROUND * size * real(16.0) and worst > real(0.5) * before:
            going = 0  # round-off
        if going == 1:
            if worst > real(0.1) * before or (warm == real(0.0) and count == 1):
                stale = 1
            if worst < NEARLY and worst < real(0.02) * before:
                going = 0  # one more step will do
                stepped = 1
            before = worst
            count += 1
            if stale == 1:
                factor_flight(islands, parts, rows, bodies, points, m, island, h, rank)
                stale = 0
            solve_island(islands, m, island)
            take_newton_step(islands, parts, rows, bodies, m, island)
            if last > first and islands.point_start[island + 1] > islands.point_start[island]:
                gather_impulses(islands, parts, rows, bodies, points, island, middle)
    if stepped == 0:
        take_impulses(islands, bodies, island)  # what is left of the imbalance goes
    fly_island(islands, bodies, points, island, h)
    if (
        islands.paper == 0 and last > first
    ):  # impulses act in the middle of the flight as it is: momenta are kept to round-off
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 1:
                evaluate(parts, rows, bodies, points, p, 1, 1)
                middle_rows(parts, rows, bodies, p, 1)
        gather_impulses(islands, parts, rows, bodies, points, island, middle)
        take_impulses(islands, bodies, island)
    for i in range(first, last):
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            rows.line_mid[k] = rows.line[k]
            rows.t_mid[k] = rows.t_a[k]
    if stepped == 1:  # the last step came after this was measured: what it leaves is far less
        worst = real(0.02) * worst
    worst = wp.max(worst, missed)
    if worst > OPEN + ROUND * size and worst < real(1e100):
        worst = close_at_end(islands, parts, rows, bodies, points, m, island, h)
    islands.iterations[island] = count
    islands.worst[island] = worst
    angle = real(0.0)
    for i in range(islands.body_start[island], islands.body_start[island + 1]):
        b = known(islands.body[known(i)])
        angle = wp.max(angle, wp.length(rotation_log(bodies.q1[b] * wp.quat_inverse(bodies.q0[b]))))
        if islands.paper == 0:
            bodies.w1[b] = turned_inertia(bodies.q1[b], bodies.inverse_inertia[b], bodies.momentum[b])
    islands.angle[island] = angle
    for i in range(islands.point_start[island], islands.point_start[island + 1]):  # tied points take both halves now
        k = known(islands.point[known(i)])
        j = points.point[k]
        dv = points.push[k] * (real(2 - islands.paper) / points.mass[k])
        points.v[j] = points.v[j] + dv
        points.memory[j] = points.memory[j] + dv
