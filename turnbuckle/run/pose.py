"""`pose`: bodies put into a pose by dragging points of them, for modelling; joints stay closed, without speeds."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.run.assemble import coated
from turnbuckle.run.assembled_scene import moved_scene
from turnbuckle.run.assembly_bodies import Clumps, acting, clumps
from turnbuckle.run.closing import Closer, worst
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.suggestion import did_you_mean
from turnbuckle.solvers.assembly.dragging import drag as drag_points
from turnbuckle.solvers.assembly.rows import Linearised
from turnbuckle.solvers.displacement.conditions import Conditions
from turnbuckle.solvers.displacement.displace import Displacement
from turnbuckle.solvers.displacement.options import DisplacementOptions
from turnbuckle.solvers.displacement.ties import PointTies, TieRows

CLOSED = 1e-8  # [m and rad], joints of a pose
TIGHT = 1e-10  # what they are aimed at
GAIN = 1e-6  # of the distance to targets: what makes another pose the better one
COARSE = 30  # iterations in displacements, drags and joints together


def pose(scene: Scene, drag: Mapping[Any, Any], *, max_rotation: float = 0.3, device: str = "cpu") -> Scene:
    """The scene with its bodies moved so that dragged points come to their targets and all joints hold.

    ``drag``: ``{("body", (x, y, z)): target, "body": target}``, a point in the body's own frame [m] (its origin for a
    name alone) and a place in the world (3,) [m]. How much each body gives way is up to the user: `mu` of joints and
    `ability_to_rotate` of bodies (Displacement, 3.1.4), mass and inertia where those are left out. Joints are closed to
    1e-8 m and rad, with a warning where they cannot be; targets out of reach are come as near as the way there allows.
    Velocities stay as they are written. Raises `InputError` for a body that is not there or cannot be moved.
    """
    model, state = scene.build(device)
    made = clumps(model, state, coated(scene))
    drags = _drags(scene, made, drag)
    closer = Closer(made, max_rotation=max_rotation, user_parameter=True)
    near = _together(made, drags, max_rotation)
    found = closer.search(TIGHT, start=near)
    if worst(found.result) > CLOSED:
        found = closer.search(TIGHT)
    rows = TieRows(drags, closer.mobility.inverse_mass, made.bodies.count)
    empty = Conditions(made.parts, np.zeros(len(made.joints), dtype=bool))
    pulled = Linearised(empty, closer.mobility, rows, made.bodies.count)
    poses, left_over = drag_points(closer.system, pulled, found.poses, tolerance=TIGHT, max_rotation=max_rotation)
    if left_over > CLOSED:  # out of reach, or stuck where all pulls lie along stretched limbs: turn a little and look
        shaken = closer.search(TIGHT, start=closer.shaken(poses, np.random.default_rng(0))).poses
        again, better = drag_points(closer.system, pulled, shaken, tolerance=TIGHT, max_rotation=max_rotation)
        poses = again if better < (1.0 - GAIN) * left_over else poses
    left = closer.measure(poses)
    if worst(left) > CLOSED:
        named = ", ".join(f"'{name}' by {max(gap, angle):.3g}" for name, gap, angle in left.worst(3))
        warnings.warn(f"pose: joints cannot close, {named}; run assemble for a full report", stacklevel=2)
    return moved_scene(scene, model, state, made, poses)


def _together(made: Clumps, drags: PointTies, max_rotation: float) -> Any:
    """Poses after some iterations with drags and joints alike."""
    ties = made.ties
    both = PointTies(
        np.concatenate([ties.start, ties.start[-1] + drags.start[1:]]),
        *(
            np.concatenate([getattr(ties, f), getattr(drags, f)])
            for f in ("weight", "body", "point", "local", "target")
        ),
        names=ties.names + drags.names,
    )
    options = DisplacementOptions(max_iterations=COARSE, max_rotation=max_rotation, mobility="user_parameter")
    solver = Displacement(
        made.bodies, made.parts, made.joints, options, acting=acting(made.joints), domains=made.domains, ties=both
    )
    return solver.solve(made.poses.x, made.poses.q).poses


def _drags(scene: Scene, made: Clumps, drag: Mapping[Any, Any]) -> PointTies:
    """One tie a dragged point."""
    number = {name: i for i, name in enumerate(made.bodies.names) if i > 0}
    bodies = {d.name: d for d in scene.definition.bodies}
    rows = []
    for key, target in drag.items():
        name, place = (key, (0.0, 0.0, 0.0)) if isinstance(key, str) else key
        if name not in number:
            raise InputError(f"pose: there is no body {name!r} to drag{did_you_mean(str(name), list(number))}")
        i = number[name]
        if made.bodies.motion[i] != DYNAMIC:
            raise InputError(f"pose: '{name}' is not dynamic and cannot be dragged")
        place, target = _three(place, name, "place"), _three(target, name, "target")
        if i < made.bodies.count - len(made.soft):
            local = made.bodies.frame_x[i] + Rotation.from_quat(made.bodies.frame_q[i]).apply(place)
        else:
            d: Any = bodies[name]
            world = d.position + Rotation.from_rotvec(np.array(d.rotation)).apply(place)
            local = Rotation.from_quat(made.poses.q[i]).inv().apply(world - made.poses.x[i])
        rows.append((i, local, target, f"drag of '{name}'"))
    n = len(rows)
    return PointTies(
        np.arange(n + 1), np.ones(n), np.array([r[0] for r in rows], dtype=np.int64), np.zeros(n, dtype=np.int64),
        np.array([r[1] for r in rows]).reshape(n, 3), np.array([r[2] for r in rows]).reshape(n, 3),
        names=[r[3] for r in rows],
    )  # fmt: skip


def _three(value: Any, name: str, what: str) -> np.ndarray:
    """Three finite numbers."""
    found = np.asarray(value, dtype=float)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InputError(f"pose: the {what} of '{name}' must be three finite numbers, got {value!r}")
    return found
