"""Goals that move: their values at both ends of a step, written into the tables of nails and velocity goals."""

import numpy as np

from turnbuckle.data.state import State
from turnbuckle.data.tables import FULL, write
from turnbuckle.integrators import Scheme


def move_goals(state: State, scheme: Scheme, h: float) -> None:
    """Write goals, their rates and accelerations for the step ``[t, t + h]``.

    The rate at the end is the goal's own derivative, coming from earlier times; schemes whose velocity *is* ``(x+ - x) / h``
    take that difference. A scheme that lands later (explicit Euler) is
    constrained at ``t + 2h``, where the goal must be for ``x+ + h v+``.
    """
    shift = h if scheme.lands_later else 0.0
    for group in state.groups.values():
        if not (group.moving and group.acting) or group.goal is None:
            continue
        table = getattr(state.tables, group.kind)
        if group.kind == "velocity":
            write(table.goal_now, group.rows, group.goal.position(state.time))
            write(table.goal, group.rows, group.goal.position(state.time + h))
            continue
        start, middle, end = (group.goal.position(state.time + shift + part * h) for part in (0.0, 0.5, 1.0))
        if scheme.lands_later or scheme.goal_rate == "backward":
            rate = (end - start) / h
        else:
            rate = group.goal.rate(state.time + h)
        write(table.goal_now, group.rows, start)
        write(table.goal, group.rows, end)
        write(table.rate, group.rows, rate)
        write(table.acceleration, group.rows, (end - 2.0 * middle + start) * (4.0 / (h * h)))


def aim_again(state: State, h: float) -> None:
    """Explicit Euler, when dt changes: where ``x + h v`` goes was fixed with the old step; aim moving nails anew."""
    v = state.now.v.numpy().copy()
    x = state.now.x.numpy()
    for group in state.groups.values():
        if group.kind == "nail" and group.moving and group.acting and group.goal is not None:
            held = state.tables.nail.phase.numpy()[group.rows] == FULL
            points = group.points[held]
            v[points] = (group.goal.position(state.time + h)[held] - x[points]) / h
    state.now.v.assign(np.ascontiguousarray(v))
