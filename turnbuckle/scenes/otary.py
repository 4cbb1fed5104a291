"""An otary balances a tray and a ball on its nose: Displacement, Figure 6."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

# The animal in the plane z = 0, y up, looking along x [m]: where the middle lines of its parts begin and end.
TAIL_TIP, RUMP = np.array([-1.35, 0.16, 0.0]), np.array([-0.70, 0.30, 0.0])
NECK, NOSE = np.array([0.42, 0.90, 0.0]), np.array([1.00, 1.30, 0.0])
BELLY = np.array([-0.12, 0.10, 0.0])
FUR = [0.36, 0.33, 0.31]
RADII = {"tail": 0.13, "body": 0.30, "head": 0.17}


def otary(
    tray: float = 0.38,
    ball: float = 0.13,
    level: float = 0.06,
    strength: float = 1.0,
    dt: float = 1.0 / 240.0,
    duration: float = 6.0,
) -> Scene:
    """An otary keeps a ball on a tray on its nose while forces and torques move head and tail (Figure 6).

    As in the paper: head, body and tail on points to point with angle and twist; a tray of radius `tray` [m] hinged on
    the nose, kept within `level` [rad] of horizontal by an angle to the world; a ball of radius `ball` [m] that must
    stay on it by a point to ring, here a disc. Head and tail are driven by forces and torques, times `strength`. In place
    of the floor that the paper does not mention, the belly rests on a ball joint with an angle and a twist; soft angles
    stand for the muscles that hold up head and tail. y is up.
    """
    if not 0.0 < ball < tray:
        raise InputError(f"otary: ball = {ball:g} m must be less than tray = {tray:g} m")
    scene = Scene("otary", up_axis="Y", dt=dt, duration=duration)
    _add_part(scene, "body", RUMP, NECK, 40.0)
    _add_part(scene, "head", NECK, NOSE, 9.0)
    _add_part(scene, "tail", RUMP, TAIL_TIP, 5.0)
    up, along = [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    held = {"cone": 0.20, "lower_limit": -0.35, "upper_limit": 0.35}
    scene.add_joint("cone_twist", "belly", body1="body", anchor=BELLY, axis=up, **held)
    turning = {"lower_limit": -0.5, "upper_limit": 0.5}
    scene.add_joint("cone_twist", "neck", body0="body", body1="head", anchor=NECK, axis=along, cone=0.5, **turning)
    scene.add_joint("cone_twist", "rump", body0="body", body1="tail", anchor=RUMP, axis=along, cone=0.6, **turning)
    _add_muscles(scene)

    top = np.array([0.0, 0.015, 0.0])
    plate = {"cylinder": {"radius": tray, "length": 0.03}, "rotation": [0.5 * math.pi, 0.0, 0.0]}
    tip = NOSE + [0.06, RADII["head"] + 0.02, 0.0]
    scene.add_rigid("tray", parts=[plate], mass=0.8, position=tip + top, color=[0.78, 0.62, 0.25])
    scene.add_joint("ball", "nose", body0="head", body1="tray", anchor=tip)
    scene.add_joint("joint", "tray_level", body1="tray", angle={"axis0": up, "axis1": up, "max": level})
    scene.add_rigid(
        "ball", sphere=ball, mass=0.3, position=tip + 2.0 * top + [0.0, ball, 0.0], color=[0.80, 0.20, 0.20]
    )
    disc = {"normal": up, "max": tray - 0.5 * ball}
    places = {"local_pos0": top + [0.0, ball, 0.0], "local_pos1": [0.0, 0.0, 0.0]}
    scene.add_joint("joint", "on_tray", body0="tray", body1="ball", planar=disc, restitution=0.6, **places)

    def wave(size: float, rate: float) -> str:
        return f"{size * strength!r} * sin({rate!r} * t)"

    nod = [wave(6.0, 2.1), wave(16.0, 1.7), wave(24.0, 3.1)]
    scene.add_force("nod", body="head", expression=[wave(30.0, 2.6), 0.0, wave(20.0, 1.9)], torque=nod)
    wag = [wave(3.0, 2.3), wave(8.0, 3.7), wave(6.0, 4.3)]
    scene.add_force("wag", body="tail", expression=[0.0, wave(40.0, 4.1), wave(50.0, 5.3)], torque=wag)
    return scene


def _add_part(scene: Scene, name: str, start: np.ndarray, end: np.ndarray, mass: float) -> None:
    """A capsule from start to end [m]; both lie in the plane z = 0."""
    along = end - start
    far = float(np.linalg.norm(along))
    # z onto the direction, by a turn in the plane y = 0 and one in the plane z = 0.
    turn = Rotation.from_euler("yz", [0.5 * math.pi, math.atan2(along[1], along[0])])
    scene.add_rigid(
        name,
        capsule={"radius": RADII[name], "length": far - 0.5 * RADII[name]},
        mass=mass,
        position=0.5 * (start + end),
        rotation=turn.as_rotvec(),
        color=FUR,
        linear_damping=0.2,
        angular_damping=1.0,
    )


def _add_muscles(scene: Scene) -> None:
    """Preferred directions of body, head and tail: those of the start, held by springs and dampers."""
    frames = {body.name: Rotation.from_rotvec(np.array(body.rotation)) for body in scene.definition.bodies}
    ahead = np.array([0.0, 0.0, 1.0])  # along every part, in its own frame
    for name, first, second, stiffness in (
        ("back", None, "body", 900.0),
        ("nape", "body", "head", 350.0),
        ("loin", "body", "tail", 120.0),
    ):
        axis0 = frames[second].apply(ahead)
        if first is not None:
            axis0 = frames[first].inv().apply(axis0)
        spring = {"axis0": axis0, "axis1": ahead, "max": 0.0, "stiffness": stiffness, "damping": 0.08 * stiffness}
        scene.add_joint("joint", name, body0=first, body1=second, angle=spring)
