"""How much each body gives way: by mass and inertia (Displacement, 3.1.3), or by the user's parameters (3.1.4).

Of a pair it is the share ``t`` of the translation that a body takes, ``m2 / (m1 + m2)`` or mu, and of each body alone
``C``, ``m J^-1`` or its ability to rotate: with a gap g, (18) and (19) are ``t C (r x g)`` and ``t g``.
"""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.rigid import DYNAMIC, Joint, RigidBodies


@dataclass(frozen=True)
class Mobility:
    """What moves, host arrays."""

    dynamic: np.ndarray  # (n,) bool
    inverse_mass: np.ndarray  # (n,) [1/kg], 0 where immobile or on a trajectory
    turning: np.ndarray  # (n, 3) C along the principal axes [1/m^2], 0 where immobile
    share_a: np.ndarray  # (joints,) part of a correction that body a takes [1]
    share_b: np.ndarray


def mobility(bodies: RigidBodies, joints: list[Joint], user_parameter: bool) -> Mobility:
    """Shares and C of all. In `user_parameter` mode what the user left open stays physical, so that both kinds mix."""
    dynamic = np.asarray(bodies.motion) == DYNAMIC
    safe = np.where(bodies.mass > 0.0, bodies.mass, 1.0)
    inverse = np.where(dynamic, 1.0 / safe, 0.0)
    moments = np.where(bodies.inertia > 0.0, bodies.inertia, 1.0)
    turning = np.where(dynamic[:, None], safe[:, None] / moments, 0.0)
    if user_parameter:
        ability = np.asarray(bodies.ability_to_rotate, dtype=float)
        given = dynamic & np.isfinite(ability)
        turning[given] = ability[given, None]
    a = np.array([joint.a for joint in joints], dtype=np.int64)
    b = np.array([joint.b for joint in joints], dtype=np.int64)
    total = inverse[a] + inverse[b]
    share_a = np.where(total > 0.0, inverse[a] / np.where(total > 0.0, total, 1.0), 0.0)
    if user_parameter:
        mu = np.array([joint.mu for joint in joints], dtype=float)
        chosen = np.isfinite(mu) & dynamic[a] & dynamic[b]
        share_a = np.where(chosen, mu, share_a)
    share_b = np.where(dynamic[b], 1.0 - share_a, 0.0)
    share_b = np.where(total > 0.0, share_b, 0.0)
    return Mobility(dynamic, inverse, turning, share_a, share_b)
