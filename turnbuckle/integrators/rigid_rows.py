"""What rows of joints are off by at the end of a flight, whether they act, and where they act in its middle."""

import warp as wp

from turnbuckle.data.articulated import AT, EACH, EQUAL, LIMIT, MOTOR, SOFT, Bodies, Parts, RowTable
from turnbuckle.data.rigid import MOTOR_TWIST, TWIST
from turnbuckle.math.index import known
from turnbuckle.math.rotation import wrapped
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

CLOSED = wp.constant(wp.float64(2e-13))  # [m or rad] a row may be left with; round-off of large coordinates is added
UNBOUND = wp.constant(wp.float64(1e299))  # a force without limit
CHANGES = wp.constant(4)  # of a row's activity in a step before it stays on


@wp.func
def outside(s: real, lo: real, hi: real):
    """How far ``s`` is outside of [lo, hi], signed."""
    return wp.max(s - hi, real(0.0)) + wp.min(s - lo, real(0.0))


@wp.func
def nearest_turn(s: real, lo: real, hi: real):
    """A twist ``s`` in (-pi, pi] near its ends, or a turn more or less where that is nearer to [lo, hi] [rad]."""
    turn = real(6.283185307179586)
    out = s
    if s < real(-2.0) and wp.abs(outside(s + turn, lo, hi)) < wp.abs(outside(s, lo, hi)):
        out = s + turn
    if s > real(2.0) and wp.abs(outside(s - turn, lo, hi)) < wp.abs(outside(s, lo, hi)):
        out = s - turn
    return out


@wp.func
def follow_twist(parts: Parts, rows: RowTable, p: int):
    """Let the bounded twist of part ``p`` go on from that of the start of the step, past pi."""
    i = known(EACH * p)
    if parts.kind[p] == TWIST and rows.mode[i] != AT:
        rows.s[i] = rows.s0[i] + wrapped(rows.s[i] - rows.s0[i])


@wp.func
def blocked(parts: Parts, rows: RowTable, p: int, s: real):
    """For a motor: +1 or -1 where it drives that way against a limit that is reached, else 0."""
    partner = parts.partner[p]
    if partner < 0:
        return 0
    side = rows.active[partner]
    twist = int(0)
    if parts.kind[p] == MOTOR_TWIST:
        twist = 1
    if side != 0 and wanted_rate(parts, p, s, twist) * real(side) <= real(0.0):
        return -side
    return 0


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
        against = blocked(parts, rows, p, s)
        if against != 0:
            wanted = against
            if parts.max_force[p] >= UNBOUND:
                most = real(0.0)  # the limit holds, and the motor rests
        elif parts.max_force[p] >= UNBOUND:
            wanted = 0
        elif active == 0:
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


@wp.func
def middle_rows(parts: Parts, rows: RowTable, bodies: Bodies, p: int, closed: int):
    """Directions and points of action of part ``p`` in the middle of the flight, from those at its start and end.

    While joints are still open (``closed`` 0) each body is taken at its own side of the gap, which will be closed: else half the
    gap would turn body b in the next iteration.
    """
    if parts.tie[p + 1] > parts.tie[p]:
        return
    half = real(0.5)
    a = known(parts.a[p])
    b = known(parts.b[p])
    gap = vec3()
    if closed == 0:
        for r in range(parts.rows[p]):
            i = known(EACH * p + r)
            if rows.mode[i] == EQUAL:
                gap += rows.line[i] * rows.s[i]
    for r in range(parts.rows[p]):
        i = known(EACH * p + r)
        if wp.length_sq(rows.line0[i]) > real(0.0):
            line = (rows.line0[i] + rows.line[i]) * half
            at = (rows.at0[i] + rows.at[i]) * half
            rows.line[i] = line
            rows.at[i] = at
            rows.t_a[i] = wp.cross(at - (bodies.x0[a] + bodies.x1[a]) * half, line)
            rows.t_b[i] = wp.cross(at - (gap + bodies.x0[b] + bodies.x1[b]) * half, line)
        else:
            t = (rows.t0[i] + rows.t_a[i]) * half
            rows.t_a[i] = t
            rows.t_b[i] = t
