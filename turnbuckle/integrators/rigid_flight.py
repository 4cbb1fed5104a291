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

from turnbuckle.constraints.joints.evaluate import evaluate
from turnbuckle.data.articulated import AT, EACH, MOTOR, SOFT, Bodies, Islands, Parts, RowTable, TiedPoints
from turnbuckle.data.rigid import TWIST
from turnbuckle.data.state import H
from turnbuckle.integrators.rigid_closing import close_at_end
from turnbuckle.integrators.rigid_motion import kick
from turnbuckle.integrators.rigid_newton import (
    balance,
    factor_flight,
    fly_island,
    gather_impulses,
    take_impulses,
    take_newton_step,
)
from turnbuckle.integrators.rigid_rows import (
    CLOSED,
    follow_twist,
    middle_rows,
    nearest_turn,
    outside,
    residual_of,
    revise,
)
from turnbuckle.linalg.block_ldl import RANK, BlockMatrix
from turnbuckle.math.index import known
from turnbuckle.math.rotation import rotation_log, turned_inertia
from turnbuckle.math.types import real, vec3
from turnbuckle.solvers.equality import acts, clear_right_side, rate_of, solve_island

wp.set_module_options({"enable_backward": False})

ITERATIONS = wp.constant(60)  # of Newton's method at most
# [m or rad] that the equations of motion may be left with before the last flight
BALANCED = wp.constant(wp.float64(1e-11))
TRIES = wp.constant(25)  # iterations before the pose is taken to be singular
SINGULAR = wp.constant(wp.float64(1e-3))  # of a row's own J M^-1 J^T: the rank then
# [m or rad] from which a step of Newton's method that converges fast is the last
NEARLY = wp.constant(wp.float64(1e-10))
OPEN = wp.constant(wp.float64(2e-12))  # [m or rad] from which what is left open is closed at the end of the flight
ROUND = wp.constant(wp.float64(1e-15))  # of the largest coordinate
PASSES = wp.constant(30)  # over the active set at most


@wp.func
def start_rows(
    islands: Islands, parts: Parts, rows: RowTable, bodies: Bodies, points: TiedPoints, island: int, h: real, restart: int
):  # fmt: skip
    """Coordinates, rates and directions at the start of the step, and impulses to start from: those of the last step."""
    first = islands.part_start[island]
    last = islands.part_start[island + 1]
    warm = islands.warm[0]
    for i in range(first, last):
        p = known(islands.part[known(i)])
        evaluate(parts, rows, bodies, points, p, 0, 1)
        for r in range(parts.rows[p]):
            k = known(EACH * p + r)
            if parts.kind[p] == TWIST and rows.mode[k] != AT:
                rows.s[k] = nearest_turn(rows.s[k], parts.lo[p], parts.hi[p])
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
    for i in range(islands.point_start[island], islands.point_start[island + 1]):
        points.blow[known(islands.point[known(i)])] = vec3()
    warm = islands.warm[0]
    start_rows(islands, parts, rows, bodies, points, island, h, restart)
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
    repeats = islands.paper  # 1: some rows repeat others, or may do
    if warm == real(0.0):
        repeats = 1
    for i in range(first, last):
        p = known(islands.part[known(i)])
        for r in range(parts.rows[p]):
            if rows.dropped[known(EACH * p + r)] == 1:
                repeats = 1
    stepped = int(0)  # 1: the last thing was a step of Newton's method
    before = real(1e300)
    while going == 1:
        fly_island(islands, bodies, points, island, h)
        changed = int(0)
        worst = real(0.0)
        missed = real(0.0)
        size = real(0.0)
        most = real(0.0)  # impulse
        clear_right_side(islands, m, island)
        for i in range(first, last):
            p = known(islands.part[known(i)])
            if parts.on[p] == 0:
                continue
            evaluate(parts, rows, bodies, points, p, 1, 1 - islands.paper)
            if islands.paper == 0:
                middle_rows(parts, rows, bodies, p, 0)
            follow_twist(parts, rows, p)
            s = m.scalar[known(parts.node[p])]
            size = wp.max(size, wp.length(bodies.x1[parts.a[p]]))
            for r in range(parts.rows[p]):
                k = known(EACH * p + r)
                changed += revise(parts, rows, p, k, h)
                most = wp.max(most, wp.abs(rows.impulse[k]))
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
            repeats = 1
            before = real(1e300)
            continue
        left = balance(islands, bodies, m, island, h, real(4.0) * ROUND * size * most)
        if worst <= CLOSED + ROUND * size and left <= BALANCED / wp.max(size, real(1.0)) + ROUND * size:
            going = 0
        worst = wp.max(worst, left)
        if first == last or count >= ITERATIONS:
            going = 0
        elif going == 1 and rank < SINGULAR and (count == TRIES or not (worst < real(1e3))):
            # near a singular pose: without the rows that hardly act there, which are closed at the end
            rank = SINGULAR
            repeats = 1
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
            if worst < NEARLY and worst < real(0.001) * before and size < real(100.0):
                going = 0  # one more step will do
                stepped = 1
            before = worst
            count += 1
            if stale == 1:
                factor_flight(islands, parts, rows, bodies, points, m, island, h, rank, repeats)
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
        # not the angle between both poses alone: a body may have turned more than once
        rate = wp.length(turned_inertia(bodies.q0[b], bodies.inverse_inertia[b], bodies.momentum[b]))
        angle = wp.max(angle, wp.length(rotation_log(bodies.q1[b] * wp.quat_inverse(bodies.q0[b]))))
        angle = wp.max(angle, h * wp.max(rate, wp.length(bodies.w0[b])))
        if islands.paper == 0:
            bodies.w1[b] = turned_inertia(bodies.q1[b], bodies.inverse_inertia[b], bodies.momentum[b])
    islands.angle[island] = angle
