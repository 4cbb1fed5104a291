"""A robot whose hands slide down two ropes: Local, Figure 3."""

from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.read import SurfaceMesh, TetMesh, read_mesh
from turnbuckle.meshes.repair import check_surface
from turnbuckle.meshes.tetrahedralise import tetrahedralise
from turnbuckle.scene.scene import Scene

RIM = 6  # corners of the cross-section of ropes and limbs
ROPE_CELLS = 21  # along a rope
LIMB_CELLS = 2  # along a limb
LIMB_RADIUS = 0.045  # [m]
FIRM = {"k_distance": 40.0, "k_area": 40.0, "k_volume": 40.0}  # [J]
FIRM_DAMPING = {"damping_distance": 0.002, "damping_area": 0.002, "damping_volume": 0.002}  # [J s]


def robot_on_ropes(
    mesh: str | None = None,
    length: float = 8.0,
    drop: float = 2.2,
    rope_radius: float = 0.06,
    rope_density: float = 200.0,
    rope_stiffness: float = 800.0,
    robot_density: float = 200.0,
    height: float = 1.2,
    air: float = 1.0,
    dt: float = 1e-4,
    duration: float = 2.0,
) -> Scene:
    """A robot slides down two ropes, its hands held on their triangulated surfaces (Local, Figure 3).

    Two solid ropes of `length` [m], `rope_radius` [m] and `rope_stiffness` [J] are nailed at both ends, the far end
    lower by `drop` [m]. The robot is of ten solids: torso, head (at four points), upper arms and forearms (one point at
    shoulder and elbow), thighs (one point at the hip), shins (a hinge of two points at the knee). The tip of each forearm
    slides without friction on the surface of a rope, which feels its weight; the legs swing.
    With `mesh`, a closed surface or tetrahedra, one solid of that shape, `height` [m] tall, hangs by the two points that
    reach highest to the left and to the right.

    Counts, the same as the paper's: 1339 tetrahedra, 14 points to point, 2 point to surface.
    """
    if not drop < length:
        raise InputError(f"robot_on_ropes: drop = {drop:g} m must be less than length = {length:g} m")
    scene = Scene("robot_on_ropes", dt=dt, duration=duration)
    tilt = np.arcsin(drop / length)
    along = np.array([0.0, np.cos(tilt), -np.sin(tilt)])
    if mesh is None:
        hands = _add_robot(scene, robot_density)
    else:
        hands = _add_mesh(scene, Path(mesh), height, robot_density)
    if air > 0.0:
        scene.add_force("air", expression=[f"-{air!r} * m * {v}" for v in ("vx", "vy", "vz")])
    # The hand touches the middle of the lower side of a rope, one eighth of the way down.
    below = np.array([0.0, np.sin(tilt), np.cos(tilt)]) * rope_radius * np.cos(np.pi / RIM)
    start = length / 8.0
    for side, (body, index, place) in hands.items():
        name = f"{side}_rope"
        scene.add_solid(
            name,
            cylinder={"radius": rope_radius, "length": length, "around": RIM, "along": ROPE_CELLS},
            position=place + below - start * along,
            rotation=[-(np.pi / 2.0 + tilt), 0.0, 0.0],
            density=rope_density,
            color=[0.75, 0.62, 0.42],
            k_distance=rope_stiffness,
            k_area=rope_stiffness,
            k_volume=rope_stiffness,
            damping_distance=2e-5 * rope_stiffness,
            damping_area=2e-5 * rope_stiffness,
            damping_volume=2e-5 * rope_stiffness,
        )
        ends = np.concatenate([np.arange(RIM + 1), ROPE_CELLS * (RIM + 1) + np.arange(RIM + 1)])
        scene.add_constraint("nail", f"{side}_rope_ends", points={"body": name, "indices": ends})
        on = {"body": name, "surface": True}
        scene.add_constraint("slide", f"{side}_hand", points={"body": body, "index": index}, on=on)
    return scene


Hands = dict[str, tuple[str, int, np.ndarray]]  # side -> body, point, place [m]


