"""Energies and momenta of rigid bodies, from poses and velocities alone."""

import math

import numpy as np
import warp as wp

from turnbuckle.compute import Program, host
from turnbuckle.data.articulated import Bodies
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import RigidState
from turnbuckle.data.state import GRAVITY, H, State
from turnbuckle.math.index import known
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3
from turnbuckle.step.articulated_system import System
from turnbuckle.step.coordinates import coordinates

wp.set_module_options({"enable_backward": False})

MEASURES = 11  # of each body, see `measure_bodies`


@wp.kernel
def measure_bodies(
    begin: int,
    internal: wp.array(dtype=wp.int32),
    params: wp.array(dtype=real),
    bodies: Bodies,
    force1: wp.array(dtype=vec3),
    torque1: wp.array(dtype=vec3),
    out: wp.array2d(dtype=real),
):
    """Kinetic energy, gravity energy; of bodies that joints alone hold: m|v|, |x|, |spin|, and what loads do not explain of the
    change of their linear and angular momentum in the step. ``force1``, ``torque1``: loads at its end."""
    b = known(begin + wp.tid())
    g = vec3(params[GRAVITY], params[GRAVITY + 1], params[GRAVITY + 2])
    half = real(0.5) * params[H]
    m = bodies.mass[b]
    x1 = bodies.x1[b]
    v1 = bodies.v1[b]
    spin1 = turned_inertia(bodies.q1[b], bodies.inertia[b], bodies.w1[b])
    for k in range(MEASURES):
        out[b, k] = real(0.0)
    if bodies.dynamic[b] == 1:
        out[b, 0] = real(0.5) * (m * wp.length_sq(v1) + wp.dot(spin1, bodies.w1[b]))
        out[b, 1] = -m * wp.dot(g, x1)
    if internal[b] == 1:
        x0 = bodies.x0[b]
        spin0 = turned_inertia(bodies.q0[b], bodies.inertia[b], bodies.w0[b])
        f0 = bodies.force[b] + g * m
        f1 = force1[b] + g * m
        dp = (v1 - bodies.v0[b]) * m - (f0 + f1) * half
        dl = wp.cross(x1, v1) * m - wp.cross(x0, bodies.v0[b]) * m + spin1 - spin0
        dl -= (wp.cross(x0, f0) + wp.cross(x1, f1) + bodies.torque[b] + torque1[b]) * half
        out[b, 2] = m * wp.length(v1)
        out[b, 3] = wp.length(x1)
        out[b, 4] = wp.length(spin1)
        for k in range(3):
            out[b, 5 + k] = dp[k]
            out[b, 8 + k] = dl[k]


class RigidMeasures:
    """Records the measurement of bodies, and reads it out."""

    def __init__(self, model: Model, state: State, system: System) -> None:
        self.model, self.state = model, state
        flags = np.zeros(model.rigid.count, dtype=np.int32)
        if model.rigid_motion != "paper":  # its kick comes first, and its gyroscopic term is of first order
            flags[system.internal_bodies] = 1
        self.internal = wp.array(flags, dtype=wp.int32, device=model.device)
        self.out = wp.zeros((model.rigid.count, MEASURES), dtype=wp.float64, device=model.device)
        self.soft = np.flatnonzero(state.parts.stiffness > 0.0)

    def record(self, p: Program, params: wp.array, bodies: Bodies, ahead: RigidState) -> None:
        """Record the measurement of a step; ``bodies`` with the loads of its start."""
        given = [self.internal, params, bodies, ahead.force, ahead.torque]
        p.launch(measure_bodies, self.model.rigid.count, [*given, self.out])

    def read(self, ahead: RigidState) -> tuple[dict[str, float], tuple[float, float]]:
        """Energies [J] by name (soft joints as elastic), and the change of momentum by joints: linear over ``sum m|v|``, angular
        over that times the largest |x| plus the sum of spins."""
        values = host(self.out)
        kinetic, gravity, speed, _, spin, px, py, pz, lx, ly, lz = values.sum(axis=0).tolist()
        energies = {"kinetic": kinetic, "gravity": gravity, "elastic": self._elastic(ahead) if len(self.soft) else 0.0}
        reach = float(values[:, 3].max()) * speed + spin
        if speed <= 0.0 or reach <= 0.0:
            return energies, (0.0, 0.0)
        return energies, (math.hypot(px, py, pz) / speed, math.hypot(lx, ly, lz) / reach)

    def _elastic(self, at: RigidState) -> float:
        parts, soft = self.state.parts, self.soft
        s = coordinates(parts, soft, host(at.x), host(at.q))
        off = np.maximum(s - parts.hi[soft], 0.0) + np.minimum(s - parts.lo[soft], 0.0)
        on = np.zeros(parts.count, dtype=bool)
        for joint in self.state.joints.values():
            on[joint.parts] = joint.acting
        return 0.5 * float(np.sum(np.where(on[soft], parts.stiffness[soft] * off**2, 0.0)))
