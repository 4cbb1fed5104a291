"""Groups: constraints that share a name, as the user made them. Host data; their rows live in the tables."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np


class Goal(Protocol):
    """Where a group's points are wanted (or how fast), at any time."""

    moves: bool

    def position(self, t: float) -> np.ndarray:
        """Values at time t, shape (rows, 3)."""

    def rate(self, t: float) -> np.ndarray:
        """Their time derivative at t, coming from earlier times."""


@dataclass
class Group:
    """A named constraint of one kind: one row a point, tuple of points, or attachment."""

    name: str
    kind: str  # key of Tables.by_kind()
    rows: np.ndarray  # (n,) int64 rows of its table
    offsets: np.ndarray  # (n + 1,) int64 into `points`
    points: np.ndarray  # the points each row owns
    enabled: bool = True  # what the user wants
    start: float = 0.0  # [s]
    end: float = np.inf  # [s]; acts in [start, end)
    ramp_steps: int = 0
    ramp_paper: bool = False
    ramp_speed: float = np.inf  # [m/s]
    break_force: float = np.inf  # [N]
    goal: Goal | None = None
    moving: bool = False  # the goal changes with time
    acting: bool = False  # switched on in the table now
    broken: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (n,)
    number: int = 0  # given when it is added
    domain: int = -1  # slides: which domain
    definition: object = None  # what the user wrote, for saving

    def __post_init__(self) -> None:
        if len(self.broken) != len(self.rows):
            self.broken = np.zeros(len(self.rows), dtype=bool)

    def wanted(self, t: float, dt: float) -> bool:
        """Whether it acts in a step that starts at t (with room for the round-off of adding up steps)."""
        slack = 1e-6 * dt
        return self.enabled and self.start <= t + slack and t + slack < self.end
