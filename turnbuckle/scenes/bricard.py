"""Bricard's mechanism: six bars in space that by count cannot move, and do."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

# Six edges of a cube that form a closed path; the last, from corner 5 back to corner 0, is the world.
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)
RODS = 5


def bricard(
    length: float = 1.0,
    thickness: float = 0.1,
    mass: float = 1.0,
    throw: float = 0.0,
    angle: float = 0.0,
    seed: int = 0,
    dt: float = 2e-3,
    duration: float = 10.0,
) -> Scene:
    """Five rods and the world in one spatial loop of six revolute joints, one of its conditions redundant (Bricard).

    The mechanism of the multibody benchmark collection of IFToMM (problem A04): rods of `length` [m] with a square
    section of `thickness` [m] and of `mass` [kg] lie along edges of a cube, each joint's axis is perpendicular to both of
    its rods. y is up. Six revolute joints take 30 of 30 degrees of freedom; that it moves is due to its shape.
    For assembly (paper, section 2.3), `throw` [m] and `angle` [rad] displace and turn every rod that far, each in a
    direction of its own drawn with `seed`; the joints stay those of the closed mechanism.
    """
    if throw < 0.0 or angle < 0.0:
        raise InputError(f"bricard: throw = {throw:g} m and angle = {angle:g} rad must not be negative")
    scene = Scene("bricard", up_axis="Y", dt=dt, duration=duration)
    random = np.random.default_rng(seed)
    corners = length * CORNERS
    for i in range(RODS):
        along = CORNERS[i + 1] - CORNERS[i]
        thrown, turned = (_direction(random) for _ in range(2))
        # The rod's frame is the world's, so that its axes are those of the joints.
        scene.add_rigid(
            f"rod_{i}",
            box=np.where(along != 0.0, length, thickness),
            mass=mass,
            position=0.5 * (corners[i] + corners[i + 1]) + throw * thrown,
            rotation=angle * turned,
            color=[0.20, 0.40, 0.62] if i % 2 == 0 else [0.85, 0.60, 0.25],
        )
    for k in range(RODS + 1):
        before, after = CORNERS[k] - CORNERS[k - 1], CORNERS[(k + 1) % (RODS + 1)] - CORNERS[k]
        axis = np.cross(before, after)
        near, far = 0.5 * length * before, -0.5 * length * after
        # body1 is the rod after the joint, at the last joint the rod before it.
        if k == 0:
            pair = {"body1": "rod_0", "local_pos0": corners[0], "local_pos1": far}
        elif k == RODS:
            pair = {"body1": f"rod_{RODS - 1}", "local_pos0": corners[k], "local_pos1": near}
        else:
            pair = {"body0": f"rod_{k - 1}", "body1": f"rod_{k}", "local_pos0": near, "local_pos1": far}
        # A revolute joint takes its axis from the start; thrown rods need it in each frame.
        hinge = {"axis0": axis, "axis1": axis, "min": 0.0, "max": 0.0}
        scene.add_joint("joint", f"hinge_{k}", angle=hinge, **pair)
    return scene


def _direction(random: np.random.Generator) -> np.ndarray:
    """A unit vector, all directions alike."""
    direction = random.normal(size=3)
    return direction / np.linalg.norm(direction)
