"""A figure rides a monocycle: Displacement, Figures 7 and 8, Appendix A."""

import math
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.solids import cylinder_surface
from turnbuckle.scene.scene import Scene

CONSTRAINTS = Path(__file__).with_name("monocycle_constraints.gascuel")  # Appendix A

# From Appendix A, in the frames of the bodies; y is up, z forward, x to the left [m].
HIP = np.array([0.4, -0.6, 0.0])  # of the left thigh in the body; mirrored in x for the right
THIGH, LEG = 1.0, 1.4  # along z of thigh and leg
ANKLE = np.array([0.0, 0.0, -0.1])  # in the foot
PEDAL = np.array([0.4, 0.0, -0.5])  # of the left foot in the wheel; the right one is opposite
SEAT = 2.0  # height of the body's origin above the middle of the wheel

SKIN, TROUSERS, SHIRT = [0.87, 0.68, 0.55], [0.20, 0.32, 0.55], [0.75, 0.24, 0.20]
STEEL, SHOE = [0.35, 0.37, 0.40], [0.25, 0.18, 0.14]
SIDES = {"left": 1.0, "right": -1.0}
RIM = 128  # corners of the wheel that rolls by contact: its radius varies by 0.03 %
BUMP = 1e-3  # [m] of the ground below the wheel at the start, a little more than contact keeps
ROAD = 100.0  # [m] length of the ground


def monocycle(
    force: float = 55.0,
    radius: float = 0.8,
    crank: float = 0.5,
    steadiness: float = 20.0,
    contact: bool = False,
    mu: float = 0.8,
    dt: float = 1.0 / 480.0,
    duration: float = 8.0,
) -> Scene:
    """A figure on a monocycle is pushed by a horizontal force; the wheel rolls and turns its legs (Figures 7 and 8).

    All constraints of the paper's Appendix A, to the letter: the wheel on the body, the feet on the pedals, thighs, legs
    and feet in loops through wheel and body, and an angle to the world that keeps the body within 0.066 rad of upright.
    In place of the paper's contact with the floor, the wheel, of `radius` [m], rolls on it without slip. `force` [N] acts
    along z on the body's origin. `crank` [rad] is the angle of the wheel at the start. Rolling on a point does not resist
    steering, as the paper's soft wheel does on its floor; the turning of the body is damped by `steadiness` [1/s] instead.
    Shapes and masses are ours: a rider of 48 kg, 3.6 m tall, for Appendix A fixes its legs at 2.4 m.
    With `contact` the wheel rolls on real ground instead, by contact and friction `mu` 0.8, under backward Euler: nothing
    joins it to the ground, and no body passes through another (cranks and legs are slimmer for that; those that a joint
    joins overlap at the joint).
    """
    if not radius > -PEDAL[2] + 0.1:
        raise InputError(f"monocycle: radius = {radius:g} m; the pedals need more than {-PEDAL[2] + 0.1:g}")
    touching = {"contact": {"friction": mu}} if contact else {}
    scene = Scene("monocycle", up_axis="Y", dt=dt, duration=duration, **touching)
    axle = np.array([0.0, radius, 0.0])
    seat = axle + [0.0, SEAT, 0.0]
    steady = {"angular_damping": steadiness}
    scene.add_rigid("body", parts=_torso(), mass=26.0, position=seat, color=SHIRT, **steady)
    turned = [crank, 0.0, 0.0]
    scene.add_rigid(
        "wheel",
        parts=_slim_wheel(radius) if contact else _wheel(radius),
        contact_delta=BUMP if contact else None,
        mass=4.0,
        position=axle,
        rotation=turned,
        color=STEEL,
    )
    for side, sign in SIDES.items():
        pedal = axle + _turn(crank, PEDAL * [sign, 1.0, sign])
        _add_leg(scene, side, seat + HIP * [sign, 1.0, 1.0], pedal, SLIM_SHIN if contact else SHIN)
    scene.include(CONSTRAINTS)
    scene.add_force("push", body="body", at=[0.0, 0.0, 0.0], expression=[0.0, 0.0, force])
    if contact:
        ground = {"box": [8.0, 0.2, ROAD], "position": [0.0, -0.1 - BUMP, 0.5 * ROAD - 5.0]}
        scene.add_obstacle("ground", color=[0.55, 0.58, 0.52], contact_delta=BUMP, **ground)
        return scene
    floor = {"local_pos0": [0.0, 0.0, 0.0], "local_pos1": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}
    scene.add_joint("rolling", "floor", body1="wheel", axis=[1.0, 0.0, 0.0], radius=radius, **floor)
    return scene


