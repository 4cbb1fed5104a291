"""Four-bar windows in a row: loops that pass through singular positions."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

THIN = 0.04  # [m], of the rods as drawn


def four_bars(
    n: int = 2,
    length: float = 1.0,
    mass: float = 1.0,
    speed: float = 1.0,
    dt: float = 2e-3,
    duration: float = 10.0,
) -> Scene:
    """`n` four-bar windows side by side, 2 n + 1 thin rods, swing through their singular position.

    The N-four-bar mechanism of the multibody benchmark collection of IFToMM (problem A02). n + 1 rods stand upright on
    revolute joints of the world and are joined at their tops by n level rods; all are uniform, of `length` [m] and
    `mass` [kg]. The tops start with `speed` [m/s] along x, y is up. Whenever all rods lie level, the mechanism has n + 1
    degrees of freedom for an instant, else one. In space each window has three redundant conditions. The paper has loops
    in its monocycle only.
    """
    if n < 1:
        raise InputError(f"four_bars: n = {n}; at least 1 window is needed")
    scene = Scene("four_bars", up_axis="Y", dt=dt, duration=duration)
    # Slender rods: the moment about their own axis plays no part, but must not be zero.
    slender = mass * length**2 / 12.0
    turn = -speed / length  # [rad/s] about z
    for i in range(n + 1):
        scene.add_rigid(
            f"upright_{i}",
            box=[THIN, length, THIN],
            mass=mass,
            inertia=[slender, 1e-3 * slender, slender],
            position=[i * length, 0.5 * length, 0.0],
            velocity=[0.5 * speed, 0.0, 0.0],
            angular_velocity=[0.0, 0.0, turn],
            color=[0.20, 0.40, 0.62],
        )
    for i in range(n):
        scene.add_rigid(
            f"level_{i}",
            box=[length, THIN, THIN],
            mass=mass,
            inertia=[1e-3 * slender, slender, slender],
            position=[(i + 0.5) * length, length, 0.0],
            velocity=[speed, 0.0, 0.0],
            color=[0.85, 0.60, 0.25],
        )
    axis = np.array([0.0, 0.0, 1.0])
    low, high = [0.0, -0.5 * length, 0.0], [0.0, 0.5 * length, 0.0]
    left, right = [-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]
    for i in range(n + 1):
        foot = {"body1": f"upright_{i}", "local_pos0": [i * length, 0.0, 0.0], "local_pos1": low}
        scene.add_joint("revolute", f"foot_{i}", axis=axis, **foot)
    for i in range(n):
        # Both level rods at an upright turn about the same pin.
        for end, upright, place in (("left", i, left), ("right", i + 1, right)):
            pair = {"body0": f"upright_{upright}", "body1": f"level_{i}", "local_pos0": high, "local_pos1": place}
            scene.add_joint("revolute", f"{end}_{i}", axis=axis, **pair)
    return scene
