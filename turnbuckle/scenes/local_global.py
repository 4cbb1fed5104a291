"""Two springs and a torsional spring are pushed by a wall: Contact, Figure 2."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

A, B, C = np.array([0.0, 0.0, 0.0]), np.array([0.10, 0.0, 0.03]), np.array([0.20, 0.0, 0.0])  # at rest [m]
NORMAL = np.array([-0.8, 0.0, 0.6])  # of the wall, towards the structure
AWAY = 0.01  # of the wall from c at the start [m]


def local_global(
    stiffness: float = 100.0,
    bend_stiffness: float = 20.0,
    push: float = 0.03,
    mass: float = 0.03,
    mu: float = 0.0,
    dt: float = 2e-3,
    duration: float = 1.5,
) -> Scene:
    """A structure a-b-c with springs (a,b), (b,c) and a torsional spring at b is pushed by a wall (Contact, Figure 2).

    a is nailed; the wall comes to c within half a second and moves on by `push` [m], then stands. Projecting c alone out
    of the wall (the paper's left picture) leaves a and b where they are and stretches the springs; a response that knows
    the dynamics moves b too, and the elastic energy stays far lower (right picture): compare `elastic_energy` of
    both places with that of the run.
    Springs of `stiffness` [N/m] 100; the torsional spring is a spring of `bend_stiffness` [N/m] 20 between a and c;
    `mass` [kg] 0.03 in all, no gravity, friction `mu`.
    """
    if not push > 0.0:
        raise InputError(f"local_global: push = {push:g} m must be positive")
    scene = Scene("local_global", dt=dt, duration=duration, gravity=[0.0, 0.0, 0.0], contact={"friction": mu})
    scene.add_rope(
        "structure",
        points=np.stack([A, B, C]),
        stretch_stiffness=stiffness,
        bend_stiffness=bend_stiffness,
        damping=0.05,
        bend_damping=0.05,
        mass=mass,
        contact_delta=1e-3,
        color=[0.2, 0.3, 0.6],
    )
    scene.add_constraint("nail", "a", points={"body": "structure", "index": 0})
    # The wall is the plane z = 0 of its own frame, turned so that its z axis is NORMAL.
    turn = np.array([0.0, -np.arctan2(-NORMAL[0], NORMAL[2]), 0.0])
    start = C - AWAY * NORMAL
    keys = [start, start + (AWAY + push) * NORMAL]
    scene.add_obstacle(
        "wall",
        plane=[0.2, 0.2],
        rotation=turn,
        trajectory={"times": [0.0, 0.5], "positions": keys},
        contact_delta=1e-3,
    )
    return scene


def projected(push: float, delta: float = 1e-3) -> np.ndarray:
    """Places of a, b, c [m], (3, 3), when only c is moved, along the normal, out of the wall (left picture)."""
    return np.stack([A, B, C + (push + delta) * NORMAL])


def elastic_energy(x: np.ndarray, stiffness: float = 100.0, bend_stiffness: float = 20.0) -> float:
    """Energy [J] of the springs for the places (3, 3) [m] of a, b, c."""
    rest = np.stack([A, B, C])
    total = 0.0
    for i, j, k in ((0, 1, stiffness), (1, 2, stiffness), (0, 2, bend_stiffness)):
        length = np.linalg.norm(x[j] - x[i]) - np.linalg.norm(rest[j] - rest[i])
        total += 0.5 * k * float(length) ** 2
    return total
