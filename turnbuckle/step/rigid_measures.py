"""Energies and momenta of rigid bodies, in NumPy, from poses and velocities alone."""

import numpy as np

from turnbuckle.compute import host
from turnbuckle.data import rigid
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import RigidState
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import conjugate, rotate
from turnbuckle.step.articulated_system import System
from turnbuckle.step.coordinates import coordinates


def spins(model: Model, at: RigidState) -> np.ndarray:
    """Angular momenta about the centres of mass (n, 3) [kg m^2/s]."""
    q = host(at.q)
    return rotate(q, model.rigid.inertia * rotate(conjugate(q), host(at.w)))


def rigid_energies(model: Model, state: State, at: RigidState) -> dict[str, float]:
    """Kinetic and gravity energy of dynamic bodies, and of soft joints as elastic [J]."""
    moves = model.rigid.motion == rigid.DYNAMIC
    mass, x, v, w = model.rigid.mass[moves], host(at.x)[moves], host(at.v)[moves], host(at.w)[moves]
    kinetic = 0.5 * float(np.sum(mass * np.sum(v * v, axis=1)) + np.sum(spins(model, at)[moves] * w))
    gravity = -float(mass @ (x @ state.gravity))
    parts = state.parts
    soft = np.flatnonzero(parts.stiffness > 0.0)
    elastic = 0.0
    if len(soft):
        s = coordinates(parts, soft, host(at.x), host(at.q))
        off = np.maximum(s - parts.hi[soft], 0.0) + np.minimum(s - parts.lo[soft], 0.0)
        on = np.zeros(parts.count, dtype=bool)
        for joint in state.joints.values():
            on[joint.parts] = joint.acting
        elastic = 0.5 * float(np.sum(np.where(on[soft], parts.stiffness[soft] * off**2, 0.0)))
    return {"kinetic": kinetic, "gravity": gravity, "elastic": elastic}


def rigid_momentum(
    model: Model, state: State, system: System, before: RigidState, after: RigidState, dt: float
) -> tuple[float, float]:
    """Change of momentum by joints between bodies that nothing else holds: linear over ``sum m|v|``, angular over that times
    the largest |x| (plus the sum of spins)."""
    bodies = system.internal_bodies
    if len(bodies) == 0:
        return 0.0, 0.0
    m = model.rigid.mass[bodies][:, None]
    x0, x1, v0, v1 = (host(a)[bodies] for a in (before.x, after.x, before.v, after.v))
    if model.rigid_motion == "paper":  # its kick comes first, and its gyroscopic term is of first order: joints only
        return 0.0, 0.0
    l0, l1 = (spins(model, s)[bodies] for s in (before, after))
    f0, f1, t0, t1 = (host(a)[bodies] for a in (before.force, after.force, before.torque, after.torque))
    f0, f1 = f0 + m * state.gravity, f1 + m * state.gravity
    half = 0.5 * dt
    linear = (m * (v1 - v0) - half * (f0 + f1)).sum(axis=0)
    angular = np.cross(x1, m * v1) + l1 - np.cross(x0, m * v0) - l0
    angular = (angular - half * (np.cross(x0, f0) + t0 + np.cross(x1, f1) + t1)).sum(axis=0)
    scale = float(np.sum(m * np.linalg.norm(v1, axis=1, keepdims=True)))
    reach = float(np.linalg.norm(x1, axis=1).max()) * scale + float(np.linalg.norm(l1, axis=1).sum())
    if scale <= 0.0 or reach <= 0.0:
        return 0.0, 0.0
    return float(np.linalg.norm(linear)) / scale, float(np.linalg.norm(angular)) / reach
