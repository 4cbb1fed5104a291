"""Forces that pull points to where they should be: springs of one frequency, nails that give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Field
from turnbuckle.data.shape import Shape
from turnbuckle.scene.definitions import ForceDef
from turnbuckle.scene.goals import Goal, nail_goal
from turnbuckle.scene.points import select

MOST = 1.0  # [rad] a step: forces are those of the start of a step, which backward Euler follows up to 1.2


@dataclass(frozen=True)
class Pull:
    """``m (w^2 (goal - x) + 2 zeta w (goal' - v))``."""

    goal: Goal
    frequency: float  # w [rad/s]
    damping: float  # zeta [1]

    def __call__(self, x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
        """Forces (n, 3) [N] on points at x (n, 3) [m] with velocities v [m/s] and masses (n,) [kg]."""
        w = self.frequency
        away, behind = self.goal.value(t) - x, self.goal.rate(t) - v
        return mass[:, None] * (w * w * away + 2.0 * self.damping * w * behind)


def pulled_points(d: ForceDef, shapes: tuple[Shape, ...], x: np.ndarray) -> np.ndarray:
    """Numbers (n,) of the points that ``d.pull`` selects, of bodies with points at ``x`` (points, 3) [m]."""
    assert d.pull is not None
    owner = f"force {d.name!r}"
    chosen = []
    for selection in d.pull.points:
        shape = next(s for s in shapes if s.name == selection.body)
        chosen.append(select(selection, x[shape.begin : shape.end], owner) + shape.begin)
    points = np.concatenate(chosen)
    if len(np.unique(points)) < len(points):
        raise InputError(f"{owner}: two selections take the same point; name each point once")
    return points.astype(np.int32)


def pull_field(d: ForceDef, shapes: tuple[Shape, ...], x: np.ndarray, mass: np.ndarray, dt: float) -> Field:
    """The field of ``d.pull`` on points at ``x`` (points, 3) [m] with ``mass`` (points,) [kg]. Raises `InputError`."""
    assert d.pull is not None
    owner = f"force {d.name!r}"
    points = pulled_points(d, shapes, x)
    if not (mass[points] > 0.0).all():
        still = int(points[np.argmin(mass[points] > 0.0)])
        body = next(s.name for s in shapes if s.begin <= still < s.end)
        raise InputError(f"{owner}: pulls mass points, and '{body}' has none there; pull cloth, ropes, nets or solids")
    if d.pull.frequency * dt > MOST:
        raise InputError(
            f"{owner}: a pull of {d.pull.frequency:g} rad/s turns by {d.pull.frequency * dt:.3g} rad in a step of {dt:g} s; "
            f"at most {MOST:g} is followed: give frequency {MOST / dt:.3g} or less, or a smaller dt"
        )
    goal = nail_goal(d.pull.goal, x[points], owner)
    return Field(d.name, points, Pull(goal, d.pull.frequency, d.pull.damping))
