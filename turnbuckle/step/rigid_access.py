"""Reading and writing one rigid body or joint, in the frames of the user."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data import rigid
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import Joint
from turnbuckle.data.state import State
from turnbuckle.scene.build_rigid_bodies import inertial_pose
from turnbuckle.step.coordinates import coordinates

NAMES = {
    rigid.SEGMENT: "place", rigid.MOTOR_AXIAL: "place", rigid.RING: "distance", rigid.SPHERE: "distance",
    rigid.ANGLE: "angle", rigid.TWIST: "twist", rigid.MOTOR_TWIST: "twist",
}  # fmt: skip


def _vector(value: Any, what: str, size: int = 3) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected {size} finite numbers, got {value!r}") from None
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{what}: expected {size} finite numbers, got {value!r}")
    return array


def read_pose(model: Model, state: State, b: int) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and quaternion xyzw (4,) of the own frame of body ``b``."""
    to_world = Rotation.from_quat(state.rigid.q.numpy()[b])
    own = to_world * Rotation.from_quat(model.rigid.frame_q[b])
    return state.rigid.x.numpy()[b] + to_world.apply(model.rigid.frame_x[b]), own.as_quat()


def write_pose(model: Model, state: State, b: int, position: Any, quaternion: Any) -> None:
    """Put the own frame of body ``b`` somewhere else."""
    origin, turn = _vector(position, "position"), _vector(quaternion, "quaternion", 4)
    if not np.linalg.norm(turn) > 1e-12:
        raise InputError("quaternion: must not be zero")
    x, q = inertial_pose(model.rigid, b, origin, Rotation.from_quat(turn))
    _write(state.rigid.x, b, x)
    _write(state.rigid.q, b, q)


def write_velocity(model: Model, state: State, b: int, velocity: Any, angular: Any) -> None:
    """Give body ``b`` other speeds."""
    if model.rigid.motion[b] != rigid.DYNAMIC:
        raise InputError(f"body '{model.rigid.names[b]}' is not dynamic; its velocity is not free")
    _write(state.rigid.v, b, _vector(velocity, "velocity"))
    _write(state.rigid.w, b, _vector(angular, "angular velocity"))


def write_push(model: Model, state: State, b: int, force: Any, torque: Any, at: Any) -> None:
    """Load body ``b``."""
    if force is None and torque is None:
        raise InputError(
            f"push '{model.rigid.names[b]}': give a force or a torque; a force of [0, 0, 0] ends a push that goes on"
        )
    if at is not None and force is None:
        raise InputError(f"push '{model.rigid.names[b]}': 'at' is where a force acts; give the force")
    zero, loads = np.zeros(3), state.loads
    loads.force[b] = zero if force is None else _vector(force, "force")
    loads.torque[b] = zero if torque is None else _vector(torque, "torque")
    loads.at[b] = 0.0
    if at is not None:
        local = Rotation.from_quat(model.rigid.frame_q[b]).apply(_vector(at, "at"))
        loads.at[b] = model.rigid.frame_x[b] + local
    state.stale = True


def write_target(state: State, joint: Joint, value: Any) -> None:
    """Give the motor of a joint another target: a rate [m/s or rad/s], or a place or angle [m or rad]."""
    motors = joint.parts[np.isin(state.parts.kind[joint.parts], (rigid.MOTOR_AXIAL, rigid.MOTOR_TWIST))]
    if len(motors) == 0:
        raise InputError(f"joint '{joint.name}' has no motor; give it one where it is defined")
    number = np.asarray(value, dtype=object)
    if number.shape != () or isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise InputError(f"joint '{joint.name}': the target of its motor must be one number, got {value!r}")
    if not np.isfinite(value):
        raise InputError(f"joint '{joint.name}': the target of its motor is not finite: {value}")
    state.parts.target[motors] = value


def _write(array: Any, b: int, value: np.ndarray) -> None:
    values = array.numpy()
    values[b] = value
    array.assign(values)


def read_coordinates(state: State, joint: Joint) -> dict[str, float]:
    """The coordinates of the parts of a joint by name."""
    s = coordinates(state.parts, joint.parts, state.rigid.x.numpy(), state.rigid.q.numpy())
    kinds = state.parts.kind[joint.parts]
    return {NAMES[int(k)]: float(value) for k, value in zip(kinds, s, strict=True) if int(k) in NAMES}
