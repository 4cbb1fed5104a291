"""Poses of scripted bodies at any time: keyframes, or a Python callable."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.scene.obstacle_definitions import ObstacleDef
from turnbuckle.scene.rigid_definitions import RigidDef, TrajectoryDef

DIFFERENCE = 2e-4  # step of the differences that rates are taken from [s]: of fourth order, good to 1e-11
Pose = Callable[[float], tuple[np.ndarray, Rotation]]


@dataclass(frozen=True)
class Trajectory:
    """Pose of a body's own frame, and its rates."""

    name: str
    pose: Pose
    smooth: bool  # differentiable; else rates come from earlier times
    keys: tuple[np.ndarray, ...] = ()  # what a trajectory by keyframes is made of

    def rates(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Velocity of the frame's origin [m/s], and angular velocity in world axes [rad/s]."""
        x, q = self.pose(t)
        v, w = np.zeros(3), np.zeros(3)
        weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12} if self.smooth else {-1: -1.0}
        for k, weight in weights.items():
            there, turned = self.pose(t + k * DIFFERENCE)
            v += (there - x) * (weight / DIFFERENCE)
            w += (turned * q.inv()).as_rotvec() * (weight / DIFFERENCE)
        return v, w


def start_pose(d: RigidDef | ObstacleDef) -> tuple[np.ndarray, Rotation]:
    """Where a body's own frame starts: origin (3,) [m] and rotation. Raises `InputError`."""
    if d.trajectory is not None:
        return trajectory_of(d).pose(0.0)
    return np.array(d.position), Rotation.from_rotvec(np.array(d.rotation))


def trajectory_of(d: RigidDef | ObstacleDef) -> Trajectory:
    """The trajectory of a scripted body. Raises `InputError`."""
    given = d.trajectory
    if isinstance(given, TrajectoryDef):
        keys = [np.array(a) for a in (given.times, given.positions, given.rotations) if a is not None]
        smooth = given.interpolation == "smooth"
        pose = _keyframes(given, Rotation.from_rotvec(np.array(d.rotation)))
        return Trajectory(d.name, pose, smooth, (*keys, np.array([smooth])))
    assert given is not None
    result = Trajectory(d.name, _callable(d.name, given), True)
    try:
        result.pose(0.0)
    except StepError as error:
        raise InputError(str(error)) from None
    return result


def _keyframes(d: TrajectoryDef, start: Rotation) -> Pose:
    times, x = np.array(d.times), np.array(d.positions)
    turns = start if d.rotations is None else Rotation.from_rotvec(np.array(d.rotations))
    place = turn = None
    if len(times) > 1:
        clamped = ((1, np.zeros(3)), (1, np.zeros(3)))  # at rest before the first key and after the last
        place = CubicSpline(times, x, bc_type=clamped) if d.interpolation == "smooth" else None
        if d.rotations is not None:
            turn = RotationSpline(times, turns) if d.interpolation == "smooth" else Slerp(times, turns)

    def pose(t: float) -> tuple[np.ndarray, Rotation]:
        t = float(np.clip(t, times[0], times[-1]))
        if place is not None:
            here = place(t)
        else:
            here = np.array([np.interp(t, times, column) for column in x.T])
        if d.rotations is None:
            return here, start
        return here, turns[0] if turn is None else turn(t)

    return pose


def _callable(name: str, function: Callable) -> Pose:
    def pose(t: float) -> tuple[np.ndarray, Rotation]:
        try:
            x, r = function(t)
            x, r = np.asarray(x, dtype=float), np.asarray(r, dtype=float)
        except Exception as error:  # whatever the user's function raises
            raise StepError(f"body '{name}': its trajectory failed at t = {t:g} s ({error})") from None
        if x.shape != (3,) or r.shape != (3,) or not (np.isfinite(x).all() and np.isfinite(r).all()):
            raise StepError(
                f"body '{name}': its trajectory must give a position (3,) and a rotation vector (3,), finite, at t = {t:g} s"
            )
        return x, Rotation.from_rotvec(r)

    return pose