def _turn(angle: float, v: np.ndarray) -> np.ndarray:
    """v turned about x."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]])


def _torso() -> list[dict]:
    """Trunk, arms, head and the fork that holds the wheel; its origin is the appendix's `body`."""
    parts: list[dict] = [
        {"box": [0.62, 1.1, 0.32], "position": [0.0, 0.05, 0.0]},
        {
            "cylinder": {"radius": 0.1, "length": 0.2},
            "position": [0.0, 0.66, 0.0],
            "rotation": [0.5 * math.pi, 0.0, 0.0],
        },
        {"sphere": 0.26, "position": [0.0, 0.92, 0.02]},
        {"box": [0.3, 0.1, 0.45], "position": [0.0, -0.62, 0.0]},
    ]
    for x in (-0.16, 0.16):
        parts.append(
            {
                "capsule": {"radius": 0.035, "length": 1.35},
                "position": [x, -1.32, 0.0],
                "rotation": [0.5 * math.pi, 0.0, 0.0],
            }
        )
    for x in (-0.62, 0.62):
        tilt = math.copysign(0.9, x)
        parts.append(
            {"capsule": {"radius": 0.07, "length": 0.8}, "position": [x, 0.3, 0.0], "rotation": [0.0, tilt, 0.0]}
        )
    return parts


def _wheel(radius: float) -> list[dict]:
    """Disc, axle, cranks and pedals; its axis is x."""
    across = [0.0, 0.5 * math.pi, 0.0]
    parts: list[dict] = [
        {"cylinder": {"radius": radius, "length": 0.12}, "rotation": across},
        {"cylinder": {"radius": 0.04, "length": 0.72}, "rotation": across},
    ]
    for sign in SIDES.values():
        x, z = sign * PEDAL[0], sign * PEDAL[2]
        parts.append({"box": [0.05, 0.07, abs(z)], "position": [0.8 * x, 0.0, 0.5 * z], "density": 100.0})
        parts.append({"box": [0.22, 0.05, 0.12], "position": [x, 0.0, z], "density": 100.0})
    return parts


def _slim_wheel(radius: float) -> list[dict]:
    """The same with a rounder disc, and with cranks and pedals that no leg passes through."""
    across = [0.0, 0.5 * math.pi, 0.0]
    points, triangles = cylinder_surface(radius, 0.12, RIM)
    parts: list[dict] = [
        {"vertices": points, "triangles": triangles, "rotation": across},
        {"cylinder": {"radius": 0.03, "length": 0.5}, "rotation": across},
    ]
    for sign in SIDES.values():
        x, z = sign * PEDAL[0], sign * PEDAL[2]
        parts.append({"box": [0.04, 0.07, abs(z)], "position": [0.6 * x, 0.0, 0.5 * z], "density": 100.0})
        pedal = {"cylinder": {"radius": 0.02, "length": 0.24}, "rotation": across, "density": 100.0}
        parts.append({**pedal, "position": [0.95 * x, 0.0, z]})
    return parts


def _limb(begin: float, end: float, radius: float) -> dict:
    """A capsule along z from begin to end [m], its caps beyond."""
    return {"capsule": {"radius": radius, "length": end - begin}, "position": [0.0, 0.0, 0.5 * (begin + end)]}


SHIN = [_limb(0.5 * 0.09, LEG - 0.5 * 0.09, 0.09)]
SLIM_SHIN = [_limb(0.5 * 0.09, LEG - 0.45, 0.09), _limb(LEG - 0.6, LEG - 0.2, 0.05)]  # ends above the pedal


def _add_leg(scene: Scene, side: str, hip: np.ndarray, pedal: np.ndarray, shin_parts: list[dict]) -> None:
    """Thigh, leg and level foot between hip and pedal [m], the knee in front: two circles in the plane x = const."""
    ankle = pedal + ANKLE
    down = ankle - hip
    far = float(np.linalg.norm(down))
    at_hip = math.acos((THIGH**2 + far**2 - LEG**2) / (2.0 * THIGH * far))
    # z turned about x by b points along (0, -sin b, cos b); the knee lies that much before the line to the ankle.
    thigh = math.atan2(-down[1], down[2]) - at_hip
    knee = hip + THIGH * np.array([0.0, -math.sin(thigh), math.cos(thigh)])
    shin = math.atan2(-(ankle - knee)[1], (ankle - knee)[2])
    for name, start, angle, parts, mass in (
        ("thigh", hip, thigh, [_limb(0.5 * 0.12, THIGH - 0.5 * 0.12, 0.12)], 4.5),
        ("leg", knee, shin, shin_parts, 3.5),
    ):
        placed = {"position": start, "rotation": [angle, 0.0, 0.0], "color": TROUSERS}
        scene.add_rigid(f"{side}-{name}", parts=parts, mass=mass, **placed)
    shoe = {"box": [0.16, 0.1, 0.5], "position": [0.0, 0.06, 0.03]}
    scene.add_rigid(f"{side}-foot", parts=[shoe], mass=1.0, position=pedal, color=SHOE, angular_damping=4.0)
