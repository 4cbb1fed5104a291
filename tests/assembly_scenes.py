"""Scenes whose parts are thrown apart, and how far their joints are open, found from the definitions alone."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle import Scene


def thrown(scene: Scene, distance: float, angle: float, seed: int = 0) -> Scene:
    """The scene with each dynamic rigid body `distance` [m] away and turned by `angle` [rad], each its own way."""
    rng = np.random.default_rng(seed)
    bodies: list[Any] = []
    for d in scene.definition.bodies:
        if getattr(d, "motion", None) == "dynamic":
            way, axis = rng.standard_normal((2, 3))
            turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * Rotation.from_rotvec(
                np.array(d.rotation)
            )
            place = d.position + distance * way / np.linalg.norm(way)
            d = d.model_copy(update={"position": place, "rotation": turn.as_rotvec()})
        bodies.append(d)
    return Scene.from_definition(scene.definition.model_copy(update={"bodies": bodies}), scene.folder)


def frames(scene: Scene) -> dict[str | None, tuple[np.ndarray, Rotation]]:
    """Origin and axes of each rigid body's own frame; None is the world."""
    found: dict[str | None, tuple[np.ndarray, Rotation]] = {None: (np.zeros(3), Rotation.identity())}
    for d in scene.definition.bodies:
        if d.type == "rigid":
            found[d.name] = (np.array(d.position), Rotation.from_rotvec(np.array(d.rotation)))
    return found


def place(scene: Scene, body: str | None, local: Any) -> np.ndarray:
    """A point of a body in the world."""
    origin, turn = frames(scene)[body]
    return origin + turn.apply(np.array(local))


def largest_gap(scene: Scene) -> float:
    """Of places held together and axes held on one line, in joints that say both [m or rad]."""
    at, worst = frames(scene), 0.0
    for d in scene.definition.constraints:
        if d.type not in ("joint", "ball", "revolute", "weld") or not d.enabled:
            continue
        (x0, r0), (x1, r1) = at[d.body0], at[d.body1]
        if d.local_pos0 is not None and not getattr(d, "axial", None) and not getattr(d, "planar", None):
            gap = x0 + r0.apply(np.array(d.local_pos0)) - x1 - r1.apply(np.array(d.local_pos1))
            worst = max(worst, float(np.linalg.norm(gap)))
        angle = getattr(d, "angle", None)
        if angle is not None and angle.max == 0.0:
            axes = r0.apply(np.array(angle.axis0)), r1.apply(np.array(angle.axis1))
            a0, a1 = (v / np.linalg.norm(v) for v in axes)
            worst = max(worst, float(np.linalg.norm(np.cross(a0, a1))) + float(a0 @ a1 < 0.0))
    return worst


def hinge(scene: Scene, name: str, body0: str | None, body1: str, p0: Any, p1: Any, axis0: Any, axis1: Any) -> None:
    """A hinge that says both of its axes."""
    first = {} if body0 is None else {"body0": body0}
    angle = {"axis0": axis0, "axis1": axis1, "min": 0.0, "max": 0.0}
    scene.add_joint("joint", name, **first, body1=body1, local_pos0=p0, local_pos1=p1, angle=angle)


def tree(branches: int = 3, depth: int = 3) -> Scene:
    """Rods on rods, by ball joints and hinges."""
    scene = Scene("tree")
    scene.add_rigid("stem", box=[0.1, 0.1, 1.0], position=[0.0, 0.0, 0.5])
    scene.add_joint("ball", "root", body1="stem", local_pos0=[0, 0, 0], local_pos1=[0, 0, -0.5])
    last = ["stem"]
    for level in range(1, depth):
        new = []
        for parent in last:
            for k in range(branches):
                name = f"{parent}_{k}"
                scene.add_rigid(name, box=[0.1, 0.1, 1.0], position=[0.3 * k, 0.2 * level, level + 0.5])
                if k == 0:
                    hinge(scene, f"hinge_{name}", parent, name, [0, 0, 0.5], [0, 0, -0.5], [1, 0, 0], [1, 0, 0])
                else:
                    both = {"local_pos0": [0, 0, 0.5], "local_pos1": [0, 0, -0.5]}
                    scene.add_joint("ball", f"ball_{name}", body0=parent, body1=name, **both)
                new.append(name)
        last = new
    return scene
