"""Where constraints aim at a time t: fixed, keyframed, or a Python callable."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.scene.definitions import KeyframesDef

DIFFERENCE = 1e-4  # step of the differences of a callable goal [s]; good to 1e-5 of the speed at 200 Hz


class Goal(ABC):
    """The goal of n points. `value(t)` is a position [m] for a nail, a velocity [m/s] for a velocity constraint."""

    moves: bool = True  # False: the same value for ever

    @abstractmethod
    def value(self, t: float) -> np.ndarray:
        """Goal at time t [s], float64, shape (n, 3). Not to be written to."""

    def rate(self, t: float) -> np.ndarray:
        """Time derivative of `value` at t, coming from earlier times, shape (n, 3); exact unless a callable."""
        return np.zeros_like(self.value(t))

    def acceleration(self, t: float) -> np.ndarray:
        """Second time derivative of `value` at t, coming from earlier times, shape (n, 3); exact unless a callable."""
        return np.zeros_like(self.value(t))

    def position(self, t: float) -> np.ndarray:
        """Goal position at time t [s], shape (n, 3) [m]."""
        return self.value(t)

    def velocity(self, t: float) -> np.ndarray:
        """Goal velocity at time t [s] of a velocity constraint, shape (n, 3) [m/s]."""
        return self.value(t)


@dataclass(frozen=True)
class FixedGoal(Goal):
    """Always the same."""

    values: np.ndarray  # (n, 3)
    moves = False

    def value(self, t: float) -> np.ndarray:
        return self.values


@dataclass(frozen=True)
class KeyframedGoal(Goal):
    """Values at times, held before the first and after the last.

    `smooth` replaces the fraction s between two keys by s^2 (3 - 2 s), whose slope is zero at both.
    """

    times: np.ndarray  # (k,), increasing [s]
    values: np.ndarray  # (k, n, 3)
    smooth: bool

    def value(self, t: float) -> np.ndarray:
        times, values = self.times, self.values
        if t <= times[0]:
            return values[0]
        if t >= times[-1]:
            return values[-1]
        i = int(np.searchsorted(times, t, side="right")) - 1
        s = (t - times[i]) / (times[i + 1] - times[i])
        if self.smooth:
            s = s * s * (3.0 - 2.0 * s)
        # This form is exact at s = 0, and monotone; values[i] + s * (difference) may miss the next key by a rounding,
        # but the next key itself is returned by the interval that starts there.
        return values[i] + s * (values[i + 1] - values[i])

    def rate(self, t: float) -> np.ndarray:
        i, s, span = self._interval(t)
        slope = (6.0 * s * (1.0 - s) if self.smooth else 1.0) / span
        return slope * (self.values[i + 1] - self.values[i]) if span < np.inf else np.zeros_like(self.values[0])

    def acceleration(self, t: float) -> np.ndarray:
        i, s, span = self._interval(t)
        if not self.smooth or span == np.inf:
            return np.zeros_like(self.values[0])
        return (6.0 - 12.0 * s) / span**2 * (self.values[i + 1] - self.values[i])

    def _interval(self, t: float) -> tuple[int, float, float]:
        """Interval (times[i], times[i + 1]] that holds t, the fraction of it, its length; infinite length outside."""
        if t <= self.times[0] or t > self.times[-1]:
            return 0, 0.0, np.inf
        i = int(np.searchsorted(self.times, t, side="left")) - 1
        span = float(self.times[i + 1] - self.times[i])
        return i, (t - float(self.times[i])) / span, span


@dataclass(frozen=True)
class CallableGoal(Goal):
    """What a Python callable t -> (3,) or (n, 3) returns, checked each time."""

    function: Callable[[float], Any]
    count: int
    owner: str

    def value(self, t: float) -> np.ndarray:
        try:
            result = np.asarray(self.function(float(t)), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{self.owner}: its goal failed at t = {t:g} s ({error})") from error
        if result.shape not in ((3,), (self.count, 3)):
            shapes = f"(3,) or ({self.count}, 3)"
            raise InputError(f"{self.owner}: its goal must return shape {shapes}, got {result.shape}")
        if not np.isfinite(result).all():
            raise StepError(f"{self.owner}: its goal is not finite at t = {t:g} s")
        return np.broadcast_to(result, (self.count, 3)).copy()

    def rate(self, t: float) -> np.ndarray:
        # Central differences of fourth order; the step balances truncation against rounding.
        d = DIFFERENCE
        near, far = self.value(t + d) - self.value(t - d), self.value(t + 2 * d) - self.value(t - 2 * d)
        return (8.0 * near - far) / (12.0 * d)

    def acceleration(self, t: float) -> np.ndarray:
        d = DIFFERENCE
        near, far = self.value(t + d) + self.value(t - d), self.value(t + 2 * d) + self.value(t - 2 * d)
        return (16.0 * near - far - 30.0 * self.value(t)) / (12.0 * d * d)


def nail_goal(goal: Any, start: np.ndarray, owner: str) -> Goal:
    """The goal of a nail. `start`: where its points are at the start [m], shape (n, 3). `owner`: "constraint 'top'".

    Raises `InputError` where the shape of the goal does not fit n points.
    """
    if goal is None:
        return FixedGoal(np.array(start, dtype=np.float64))
    if isinstance(goal, KeyframesDef) and goal.offsets is not None:
        values = np.asarray(start)[None, :, :] + goal.offsets[:, None, :]
        return KeyframedGoal(goal.times, values, goal.interpolation == "smooth")
    return _goal(goal, len(start), owner, "positions")


def velocity_goal(goal: Any, count: int, owner: str) -> Goal:
    """The goal of a velocity constraint on `count` points; as `nail_goal`, values in m/s."""
    return _goal(goal, count, owner, "velocities")


def _goal(goal: Any, count: int, owner: str, field: str) -> Goal:
    if isinstance(goal, KeyframesDef):
        values = np.asarray(getattr(goal, field))
        values = values[:, None, :] if values.ndim == 2 else values
        if values.shape[1] not in (1, count):
            raise InputError(
                f"{owner}: goal.{field} has {values.shape[1]} places a key, but {count} points are selected"
            )
        values = np.broadcast_to(values, (len(values), count, 3)).copy()
        return KeyframedGoal(goal.times, values, goal.interpolation == "smooth")
    if callable(goal):
        return CallableGoal(goal, count, owner)
    fixed = np.atleast_2d(goal)
    if fixed.shape not in ((1, 3), (count, 3)):
        shapes = "(3,)" if count == 1 else f"(3,) or ({count}, 3)"
        raise InputError(f"{owner}: goal has shape {np.shape(goal)}; for {count} points give shape {shapes}")
    return FixedGoal(np.broadcast_to(fixed, (count, 3)).copy())
