"""The free half of a contact step: A, loads, and what has its motion prescribed, in blocks of velocity (Contact, 3.1).

Blocks are those of `turnbuckle.bodies.implicit_system`: points first, then velocity and angular velocity of each rigid
body. Points of rigid bodies and scripted points have blocks too, which are never solved for.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from turnbuckle.bodies.implicit_system import ImplicitSystem
from turnbuckle.compute import host
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.data.rows import Rows
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import rotate
from turnbuckle.scene.build_rigid_bodies import inertial_pose
from turnbuckle.step.contact_turning import implicit_turn
from turnbuckle.step.contact_zones import Nodes
from turnbuckle.step.field_values import field_values


@dataclass
class Prescribed:
    """Blocks that do not answer to forces in this step, and the velocity that they have in it."""

    fixed: np.ndarray  # (n,) bool
    velocity: np.ndarray  # (n, 3) [m/s or rad/s], of fixed blocks
    scripted: np.ndarray  # (points, 3) positions at the end of the step; NaN for points that are not scripted


class ContactDynamics:
    """A of one model, its loads and its motion."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.system = ImplicitSystem(model)
        self.points = model.points
        self.n = self.system.n
        rigid = model.rigid
        self.dynamic = rigid.motion == DYNAMIC
        self.body_of = model.body_of
        self.slaves = np.flatnonzero(self.body_of >= 0)
        self.never = np.zeros(self.n, dtype=bool)  # blocks that no step solves for
        self.never[: self.points] = model.mass <= 0.0
        self.never[self.points :] = np.repeat(~self.dynamic, 2)
        self.pairs = (self.points + 2 * np.flatnonzero(self.dynamic)).astype(np.int32)
        self.alpha = self.beta = 1.0  # of the scheme (`turnbuckle.bodies.implicit_system`)
        self.waiting = False  # scripts rest in this step
        self.begin()

    # Where things are ----------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Take over the state as the start of a step, which the state may leave before the step is solved."""
        rigid = self.state.rigid
        self.x0, self.bx0, self.q0 = (np.array(host(a)) for a in (self.state.now.x, rigid.x, rigid.q))

    def velocities(self) -> np.ndarray:
        """Velocities of all blocks at the start of the step (n, 3)."""
        v = np.empty((self.n, 3))
        v[: self.points] = host(self.state.now.v)
        v[self.points :: 2] = host(self.state.rigid.v)
        v[self.points + 1 :: 2] = host(self.state.rigid.w)
        return v

    def moved(self, v: np.ndarray, h: float, prescribed: Prescribed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions of points (points, 3), places and quaternions of bodies after ``h`` with velocities v (n, 3).

        Points of rigid bodies follow their bodies, scripted points their script.
        """
        x = self.x0 + h * v[: self.points]
        there = ~np.isnan(prescribed.scripted[:, 0])
        x[there] = prescribed.scripted[there]
        bx = self.bx0 + h * v[self.points :: 2]
        turn = Rotation.from_rotvec(h * v[self.points + 1 :: 2])
        q = (turn * Rotation.from_quat(self.q0)).as_quat()
        if len(self.slaves):
            body = self.body_of[self.slaves]
            x[self.slaves] = bx[body] + rotate(q[body], self.model.rigid.local[self.slaves])
        return x, bx, q

    def arms(self, x: np.ndarray) -> np.ndarray:
        """From the centre of the body to each point at ``x``, (points, 3); zero for points of no rigid body."""
        return self.arms_of(x, self.bx0)

    def arms_of(self, x: np.ndarray, bx: np.ndarray) -> np.ndarray:
        """The same for centres of bodies at ``bx`` (bodies, 3)."""
        r = np.zeros((self.points, 3))
        r[self.slaves] = x[self.slaves] - bx[self.body_of[self.slaves]]
        return r

    def nodes(self, a: sp.bsr_array, prescribed: Prescribed) -> Nodes:
        """What zones of impact are made of, at the start of the step."""
        points = self.points
        place = np.concatenate([self.x0, np.repeat(self.bx0, 2, axis=0)])
        mass = np.zeros(self.n)
        mass[:points] = np.maximum(self.model.mass, 0.0)
        mass[points::2] = self.model.rigid.mass
        inertia = np.zeros((self.n, 3, 3))
        inertia[points + 1 :: 2] = self.inertias(self.q0)
        first = np.arange(self.n)
        first[points + 1 :: 2] -= 1
        spins = np.zeros(self.n, dtype=bool)
        spins[points + 1 :: 2] = True
        return Nodes(place, mass, inertia, prescribed.fixed, first, spins)

    def inertias(self, q: np.ndarray) -> np.ndarray:
        """Tensors of inertia in world axes (bodies, 3, 3) [kg m^2] of bodies turned by ``q`` (bodies, 4)."""
        turn = Rotation.from_quat(q).as_matrix()
        return np.einsum("nij,nj,nkj->nik", turn, self.model.rigid.inertia, turn)

    def masses(self) -> sp.bsr_array:
        """M at the start of the step, as A of explicit schemes: ones where nothing is ever solved for."""
        blocks = np.tile(np.eye(3), (self.n, 1, 1))
        own = ~self.never[: self.points]
        blocks[: self.points][own] *= self.model.mass[own, None, None]
        blocks[self.points :: 2][self.dynamic] *= self.model.rigid.mass[self.dynamic, None, None]
        blocks[self.points + 1 :: 2][self.dynamic] = self.inertias(self.q0)[self.dynamic]
        index = np.arange(self.n + 1, dtype=np.int32)
        return sp.bsr_array((blocks, index[:-1], index), shape=(3 * self.n, 3 * self.n))

    def block_of(self, point: np.ndarray) -> np.ndarray:
        """The block that moves each point: its own, or the first of its rigid body."""
        body = self.body_of[point]
        return np.where(body >= 0, self.points + 2 * body, point)

    # What acts -----------------------------------------------------------------------------------------------------

    def prescribe(self, h: float, nails: Rows | None) -> Prescribed:
        """Everything that moves by script in this step: obstacles, trajectories, nailed points."""
        fixed = self.never.copy()
        velocity = np.zeros((self.n, 3))
        x = host(self.state.now.x)
        scripted = np.full((self.points, 3), np.nan)
        end = self.state.time + (0.0 if self.waiting else h) - self.state.script_delay
        for script in self.model.scripted:
            part = slice(script.begin, script.end)
            scripted[part] = script.positions(end) if script.moves else x[part]
            velocity[part] = (scripted[part] - x[part]) / h
        rigid = self.model.rigid
        for b, trajectory in rigid.trajectories.items():
            origin, turn = trajectory.pose(end)  # type: ignore[attr-defined]
            place, q = inertial_pose(rigid, b, origin, turn)
            back = Rotation.from_quat(host(self.state.rigid.q)[b]).inv()
            velocity[self.points + 2 * b] = (place - host(self.state.rigid.x)[b]) / h
            velocity[self.points + 2 * b + 1] = (Rotation.from_quat(q) * back).as_rotvec() / h
        if nails is not None and len(nails.target):
            point = nails.weights.indices
            fixed[point] = True
            velocity[point] = (nails.target - x[point]) / h
        return Prescribed(fixed, velocity, scripted)

    def refresh(self, h: float) -> sp.bsr_array:
        """A and all forces of elements at the state."""
        state, rigid = self.state, self.state.rigid
        return self.system.assemble(
            host(state.now.x), host(state.now.v), h, self.alpha, self.beta, gravity=state.gravity,
            rigid_q=host(rigid.q), rigid_v=host(rigid.v), rigid_w=host(rigid.w),
        )  # fmt: skip

    def again(self, x: np.ndarray, v: np.ndarray, h: float) -> sp.bsr_array:
        """A and all forces of elements at an iterate ``x``, ``v`` (points, 3); rigid bodies as at the start."""
        return self.system.assemble(x, v, h, self.alpha, self.beta, gravity=self.state.gravity)

    def turned(self, h: float) -> np.ndarray:
        """What a free turn over ``h`` changes of ``I w``: ``I (w_free - w)``.

        w_free has the same angular momentum L after the turn ``h w_free`` that it leads (`implicit_turn`): of first order,
        and it takes energy, if any. With the turn that the old w leads instead, fast bodies gain without a bound.
        """
        rigid = self.state.rigid
        q, w = host(rigid.q), host(rigid.w)
        inertia = self.model.rigid.inertia
        here = Rotation.from_quat(q)
        own = here.inv().apply(w)
        out = np.zeros_like(w)
        some = self.dynamic
        free = implicit_turn(inertia[some], own[some], h)
        out[some] = here[some].apply(inertia[some] * (free - own[some])) if some.any() else 0.0
        return out

    def pushes(self, x: np.ndarray, v: np.ndarray, bx: np.ndarray, q: np.ndarray, t: float) -> np.ndarray:
        """What the user pushes with: loads and force fields (n, 3) [N, N m] at ``x`` (points, 3), poses ``bx``, ``q``,
        block velocities ``v`` (n, 3) and time ``t``. Raises FloatingPointError where one is not finite."""
        out = np.zeros((self.n, 3))
        for f in self.model.fields:
            values = field_values(f.name, f.force, x[f.points], v[f.points], t, self.model.mass[f.points])
            if not np.isfinite(values).all():
                raise FloatingPointError(f"force '{f.name}' is not finite at t = {t:g} s")
            out[f.points] += values
        if self.dynamic.any():
            out[self.points :: 2], out[self.points + 1 :: 2] = self._rigid_loads(
                bx, q, v[self.points :: 2], v[self.points + 1 :: 2], t
            )
        out[self.never] = 0.0
        return out

    def _rigid_loads(
        self, x: np.ndarray, q: np.ndarray, v: np.ndarray, w: np.ndarray, t: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pushes and force fields on bodies [N], [N m]."""
        pushes, bodies = self.state.loads, self.model.rigid
        force = pushes.force.copy()
        torque = pushes.torque + np.cross(rotate(q, pushes.at), pushes.force)
        for f in self.model.rigid_fields:
            b = f.bodies
            arm = rotate(q[b], f.at)
            given = (x[b] + arm, v[b] + np.cross(w[b], arm), t, bodies.mass[b])
            value = field_values(f.name, f.force, *given)
            force[b] += value
            torque[b] += np.cross(arm, value)
            if f.torque is not None:
                torque[b] += field_values(f.name, f.torque, *given)
        if not (np.isfinite(force).all() and np.isfinite(torque).all()):
            raise FloatingPointError(f"a force on rigid bodies is not finite at t = {t:g} s")
        return force, torque

    # What is measured ----------------------------------------------------------------------------------------------

    def kinetic(self, v: np.ndarray, q: np.ndarray) -> float:
        """Energy of motion [J] with block velocities v (n, 3) and bodies turned by q (bodies, 4)."""
        points = 0.5 * float(
            np.maximum(self.model.mass, 0.0) @ np.einsum("ij,ij->i", v[: self.points], v[: self.points])
        )
        rigid = self.model.rigid
        spin = Rotation.from_quat(q).inv().apply(v[self.points + 1 :: 2])
        linear = np.einsum("ij,ij->i", v[self.points :: 2], v[self.points :: 2])
        own = 0.5 * (rigid.mass * linear + np.einsum("ij,ij->i", rigid.inertia, spin * spin))
        return points + float(own[self.dynamic].sum())

    def energy(self, v: np.ndarray, x: np.ndarray, bx: np.ndarray, q: np.ndarray) -> float:
        """Kinetic, elastic (at the last `refresh`) and in the field of gravity [J]."""
        return self.kinetic(v, q) + self.system.elastic_energy() + self.gravity_energy(x, bx)

    def work_of_forces(self, moved: np.ndarray) -> float:
        """What weights and the forces of elements at the last `refresh` do when blocks move by ``moved`` (n, 3) [m] [J]."""
        p = self.points
        weight = self.model.rigid.mass[self.dynamic] @ (moved[p::2][self.dynamic] @ self.state.gravity)
        own = ~self.never[:p]
        return float(np.sum(self.system.force[:p][own] * moved[:p][own])) + float(weight)

    def gravity_energy(self, x: np.ndarray, bx: np.ndarray) -> float:
        """Energy in the field of gravity [J]."""
        g = self.state.gravity
        own = self.model.rigid.mass[self.dynamic] @ (bx[self.dynamic] @ g)
        return -float(np.maximum(self.model.mass, 0.0) @ (x @ g)) - float(own)
