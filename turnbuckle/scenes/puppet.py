"""A puppet with soft limbs on rigid bones, hung on strings."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

# Bones: where each begins and ends [m], its radius [m], its mass [kg], what it hangs on. x to the puppet's left, z up.
BONES: dict[str, tuple[tuple, tuple, float, float, str | None]] = {
    "torso": ((0.0, 0.0, 0.62), (0.0, 0.0, 0.92), 0.085, 0.60, None),
    "head": ((0.0, 0.0, 1.00), (0.0, 0.0, 1.16), 0.085, 0.25, "torso"),
}
for _side, _sign in (("left", 1.0), ("right", -1.0)):
    BONES |= {
        f"{_side}_upper_arm": ((_sign * 0.15, 0.0, 0.95), (_sign * 0.29, 0.0, 0.75), 0.018, 0.08, "torso"),
        f"{_side}_forearm": ((_sign * 0.29, 0.0, 0.75), (_sign * 0.33, 0.12, 0.55), 0.016, 0.07, f"{_side}_upper_arm"),
        f"{_side}_thigh": ((_sign * 0.07, 0.0, 0.55), (_sign * 0.09, 0.05, 0.28), 0.022, 0.12, "torso"),
        f"{_side}_shin": ((_sign * 0.09, 0.05, 0.28), (_sign * 0.09, 0.0, 0.02), 0.018, 0.12, f"{_side}_thigh"),
    }
# Where strings hold the puppet: bone, place in the world at the start, place on the bar.
STRINGS = {
    "head": ("head", (0.0, 0.0, 1.2), (0.0, 0.0)),
    "left_hand": ("left_forearm", (0.33, 0.12, 0.55), (0.33, 0.12)),
    "right_hand": ("right_forearm", (-0.33, 0.12, 0.55), (-0.33, 0.12)),
    "left_knee": ("left_thigh", (0.09, 0.05, 0.28), (0.16, 0.25)),
    "right_knee": ("right_thigh", (-0.09, 0.05, 0.28), (-0.16, 0.25)),
    "seat": ("torso", (0.0, -0.08, 0.62), (0.0, -0.25)),
}
BAR = 1.75  # height of the bar [m]
WOOD, CLOTH, ROPE = [0.72, 0.52, 0.32], [0.70, 0.28, 0.24], [0.25, 0.25, 0.25]


def puppet(
    flesh: float = 0.028,
    stiffness: float = 0.01,
    sway: float = 0.25,
    dt: float = 5e-4,
    duration: float = 4.0,
) -> Scene:
    """A puppet with soft limbs around rigid bones dances on six strings that hang from a moving bar.

    Ten bones: neck, shoulders and hips are ball joints with cone and twist, elbows and knees revolute joints with limits.
    Arms and legs are coated with a tetrahedral solid `flesh` [m] thick whose inner points are held by the bone and whose
    energies have `stiffness` [J]. The bar rocks by `sway` [rad] and drags strings of mass points, one end of each on the
    bar, the other on a bone: rigid and soft bodies in one system. The paper's bodies are kernels with soft coats as well
    (section 5.1); the figure is ours.
    """
    if not flesh > 0.0:
        raise InputError(f"puppet: flesh = {flesh:g} m must be positive")
    scene = Scene("puppet", dt=dt, duration=duration)
    for name, (start, end, radius, mass, _) in BONES.items():
        _add_bone(scene, name, np.array(start), np.array(end), radius, mass)
    _add_joints(scene)
    _add_limbs(scene, flesh, stiffness)
    _add_bar(scene, sway, duration)
    _add_strings(scene)
    return scene


def _add_bone(scene: Scene, name: str, start: np.ndarray, end: np.ndarray, radius: float, mass: float) -> None:
    """A capsule with its z axis from start to end [m]."""
    along = end - start
    far = float(np.linalg.norm(along))
    middle, turn = 0.5 * (start + end), _turn_to(along)
    hooks = [turn.inv().apply(np.array(place) - middle) for bone, place, _ in STRINGS.values() if bone == name]
    scene.add_rigid(
        name,
        capsule={"radius": radius, "length": far - radius},
        mass=mass,
        position=middle,
        rotation=turn.as_rotvec(),
        markers=np.array(hooks) if hooks else None,
        color=WOOD,
        linear_damping=0.3,
        angular_damping=0.5,
    )


def _turn_to(along: np.ndarray) -> Rotation:
    """z turned to a direction, about an axis perpendicular to both."""
    unit = along / np.linalg.norm(along)
    axis = np.cross([0.0, 0.0, 1.0], unit)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return Rotation.from_rotvec([0.0 if unit[2] > 0.0 else math.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * math.atan2(sine, unit[2]))


def _add_limbs(scene: Scene, flesh: float, stiffness: float) -> None:
    """Soft material around the bones of arms and legs."""
    soft = dict.fromkeys(("k_distance", "k_area", "k_volume"), stiffness)
    damping = dict.fromkeys(("damping_distance", "damping_area", "damping_volume"), 2e-4 * stiffness)
    for name, (_, _, _, _, parent) in BONES.items():
        if parent is not None and name != "head":
            scene.add_coating(
                f"{name}_flesh", around=name, thickness=flesh, density=300.0, color=CLOTH, **soft, **damping
            )


def _add_joints(scene: Scene) -> None:
    """Neck, shoulders, hips: cone and twist about the bone. Elbows, knees: one axis, one way."""
    for name, (start, _, _, _, parent) in BONES.items():
        if parent is None:
            continue
        frame = _frame(scene, parent)
        pair = {"body0": parent, "body1": name, "anchor": start}
        if name.endswith(("forearm", "shin")):
            # The axis points to the puppet's left; forearms bend forward (y), shins back.
            axis = frame.inv().apply([1.0, 0.0, 0.0])
            limits = (-0.6, 1.6) if name.endswith("forearm") else (-1.5, 0.5)
            scene.add_joint(
                "revolute", f"{name}_joint", axis=axis, lower_limit=limits[0], upper_limit=limits[1], **pair
            )
        else:
            along = frame.inv().apply(_frame(scene, name).apply([0.0, 0.0, 1.0]))
            cone = 0.5 if name == "head" else 1.2
            limits = {"lower_limit": -0.6, "upper_limit": 0.6}
            scene.add_joint("cone_twist", f"{name}_joint", axis=along, cone=cone, **limits, **pair)


def _frame(scene: Scene, name: str) -> Rotation:
    body = next(body for body in scene.definition.bodies if body.name == name)
    return Rotation.from_rotvec(np.array(body.rotation))


def _add_bar(scene: Scene, sway: float, duration: float) -> None:
    """The cross that holds the strings: it rocks about y and x, and goes up and down."""
    times = np.linspace(0.0, duration, 2 * math.ceil(4.0 * duration) + 1)
    # Quiet at the start, so that the strings do not jerk.
    grown = np.minimum(times / 0.5, 1.0) ** 2
    rock, nod = np.sin(2.0 * math.pi * times / 1.1), np.sin(2.0 * math.pi * times / 1.7)
    zero = np.zeros_like(times)
    scene.add_rigid(
        "bar",
        parts=[{"box": [0.8, 0.04, 0.03]}, {"box": [0.04, 0.64, 0.03]}],
        color=WOOD,
        position=[0.0, 0.0, BAR],
        markers=[[*hook, 0.0] for _, _, hook in STRINGS.values()],
        trajectory={
            "times": times,
            "positions": np.stack([zero, zero, BAR + 0.06 * grown * nod], axis=1),
            "rotations": sway * grown[:, None] * np.stack([0.6 * nod, rock, zero], axis=1),
        },
    )


def _add_strings(scene: Scene) -> None:
    """Ropes of mass points from the bar to the bones."""
    for number, (name, (bone, place, hook)) in enumerate(STRINGS.items()):
        scene.add_rope(
            f"{name}_string",
            start=[*hook, BAR],
            end=place,
            segments=6,
            mass=0.006,
            stretch_stiffness=1500.0,
            damping=0.3,
            color=ROPE,
        )
        low = [{"body": f"{name}_string", "index": 6}, {"body": bone, "index": 0}]
        high = [{"body": f"{name}_string", "index": 0}, {"body": "bar", "index": number}]
        scene.add_constraint("points_to_point", f"{name}_knots", groups=[low, high])
