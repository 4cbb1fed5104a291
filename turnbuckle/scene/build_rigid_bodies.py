"""Rigid bodies of a scene as arrays: inertial frames, first poses, loads."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data import rigid
from turnbuckle.data.rigid import Loads, RigidBodies, RigidField, RigidState
from turnbuckle.data.shape import Shape
from turnbuckle.scene.build_bodies import Body
from turnbuckle.scene.definitions import ForceDef, RigidDef
from turnbuckle.scene.trajectories import trajectory_of

MOTION = {"immobile": rigid.IMMOBILE, "trajectory": rigid.TRAJECTORY, "dynamic": rigid.DYNAMIC}
DIAGONAL = 1e-12  # of the largest moment: products of inertia below are none


def rigid_bodies(
    definitions: Sequence[RigidDef], bodies: Sequence[Body], shapes: Sequence[Shape], points: int
) -> RigidBodies:
    """The constant arrays; row 0 is the world. ``points``: all of the state."""
    n = len(definitions) + 1
    frame_x, frame_q = np.zeros((n, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    mass, inertia = np.ones(n), np.ones((n, 3))
    damping, ability = np.zeros((n, 2)), np.full(n, np.nan)
    trajectories: dict[int, object] = {}
    local = np.zeros((points, 3))
    for i, (d, body) in enumerate(zip(definitions, bodies, strict=True), start=1):
        assert body.rigid is not None
        mass[i] = body.rigid.mass
        inertia[i], axes = principal_axes(body.rigid.inertia)
        frame_x[i] = -axes.T @ body.rigid.center
        frame_q[i] = Rotation.from_matrix(axes.T).as_quat()
        local[shapes[i - 1].begin : shapes[i - 1].end] = (body.rigid.vertices - body.rigid.center) @ axes
        damping[i] = d.linear_damping, d.angular_damping
        if d.ability_to_rotate is not None:
            ability[i] = d.ability_to_rotate
        if d.trajectory is not None:
            trajectories[i] = trajectory_of(d)
    return RigidBodies(
        names=("world", *(d.name for d in definitions)),
        motion=np.array([rigid.IMMOBILE, *(MOTION[d.motion] for d in definitions)], dtype=np.int32),
        mass=mass,
        inertia=inertia,
        frame_x=frame_x,
        frame_q=frame_q,
        damping=damping,
        ability_to_rotate=ability,
        begin=np.array([0, *(s.begin for s in shapes)]),
        end=np.array([0, *(s.end for s in shapes)]),
        local=local,
        trajectories=trajectories,
    )


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,), and their axes as the columns of a rotation (3, 3); the own axes where they are principal."""
    off = inertia - np.diag(np.diag(inertia))
    if np.abs(off).max() <= DIAGONAL * np.abs(inertia).max():
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return moments, axes


def first_state(definitions: Sequence[RigidDef], bodies: RigidBodies, device: str) -> RigidState:
    """Poses and velocities at the start."""
    n = bodies.count
    x, q = np.zeros((n, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    v, w = np.zeros((n, 3)), np.zeros((n, 3))
    for i, d in enumerate(definitions, start=1):
        origin, turn = np.array(d.position), Rotation.from_rotvec(np.array(d.rotation))
        if i in bodies.trajectories:
            origin, turn = bodies.trajectories[i].pose(0.0)  # type: ignore[attr-defined]
        x[i], q[i] = inertial_pose(bodies, i, origin, turn)
        if bodies.motion[i] == rigid.DYNAMIC:
            v[i], w[i] = d.velocity, d.angular_velocity
        elif i in bodies.trajectories:
            rate, w[i] = bodies.trajectories[i].rates(0.0)  # type: ignore[attr-defined]
            v[i] = rate + np.cross(w[i], x[i] - origin)
    state = RigidState.at_rest(n, device)
    for array, values in ((state.x, x), (state.q, q), (state.v, v), (state.w, w)):
        array.assign(values)
    return state


def inertial_pose(bodies: RigidBodies, i: int, origin: np.ndarray, turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass (3,) and xyzw of the inertial frame of body ``i`` whose own frame lies at ``origin``, ``turn``."""
    to_world = turn * Rotation.from_quat(bodies.frame_q[i]).inv()
    return origin - to_world.apply(bodies.frame_x[i]), to_world.as_quat()


def no_loads(n: int) -> Loads:
    """No user's pushes."""
    return Loads(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))


def rigid_field(d: ForceDef, bodies: RigidBodies, force: object, torque: object | None) -> RigidField | None:
    """The field on the rigid bodies it acts on, None where there is none of them."""
    if d.body is None:
        chosen = np.flatnonzero(bodies.motion == rigid.DYNAMIC)
    else:
        chosen = np.array([i for i, name in enumerate(bodies.names) if i > 0 and name == d.body], dtype=int)
    if len(chosen) == 0:
        return None
    at = np.zeros((len(chosen), 3))
    if d.at is not None:
        for row, b in enumerate(chosen):
            at[row] = bodies.frame_x[b] + Rotation.from_quat(bodies.frame_q[b]).apply(np.array(d.at))
    return RigidField(d.name, chosen, at, force, torque)
