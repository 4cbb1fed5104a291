"""A flying snake whose tail slides along a rod: Displacement, Figure 5."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

BODIES = 6


def snake(
    length: float = 1.8,
    thickness: float = 0.06,
    mass: float = 1.8,
    rise: float = 0.35,
    wave: float = 0.12,
    flesh: float = 0.03,
    stiffness: float = 0.03,
    slide: float = 0.55,
    dt: float = 1.0 / 960.0,
    duration: float = 3.0,
) -> Scene:
    """A snake of six bodies swings from a rod along which its tail slides between two stops (Figure 5).

    As in the paper: six solids of a rigid kernel and a deformable coat, five points to point, one point to segment, one
    skin over all. The snake, `length` [m] long and `thickness` [m] in radius, with kernels of `mass` [kg] and a coat of
    `flesh` [m] and `stiffness` [J], starts stretched out to the right of the middle of the rod, rising at `rise` [rad],
    with a sideways wave of `wave` [rad]. Its fall drags the tail to the right until the stop, `slide` [m] from the
    middle, holds it; the snake swings through, flies back to the left, and its tail slides again. y is up, the rod lies
    along x. `flesh=0` leaves the kernels bare.
    """
    if not 0.0 < slide:
        raise InputError(f"snake: slide = {slide:g} m must be positive")
    if not 0.0 <= flesh < thickness:
        raise InputError(f"snake: flesh = {flesh:g} m must be less than thickness = {thickness:g} m")
    scene = Scene("snake", up_axis="Y", dt=dt, duration=duration)
    part = length / BODIES
    start = np.zeros(3)
    names = ["tail", *(f"trunk_{i}" for i in range(1, BODIES - 1)), "head"]
    for i, name in enumerate(names):
        # From z, along which capsules lie, to the direction of this part: level to the right, raised, waved.
        turn = Rotation.from_euler("zy", [rise, wave * math.cos(math.pi * i)]) * Rotation.from_rotvec(
            [0, 0.5 * math.pi, 0]
        )
        along = turn.apply([0.0, 0.0, part])
        scene.add_rigid(
            name,
            capsule={"radius": thickness - flesh, "length": part - thickness},
            mass=mass / BODIES,
            position=start + 0.5 * along,
            rotation=turn.as_rotvec(),
            color=[0.30, 0.55, 0.25] if i % 2 == 0 else [0.70, 0.72, 0.25],
            angular_damping=0.3,
        )
        if flesh > 0.0:
            _add_flesh(scene, name, flesh, stiffness)
        start = start + along
    back, front = [0.0, 0.0, -0.5 * part], [0.0, 0.0, 0.5 * part]
    for before, after in zip(names[:-1], names[1:], strict=True):
        scene.add_joint("ball", f"{before}-{after}", body0=before, body1=after, local_pos0=front, local_pos1=back)
    along_rod = {"axis": [1.0, 0.0, 0.0], "min": -slide, "max": slide}
    places = {"local_pos0": [0.0, 0.0, 0.0], "local_pos1": back}
    scene.add_joint("joint", "rod_slide", body1="tail", axial=along_rod, **places)
    if flesh > 0.0:
        scene.add_skin("skin", bodies=[f"{name}_flesh" for name in names], color=[0.36, 0.56, 0.24])
    _add_rod(scene, slide, 0.25 * thickness)
    return scene


def _add_flesh(scene: Scene, name: str, flesh: float, stiffness: float) -> None:
    """Deformable material around a kernel."""
    soft = dict.fromkeys(("k_distance", "k_area", "k_volume"), stiffness)
    damping = dict.fromkeys(("damping_distance", "damping_area", "damping_volume"), 3e-4 * stiffness)
    scene.add_coating(f"{name}_flesh", around=name, thickness=flesh, density=300.0, **soft, **damping)


def _add_rod(scene: Scene, slide: float, radius: float) -> None:
    """The rod and its stops, to look at."""
    across = [0.0, 0.5 * math.pi, 0.0]
    parts: list[dict] = [{"cylinder": {"radius": radius, "length": 2.0 * slide + 0.4}, "rotation": across}]
    for x in (-slide, slide):
        disc = {"radius": 4.0 * radius, "length": 2.0 * radius}
        parts.append({"cylinder": disc, "rotation": across, "position": [x + math.copysign(2.0 * radius, x), 0.0, 0.0]})
    scene.add_rigid("rod", parts=parts, motion="immobile", color=[0.45, 0.45, 0.48])
