"""Which steps a run takes."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from turnbuckle.data.errors import InputError

ROUND_OFF = 1e-9  # of a step: a remainder below is the rounding of duration / dt
SHORTEST = 1e-3  # of a step: a remainder below goes into the last full step (an explicit step of h answers with h^2,
#                   so a much shorter one would turn the rounding of positions into forces)


@dataclass(frozen=True)
class Schedule:
    """``count`` steps in all, of which ``first`` are done; each of ``dt`` [s] but the last, of ``last`` [s]."""

    first: int
    count: int
    dt: float
    last: float

    @property
    def left(self) -> int:
        """Steps still to be taken."""
        return max(self.count - self.first, 0)

    def steps(self) -> Iterator[float]:
        """Their sizes [s]."""
        for _ in range(self.left - 1):
            yield self.dt
        if self.left:
            yield self.last


def make_schedule(duration: float, dt: float, time: float = 0.0, done: int = 0) -> Schedule:
    """The steps from ``time`` [s], after ``done`` steps, to ``duration`` [s].

    When what was done are whole steps of ``dt``, the steps left are those of a run that never stopped. Raises InputError.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise InputError(f"dt is {dt}; give a number of seconds greater than 0")
    if not (math.isfinite(duration) and duration >= 0.0):
        raise InputError(f"duration is {duration}; give a number of seconds of at least 0")
    if abs(done * dt - time) <= SHORTEST * dt:
        count, last = _divide(duration, dt)
        return Schedule(done, count, dt, last)
    count, last = _divide(max(duration - time, 0.0), dt)
    return Schedule(done, done + count, dt, last)


def _divide(span: float, dt: float) -> tuple[int, float]:
    """How many steps ``span`` takes, and the size of the last."""
    if span <= 0.0:
        return 0, dt
    whole = math.floor(span / dt + ROUND_OFF)
    rest = span / dt - whole
    if abs(rest) <= max(ROUND_OFF, 4e-16 * whole):
        return (whole, dt) if whole else (1, span)
    if whole and rest < SHORTEST:
        return whole, dt * (1.0 + rest)
    return whole + 1, dt * rest
