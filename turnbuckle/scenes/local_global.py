"""A structure of springs and a torsional spring is pushed against a wall: Contact, Figure 2."""

import numpy as np
from scipy.optimize import minimize

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

# a, b (two points, the ends of the torsional spring's edge) and c at rest [m]; its two triangles share that edge.
REST = np.array([[0.0, 0.0, 0.0], [0.10, -0.02, 0.03], [0.10, 0.02, 0.03], [0.20, 0.0, 0.0]])
TRIANGLES = np.array([[0, 2, 1], [3, 1, 2]], np.int32)
SPRINGS = ((0, 1), (0, 2), (3, 1), (3, 2), (1, 2))  # (a,b), (b,c) and the edge at b
A, B, C = 0, [1, 2], 3
NORMAL = np.array([-np.cos(0.26), 0.0, np.sin(0.26)])  # of the wall, towards the structure, 15 degrees from c - a
AWAY = 0.01  # of the wall from c at the start [m]
DELTA = 2e-4  # distance that contact keeps [m]
MOVING = 0.5  # time that a is moved [s]
STIFFNESS, TORSION = 100.0, 0.01  # [N/m], [N m/rad]


def local_global(
    stiffness: float = STIFFNESS,
    torsion: float = TORSION,
    push: float = 0.02,
    mass: float = 0.03,
    mu: float = 1.0,
    dt: float = 0.01,
    duration: float = 2.0,
) -> Scene:
    """A structure a-b-c with springs (a,b), (b,c) and a torsional spring at b is pushed against a wall (Contact, Figure 2).

    A hand moves a straight at the wall, `push` [m] further than where c touches, and holds it; c sticks to the wall.
    Moving c alone out of the wall along its normal (the paper's left picture, `projected`) keeps a and b and stretches the
    springs (b,c); a response that knows the dynamics moves b too, where the elastic energy is least (right picture):
    compare `elastic_energy` of both, or `turnbuckle bench local_global`.
    (a,b) and (b,c) are pairs of springs of `stiffness` [N/m] 100 on both ends of the edge that b is; `torsion` [N m/rad]
    0.01 acts between the two triangles there; `mass` [kg] 0.03 in all, no gravity, friction `mu` 1.
    """
    if not push > 0.0:
        raise InputError(f"local_global: push = {push:g} m must be positive")
    scene = Scene("local_global", dt=dt, duration=duration, gravity=[0.0, 0.0, 0.0], contact={"friction": mu})
    scene.add_cloth(
        "structure",
        vertices=REST,
        triangles=TRIANGLES,
        structural_stiffness=stiffness,
        bend_model="hinges",
        bend_stiffness=torsion,
        bend_damping=0.05 * torsion,
        damping=1e-3 * stiffness,
        mass=mass,
        velocity=(moved(REST, push)[A] - REST[A]) / MOVING,  # that of the hand
        contact_delta=DELTA,
        color=[0.2, 0.3, 0.6],
    )
    hand = {"times": [0.0, MOVING], "positions": [REST[A], moved(REST, push)[A]]}
    scene.add_constraint("nail", "hand", points={"body": "structure", "index": A}, goal=hand)
    # The wall is the plane z = 0 of its own frame, turned about y so that its z axis is NORMAL.
    turn = [0.0, float(np.arctan2(NORMAL[0], NORMAL[2])), 0.0]
    place = REST[C] - AWAY * NORMAL
    scene.add_obstacle("wall", plane=[0.3, 0.3], rotation=turn, position=place, contact_delta=DELTA)
    return scene


def moved(x: np.ndarray, push: float = 0.02) -> np.ndarray:
    """Places [m] where the hand takes the structure if there is no wall."""
    return x - (AWAY + push) * NORMAL


def wall_distance(x: np.ndarray) -> np.ndarray:
    """Of places (n, 3) [m], from the wall [m]."""
    return (x - REST[C]) @ NORMAL + AWAY


def projected(x: np.ndarray, gap: float = DELTA) -> np.ndarray:
    """Places (4, 3) [m] when only c is moved, along the normal, until it is `gap` [m] from the wall (left picture).

    ``x`` (4, 3) [m]: their places without contact.
    """
    out = np.array(x, dtype=float)
    out[C] += max(gap - wall_distance(out[[C]])[0], 0.0) * NORMAL
    return out


def elastic_energy(x: np.ndarray, stiffness: float = STIFFNESS, torsion: float = TORSION) -> float:
    """Energy [J] of the springs and of the torsional spring for the places (4, 3) [m] of a, b, b', c."""
    stretch = [np.linalg.norm(x[j] - x[i]) - np.linalg.norm(REST[j] - REST[i]) for i, j in SPRINGS]
    return 0.5 * stiffness * float(np.square(stretch).sum()) + 0.5 * torsion * (_angle(x) - _angle(REST)) ** 2


def optimal(x: np.ndarray, stiffness: float = STIFFNESS, torsion: float = TORSION) -> np.ndarray:
    """Places (4, 3) [m] with b where the elastic energy is least, a and c where ``x`` (4, 3) has them (right picture)."""
    out = np.array(x, dtype=float)

    def energy(b: np.ndarray) -> float:
        out[B] = b.reshape(2, 3)
        return elastic_energy(out, stiffness, torsion) / torsion

    found = minimize(energy, out[B].ravel(), method="BFGS", options={"gtol": 1e-7})
    out[B] = found.x.reshape(2, 3)
    return out


def _angle(x: np.ndarray) -> float:
    """Between the normals of the triangles [rad], about the edge at b."""
    a, low, high, c = np.asarray(x, dtype=float)
    first, second = np.cross(high - a, low - a), np.cross(low - c, high - c)
    along = (high - low) / np.linalg.norm(high - low)
    return float(np.arctan2(np.cross(first, second) @ along, first @ second))
