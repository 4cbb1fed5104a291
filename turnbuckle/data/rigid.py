"""Rigid bodies and joints as arrays: what is constant (`RigidBodies`, `JointParts`) and what evolves (`RigidState`).

Body 0 is the world: immobile, at the origin. x is the centre of mass, q (xyzw) turns the body's *inertial frame* (origin
at the centre of mass, axes along the principal axes of inertia) into the world. What the user writes is in the body's own
frame, which lies at `frame_x`, `frame_q` in the inertial one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import warp as wp

ForceField = Callable[[np.ndarray, np.ndarray, float, np.ndarray], np.ndarray]
"""``f(x (n, 3) [m], v (n, 3) [m/s], t [s], mass (n,) [kg]) -> (n, 3) [N]``."""

# What a body does.
IMMOBILE = 0
TRAJECTORY = 1
DYNAMIC = 2

# Parts of joints (column `kind`). Body a carries the point P_a (or the axis), body b the domain; z is the third axis of
# the frames q_a, q_b. `lo`, `hi` bound the coordinate named last; equality where both are the same.
POINT = wp.constant(0)  # P_a = P_b
SEGMENT = wp.constant(1)  # P_a on the line through P_b along z_b; place along it
RING = wp.constant(2)  # P_a in the plane through P_b with normal z_b; distance from P_b in the plane
SPHERE = wp.constant(3)  # distance of P_a from P_b
CURVE = wp.constant(4)  # P_a on curve number `domain` of body b
SURFACE = wp.constant(5)  # P_a on surface number `domain` of body b
CALLABLE = wp.constant(6)  # P_a in the user's domain number `domain` of body b
ANGLE = wp.constant(7)  # angle between z_a and z_b
TWIST = wp.constant(8)  # twist about the axes z: x_b to x_a (swing-twist)
FIXED = wp.constant(9)  # both frames turned alike
MOTOR_AXIAL = wp.constant(10)  # drives the place of P_a along z_b
MOTOR_TWIST = wp.constant(11)  # drives the rotation of a about z_b relative to b
ROLLING = wp.constant(
    12
)  # a wheel centred at P_a with axle z_a and radius `hi` rolls on the plane through P_b with normal z_b
TIE = wp.constant(13)  # weighted points of bodies and mass points at a goal (the point constraints of Local)
TRANSLATIONS = (POINT, SEGMENT, RING, SPHERE, CURVE, SURFACE, CALLABLE)

ROWS = 3  # of a part at most
FREE = 1e300  # a bound that bounds nothing


@dataclass(frozen=True)
class RigidBodies:
    """What is constant of rigid bodies, host arrays; row 0 is the world."""

    names: tuple[str, ...]  # names[0] is "world"
    motion: np.ndarray  # (n,) int32: IMMOBILE, TRAJECTORY or DYNAMIC
    mass: np.ndarray  # (n,) [kg]; what is not dynamic has its mass too, and does not feel it
    inertia: np.ndarray  # (n, 3) principal moments [kg m^2]
    frame_x: np.ndarray  # (n, 3) origin of the user's frame in the inertial frame [m]
    frame_q: np.ndarray  # (n, 4) xyzw, its axes in the inertial frame
    damping: np.ndarray  # (n, 2) linear, angular [1/s]
    ability_to_rotate: np.ndarray  # (n,) [1/m^2] in place of m J^-1 (Displacement, 3.1.4); NaN where the inertia counts
    begin: np.ndarray  # (n,) first of its points among the points of the state
    end: np.ndarray  # (n,)
    local: np.ndarray  # (points of the state, 3) places of their points in the inertial frames [m]; 0 for mass points
    trajectories: dict[int, object] = field(default_factory=dict)  # body -> t -> (x, q) of the user's frame

    @property
    def count(self) -> int:
        """Bodies, the world included."""
        return len(self.names)


@dataclass
class RigidState:
    """What evolves of rigid bodies, row 0 the world."""

    x: wp.array  # (n,) vec3d, centre of mass [m]
    q: wp.array  # (n,) quatd xyzw, inertial frame to world
    v: wp.array  # (n,) vec3d [m/s], of the centre of mass
    w: wp.array  # (n,) vec3d [rad/s], in world axes
    force: wp.array  # (n,) vec3d, all loads but gravity at this state [N]
    torque: wp.array  # (n,) vec3d, about the centre of mass, world axes [N m]

    @classmethod
    def at_rest(cls, n: int, device: str) -> "RigidState":
        """All at the origin."""
        q = wp.full(n, wp.quatd(0.0, 0.0, 0.0, 1.0), dtype=wp.quatd, device=device)
        x, v, w, force, torque = (wp.zeros(n, dtype=wp.vec3d, device=device) for _ in range(5))
        return cls(x, q, v, w, force, torque)


@dataclass
class Loads:
    """What the user pushes with until told otherwise, world axes; host arrays."""

    force: np.ndarray  # (n, 3) [N]
    torque: np.ndarray  # (n, 3) [N m]
    at: np.ndarray  # (n, 3) where the force acts, in the inertial frame [m]


@dataclass(frozen=True)
class RigidField:
    """A force field on rigid bodies."""

    name: str
    bodies: np.ndarray  # (k,) int
    at: np.ndarray  # (k, 3) where the force acts, in the inertial frames [m]
    force: ForceField
    torque: ForceField | None


@dataclass
class Joint:
    """A joint as a whole: its name, what the user wants of it, and its parts. Host data."""

    name: str
    kind: str  # the user's word: "ball", "revolute", "joint", ...
    a: int  # body1, with the point
    b: int  # body0, with the domain; 0 is the world
    parts: np.ndarray  # (k,) int, rows of `JointParts`
    enabled: bool = True
    start: float = 0.0  # [s]
    end: float = np.inf  # [s]
    break_force: float = np.inf  # [N]
    break_torque: float = np.inf  # [N m]
    mu: float = np.nan  # part of a correction that body a takes (3.1.4); NaN: by masses
    alpha: float = np.nan  # factor on its corrections, displacement solver (3.1.2); NaN: the scene's
    acting: bool = False
    broken: bool = False
    live: bool = False  # added in the run, not defined by the scene
    definition: object = None


@dataclass
class JointParts:
    """Elementary conditions between two bodies, one row each; host arrays (k, ...), see the kinds above."""

    kind: np.ndarray  # (k,) int32
    joint: np.ndarray  # (k,) int32, which joint it belongs to
    a: np.ndarray  # (k,) int32 body
    b: np.ndarray  # (k,) int32 body
    p_a: np.ndarray  # (k, 3) in a's inertial frame [m]
    p_b: np.ndarray  # (k, 3) in b's inertial frame [m]
    q_a: np.ndarray  # (k, 4) xyzw, a frame fixed in a, in a's inertial frame
    q_b: np.ndarray  # (k, 4) xyzw
    lo: np.ndarray  # (k,) [m or rad], -FREE where unlimited
    hi: np.ndarray  # (k,) FREE where unlimited
    stiffness: np.ndarray  # (k,) [N/m or N m/rad], outside [lo, hi]; 0 with damping 0: a strict domain
    damping: np.ndarray  # (k,) [N s/m or N m s/rad]
    restitution: np.ndarray  # (k,) [1]
    target: np.ndarray  # (k,) motors: wanted rate, or place
    time_constant: np.ndarray  # (k,) motors: 0 for a rate, else [s] in which a place is approached
    max_force: np.ndarray  # (k,) motors [N or N m], FREE where unlimited
    domain: np.ndarray  # (k,) int32, number of the curve, surface or callable, else -1

    @property
    def count(self) -> int:
        """Parts."""
        return len(self.kind)

    @property
    def soft(self) -> np.ndarray:
        """Which parts are preferential domains, (k,) bool."""
        return (self.stiffness > 0.0) | (self.damping > 0.0)
