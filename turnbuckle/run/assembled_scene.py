"""A scene with its bodies elsewhere, and everything that was said relative to the start still meaning the same."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.model import Model
from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.data.state import State
from turnbuckle.run.assembly_bodies import Clumps
from turnbuckle.run.frozen_selections import frozen, frozen_force
from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import (
    BodyPairDef,
    CoatingDef,
    JointDef,
    NamedJointDef,
    RigidDef,
    RollingDef,
    SceneDef,
    TwistDef,
)
from turnbuckle.scene.joint_definitions import AngleDef
from turnbuckle.scene.named_joints import perpendicular
from turnbuckle.scene.scene import Scene
from turnbuckle.solvers.displacement.conditions import Poses

STAYED = 1e-15  # [m or rad], a body moved by less stays as it was written
ALIKE = 1e-9  # [rad], relative orientations nearer than this say the same

Frame = tuple[np.ndarray, Rotation]


def moved_scene(scene: Scene, model: Model, state: State, made: Clumps, poses: Poses) -> Scene:
    """The scene with its bodies at ``poses``. Velocities are left as they are."""
    definition = scene.definition
    number = {name: i for i, name in enumerate(made.bodies.names)}
    moved = {
        name for name, i in number.items() if made.bodies.motion[i] == DYNAMIC and _has_moved(made.poses, poses, i)
    }
    carried = {d.name for d in definition.bodies if isinstance(d, CoatingDef) and d.around in moved}
    bodies = [_moved_body(d, made, poses, number[d.name]) if d.name in moved else d for d in definition.bodies]
    frames = [{name: _frame(made, p, i) for name, i in number.items()} for p in (made.poses, poses)]
    constraints = [
        _moved_joint(d, *frames) if isinstance(d, BodyPairDef) else frozen(d, model, state, moved | carried)
        for d in definition.constraints
    ]
    forces = [frozen_force(d, model, moved | carried) for d in definition.forces]
    changed = definition.model_copy(update={"bodies": bodies, "constraints": constraints, "forces": forces})
    return Scene.from_definition(SceneDef.model_validate(changed), scene.folder)


def _has_moved(old: Poses, new: Poses, i: int) -> bool:
    shift = np.abs(new.x[i] - old.x[i]).max()
    turn = (Rotation.from_quat(new.q[i]) * Rotation.from_quat(old.q[i]).inv()).magnitude()
    return bool(max(shift, turn) > STAYED)


def _frame(made: Clumps, poses: Poses, i: int) -> Frame:
    """Origin and axes of the user's frame of a rigid body."""
    turn = Rotation.from_quat(poses.q[i])
    origin = poses.x[i] + turn.apply(made.bodies.frame_x[i])
    return origin, turn * Rotation.from_quat(made.bodies.frame_q[i])


def _moved_body(d: Any, made: Clumps, poses: Poses, i: int) -> Any:
    """The definition at its new place."""
    if isinstance(d, RigidDef):
        origin, turn = _frame(made, poses, i)
    else:  # all that a soft body is moves as a whole
        change = Rotation.from_quat(poses.q[i]) * Rotation.from_quat(made.poses.q[i]).inv()
        origin = poses.x[i] + change.apply(np.array(d.position) - made.poses.x[i])
        turn = change * Rotation.from_rotvec(np.array(d.rotation))
    return d.model_copy(update={"position": _fixed(origin), "rotation": _fixed(turn.as_rotvec())})


def _fixed(values: np.ndarray) -> np.ndarray:
    """A copy that nobody can write into, as all arrays of definitions."""
    values = np.array(values, dtype=np.float64)
    values.flags.writeable = False
    return values


def _rebuilt(d: Definition, kind: type, without: tuple[str, ...], **fields: Any) -> Any:
    """A definition of ``kind`` with the given fields of ``d`` but ``without``, and other ones."""
    kept = {
        name: getattr(d, name)
        for name in kind.model_fields
        if name in d.model_fields_set and name not in without and name != "type"
    }
    return kind(**{**kept, **fields})


def _moved_joint(d: BodyPairDef, old: dict[str, Frame], new: dict[str, Frame]) -> BodyPairDef:
    """The joint so that it means in the new poses what it meant in the old ones."""
    zero = {"world": (np.zeros(3), Rotation.identity())}
    x0, r0 = {**old, **zero}[d.body0 or "world"]
    x1, r1 = old[d.body1]
    if d.anchor is not None:
        local0, local1 = r0.inv().apply(d.anchor - x0), r1.inv().apply(d.anchor - x1)
        if isinstance(d, RollingDef):
            local0 = local0 - d.radius * np.array(d.normal) / np.linalg.norm(d.normal)
        if isinstance(d, JointDef) and d.given(("curve", "surface", "domain")):
            local0 = np.zeros(3)
        d = _rebuilt(d, type(d), ("anchor",), local_pos0=local0, local_pos1=local1)
    n0, n1 = {**new, **zero}[d.body0 or "world"][1], new[d.body1][1]
    before, after = r1.inv() * r0, n1.inv() * n0  # from body0's axes to body1's
    general = d.as_general(before) if isinstance(d, NamedJointDef) and not isinstance(d, RollingDef) else d
    turned = (before * after.inv()).magnitude() > ALIKE
    if isinstance(general, JointDef) and general.fixed_rotation and turned:
        return _with_orientation(general, before)
    if isinstance(d, NamedJointDef) and isinstance(general, JointDef) and not _alike(general, d.as_general(after)):
        return general
    return d


def _alike(a: JointDef, b: JointDef) -> bool:
    """Whether two joints hold the same, to rounding."""
    for name in ("angle", "twist"):
        one, other = getattr(a, name), getattr(b, name)
        if one is None or other is None:
            if one is not other:
                return False
            continue
        for field in type(one).model_fields:
            u, v = getattr(one, field), getattr(other, field)
            if isinstance(u, np.ndarray) and np.abs(u - v).max() > ALIKE:
                return False
    return True


def _with_orientation(d: JointDef, before: Rotation) -> JointDef:
    """Suppressed rotation said by an angle and a twist (4.2.3), which do not depend on the start."""
    z = np.array([0.0, 0.0, 1.0])
    x = perpendicular(z)
    angle = AngleDef(axis0=z, axis1=before.apply(z), min=0.0, max=0.0)
    twist = TwistDef(vector0=x, vector1=before.apply(x), min=0.0, max=0.0)
    return _rebuilt(d, JointDef, ("fixed_rotation",), angle=angle, twist=twist)
