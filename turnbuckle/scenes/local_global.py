"""Two springs and a torsional spring fly against a wall: Contact, Figure 2."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

REST = np.array([[0.0, 0.0, 0.0], [0.10, 0.0, 0.03], [0.20, 0.0, 0.0]])  # a, b, c at the start [m]
NORMAL = np.array([-0.8, 0.0, 0.6])  # of the wall, towards the structure
AWAY = 0.01  # of the wall from c at the start [m]
DELTA = 1e-3  # distance that contact keeps [m]


def local_global(
    stiffness: float = 100.0,
    bend_stiffness: float = 20.0,
    speed: float = 1.0,
    mass: float = 0.03,
    mu: float = 0.0,
    dt: float = 0.01,
    duration: float = 0.3,
) -> Scene:
    """A structure a-b-c with springs (a,b), (b,c) and a torsional spring at b flies against a wall (Contact, Figure 2).

    It comes with `speed` [m/s], c ahead, and meets the wall obliquely. Projecting c alone out of the wall (the paper's left
    picture, `projected`) leaves a and b where they would be without the wall and stretches the springs; a response that
    knows the dynamics moves b too, and the elastic energy stays far lower (right picture): compare `elastic_energy` of both
    places after the step that meets the wall.
    Springs of `stiffness` [N/m] 100; the torsional spring is a spring of `bend_stiffness` [N/m] 20 between a and c; `mass`
    [kg] 0.03 in all, no gravity, friction `mu` 0; the wall is 1 cm from c at the start.
    """
    if not speed > 0.0:
        raise InputError(f"local_global: speed = {speed:g} m/s must be positive")
    scene = Scene("local_global", dt=dt, duration=duration, gravity=[0.0, 0.0, 0.0], contact={"friction": mu})
    scene.add_rope(
        "structure",
        points=REST,
        stretch_stiffness=stiffness,
        bend_stiffness=bend_stiffness,
        mass=mass,
        velocity=-speed * NORMAL,
        contact_delta=DELTA,
        color=[0.2, 0.3, 0.6],
    )
    # The wall is the plane z = 0 of its own frame, turned about y so that its z axis is NORMAL.
    turn = [0.0, float(np.arctan2(NORMAL[0], NORMAL[2])), 0.0]
    place = REST[2] - AWAY * NORMAL
    scene.add_obstacle("wall", plane=[0.3, 0.3], rotation=turn, position=place, contact_delta=DELTA)
    return scene


def projected(x: np.ndarray) -> np.ndarray:
    """Places (3, 3) [m] of a, b, c when only c is moved, along the normal, out of the wall (left picture).

    ``x`` (3, 3) [m] are their places at the end of a step without contact.
    """
    out = np.array(x, dtype=float)
    gap = NORMAL @ (out[2] - REST[2]) + AWAY - DELTA
    out[2] -= min(gap, 0.0) * NORMAL
    return out


def elastic_energy(x: np.ndarray, stiffness: float = 100.0, bend_stiffness: float = 20.0) -> float:
    """Energy [J] of the springs for the places (3, 3) [m] of a, b, c."""
    total = 0.0
    for i, j, k in ((0, 1, stiffness), (1, 2, stiffness), (0, 2, bend_stiffness)):
        length = np.linalg.norm(x[j] - x[i]) - np.linalg.norm(REST[j] - REST[i])
        total += 0.5 * k * float(length) ** 2
    return total
