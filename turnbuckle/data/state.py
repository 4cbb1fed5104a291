"""State: all that evolves in a run, and all that may be changed between two steps. A checkpoint holds just this."""

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from turnbuckle.data.errors import InputError
from turnbuckle.data.groups import Group
from turnbuckle.data.rigid import Joint, JointParts, Loads, RigidState
from turnbuckle.data.tables import Tables

# Places in `State.params`, the numbers that kernels read anew each step.
H = wp.constant(0)  # step [s]
TIME = wp.constant(1)  # time at the start of the step [s]
GRAVITY = wp.constant(2)  # three numbers [m/s^2]
INVERSE_C = wp.constant(5)  # 1 / (c_i m_i) [1/s^2]: a displacement times this times m_i is the force that made it
D_OVER_C = wp.constant(6)  # d_i / c_i [1/s]: the velocity that comes with a displacement
PROJECT = wp.constant(7)  # 1: velocities are put on the constraint by a multiplier of their own; 0: they get d_i F
MEMORY = wp.constant(8)  # 1: the scheme remembers a velocity (Verlet's w) that is constrained like v
ADD = wp.constant(9)  # 1: the force of landing adds to the force of the first stage
PREVIOUS_H = wp.constant(10)  # the step before this one [s]
INVERSE_H = wp.constant(11)  # 1 / step [1/s]
BACKWARD = wp.constant(12)  # 1: the scheme's velocity is (x+ - x) / h
PARAMS = 16


@dataclass
class Kinematics:
    """Positions, velocities, and what goes with them, at one time."""

    x: wp.array  # positions [m], (points,) vec3d
    v: wp.array  # velocities [m/s], (points,) vec3d
    force: wp.array  # all forces but constraint forces at (x, v, t) [N], (points,) vec3d
    memory: wp.array  # what the scheme remembers of earlier steps, (points,) vec3d: w [m/s] or a [m/s^2]

    @classmethod
    def zeros(cls, points: int, device: str) -> "Kinematics":
        """All zero."""
        return cls(*(wp.zeros(points, dtype=wp.vec3d, device=device) for _ in range(4)))


@dataclass
class State:
    """What evolves. Read with :meth:`positions` and :meth:`velocities`; change with the ``set_`` methods."""

    now: Kinematics
    tables: Tables
    params: wp.array  # (PARAMS,) float64
    rigid: RigidState
    loads: Loads
    parts: JointParts
    gravity: np.ndarray  # (3,) [m/s^2]
    joints: dict[str, Joint] = field(default_factory=dict)  # by name
    domains: list = field(default_factory=list)  # curves, surfaces and callables of joint parts
    scene_parts: int = 0  # parts of joints that the scene defines; those of joints added live follow them
    impulse: np.ndarray = field(
        default_factory=lambda: np.zeros(0)
    )  # of rows in the last step: what the solver starts from
    active: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # rows at a limit
    contact_keys: np.ndarray = field(
        default_factory=lambda: np.zeros(0, np.int64)
    )  # of pairs that touched in the last step, sorted (`turnbuckle.step.contact_rows.Memory`)
    contact_impulse: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # of them on their side a [N s]
    contact_sliding: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    contact_yielding: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    script_delay: float = 0.0  # [s] by which scripts lag behind the time, where they have stalled
    contact_found: bool = False  # the last step found contacts on its way, not at its start
    time: float = 0.0  # [s]
    steps: int = 0
    dt: float = 0.0  # the last step [s], 0 before the first
    stale: bool = True  # forces and memory do not belong to x and v: evaluate and restart before the next step
    work: float = 0.0  # done by nails, velocity goals and force fields so far [J]
    dissipation: float = 0.0  # lost to damping so far [J]
    dissipation_power: float = 0.0  # of damping at the committed state [W]
    field_power: float = 0.0  # of force fields at the committed state [W]
    energies: dict[str, float] = field(default_factory=dict)  # of the committed state [J]
    groups: dict[str, Group] = field(default_factory=dict)  # constraints by name
    group_count: int = 0  # groups ever added
    scene_groups: int = (
        0  # of them, those that the scene defines (numbers 1 to scene_groups); the others were added live
    )
    owner: np.ndarray = field(
        default_factory=lambda: np.zeros((0, 2), dtype=np.int64)
    )  # (points, 2): number and row of the group that holds it
    domain_use: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))  # slides acting over each point
    follows: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (points,) those of rigid bodies
    nailed: wp.array | None = None  # (points,) int32, the nail row that holds each point, -1 without
    external: wp.array | None = None  # (points,) uint8, 1 where a nail or velocity goal acts
    layout: int = 0  # counts changes after which recorded launches no longer fit the tables
    activated: bool = False  # some constraint was switched on since the last step

    def positions(self) -> np.ndarray:
        """Positions of all points [m], shape (points, 3), read-only; on the CPU a view that the next step changes."""
        return _view(self.now.x)

    def velocities(self) -> np.ndarray:
        """Velocities of all points [m/s], shape (points, 3), read-only."""
        return _view(self.now.v)

    def set_positions(self, x: np.ndarray) -> None:
        """Put the points somewhere else [m]; what the scheme remembers starts anew."""
        self.now.x.assign(_checked(x, self.now.x.shape[0], "positions"))
        self.stale = True

    def set_velocities(self, v: np.ndarray) -> None:
        """Give the points other velocities [m/s]; what the scheme remembers starts anew."""
        self.now.v.assign(_checked(v, self.now.v.shape[0], "velocities"))
        self.stale = True

    def set_gravity(self, gravity: np.ndarray) -> None:
        """Change gravity [m/s^2] from the next step on."""
        self.gravity = _checked(np.reshape(gravity, (1, 3)), 1, "gravity")[0]
        self.stale = True


def _view(array: wp.array) -> np.ndarray:
    values = array.numpy()
    values.flags.writeable = False
    return values


def _checked(values: np.ndarray, rows: int, what: str) -> np.ndarray:
    values = np.ascontiguousarray(values, dtype=np.float64)
    if values.shape != (rows, 3) or not np.isfinite(values).all():
        raise InputError(f"{what}: expected finite numbers of shape ({rows}, 3), got shape {values.shape}")
    return values