def _add_robot(scene: Scene, density: float) -> Hands:
    """Ten solids and fourteen joints. Z up, it looks along +y; the middle of its feet is at x = y = 0."""
    solid = {"density": density, **FIRM, **FIRM_DAMPING}
    scene.add_solid(
        "torso",
        box={"size": [0.4, 0.2, 0.5], "cells": [4, 2, 4]},
        position=[-0.2, -0.1, 0.7],
        color=[0.80, 0.25, 0.20],
        **solid,
    )
    scene.add_solid(
        "head",
        box={"size": [0.2, 0.2, 0.2], "cells": [3, 3, 3]},
        position=[-0.1, -0.1, 1.2],
        color=[0.93, 0.78, 0.30],
        **solid,
    )
    corners = [[x, y, 1.2] for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    _join(scene, "neck", ("head", corners), ("torso", corners))
    hands: Hands = {}
    for side, sign in (("left", -1.0), ("right", 1.0)):
        shoulder = np.array([sign * 0.2, 0.0, 1.2])
        elbow = shoulder + [sign * 0.16, 0.0, 0.28]
        hand = elbow + [-sign * 0.02, 0.0, 0.34]
        hip, knee, foot = (np.array([sign * 0.1, 0.0, z]) for z in (0.7, 0.37, 0.04))
        _add_limb(scene, f"{side}_upper_arm", shoulder, elbow, solid)
        _add_limb(scene, f"{side}_forearm", elbow, hand, solid)
        _add_limb(scene, f"{side}_thigh", knee, hip, solid)
        _add_limb(scene, f"{side}_shin", foot, knee, solid)
        _join(scene, f"{side}_shoulder", (f"{side}_upper_arm", [shoulder]), ("torso", [shoulder]))
        _join(scene, f"{side}_elbow", (f"{side}_forearm", [elbow]), (f"{side}_upper_arm", [elbow]))
        _join(scene, f"{side}_hip", (f"{side}_thigh", [hip]), ("torso", [hip]))
        hinge = knee + np.array([[-LIMB_RADIUS, 0.0, 0.0], [LIMB_RADIUS, 0.0, 0.0]])
        _join(scene, f"{side}_knee", (f"{side}_shin", hinge), (f"{side}_thigh", hinge))
        hands[side] = (f"{side}_forearm", LIMB_CELLS * (RIM + 1), hand)
    return hands


def _add_limb(scene: Scene, name: str, start: np.ndarray, end: np.ndarray, solid: dict) -> None:
    """A cylinder from `start` to `end` [m]; both lie in a plane y = const, so it turns about y."""
    along = end - start
    scene.add_solid(
        name,
        cylinder={
            "radius": LIMB_RADIUS,
            "length": float(np.linalg.norm(along)),
            "around": RIM,
            "along": LIMB_CELLS,
        },
        position=start,
        rotation=[0.0, float(np.arctan2(along[0], along[2])), 0.0],
        color=[0.35, 0.42, 0.52],
        **solid,
    )


def _join(scene: Scene, name: str, *sides: tuple[str, object]) -> None:
    """Join the points of bodies that are nearest to the same places [m]."""
    selections = [{"body": body, "nearest": np.asarray(places)} for body, places in sides]
    scene.add_constraint("points_to_point", name, zip=selections)


def _add_mesh(scene: Scene, path: Path, height: float, density: float) -> Hands:
    """One solid of any shape, `height` [m] tall, and the two points it hangs by."""
    mesh = read_mesh(path.expanduser())
    if isinstance(mesh, SurfaceMesh):
        vertices, triangles, _ = check_surface(mesh.vertices, mesh.triangles)
        points, cells = tetrahedralise(vertices, triangles)
    elif isinstance(mesh, TetMesh):
        points, cells = mesh.vertices, mesh.tetrahedra
    else:
        raise InputError(f"robot_on_ropes: mesh '{path}' has lines only; give a closed surface or tetrahedra")
    extent = np.ptp(points, axis=0)
    if not extent.min() > 0.0:
        raise InputError(f"robot_on_ropes: mesh '{path}' is flat; give a closed surface or tetrahedra")
    points = (points - 0.5 * (points.min(axis=0) + points.max(axis=0))) * (height / extent[2])
    # An even share for all elements: the robot above has 295 + 288 tetrahedra of 3 x 150 J.
    share = 1e5 / len(cells)
    stiffness = {name: share for name in FIRM}
    damping = {name: share / 3000.0 for name in FIRM_DAMPING}
    scene.add_solid(
        "robot", vertices=points, tetrahedra=cells, density=density, color=[0.80, 0.25, 0.20], **stiffness, **damping
    )
    hands: Hands = {}
    for side, sign in (("left", -1.0), ("right", 1.0)):
        index = int(np.argmax(points[:, 2] + sign * points[:, 0]))
        hands[side] = ("robot", index, points[index])
    return hands
