"""What a page shows of one moment: plain data, never changed once made, so that any thread may read it."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Reading:
    """A constraint or joint as the list shows it."""

    name: str
    kind: str  # "nail", "attach", ..., "ball", "revolute", ...
    on: bool  # what the user wants
    acting: bool  # acts in this step (its time window is open, it is not broken)
    broken: int  # rows that broke
    rows: int
    residual: float  # [m or rad] the worst of its rows
    force: float  # [N] the largest of its rows
    torque: float = 0.0  # [N m] of a joint


@dataclass(frozen=True)
class Marks:
    """Where constraints and joints act, for drawing."""

    points: np.ndarray  # (n, 3) [m]
    of: np.ndarray  # (n,) number in `Frame.readings`
    axes: np.ndarray  # (k, 2, 3) [m], of joints that turn or slide
    axis_of: np.ndarray  # (k,)


@dataclass(frozen=True)
class Arrows:
    """Forces in the world."""

    at: np.ndarray  # (n, 3) [m]
    force: np.ndarray  # (n, 3) [N]


def no_marks() -> Marks:
    """None."""
    return Marks(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros((0, 2, 3)), np.zeros(0, np.int64))


def no_arrows() -> Arrows:
    """None."""
    return Arrows(np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True)
class Pull:
    """The hand: where it holds, and where it pulls to."""

    place: np.ndarray  # (3,) [m]
    target: np.ndarray  # (3,) [m]


@dataclass(frozen=True)
class Frame:
    """One moment of a simulation or recording."""

    x: np.ndarray  # (points, 3) [m]
    time: float = 0.0  # [s]
    steps: int = 0
    running: bool = False
    status: str = ""  # of the last step: "ok", "degraded", "failed"; "" before the first
    messages: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what the session has to say, newest last
    dt: float = 0.0  # [s]
    ms: float = 0.0  # wall time of a step [ms]
    rate: float = 0.0  # simulated seconds a second
    readings: tuple[Reading, ...] = ()
    marks: Marks = field(default_factory=no_marks)
    contacts: Arrows = field(default_factory=no_arrows)
    touching: int = 0
    pull: Pull | None = None
    pins: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # [m]
    number: int = 0  # grows by one a frame
