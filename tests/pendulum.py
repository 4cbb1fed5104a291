"""A soft pendulum with a nail, points to point and an attached point, for the library and for the references."""

from dataclasses import dataclass

import numpy as np
from laboratory import Held, Run, attach, join, nail, rope
from reference import constraints, energies

GRAVITY = np.array([0.0, 0.0, -9.81])
WEIGHTS = np.array([0.35, 0.65])
UPPER = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, -0.1], [0.8, 0.1, -0.2]])
LOWER = np.array([[0.8, 0.1, -0.2], [1.0, 0.2, -0.4], [1.1, 0.2, -0.7], [1.3, 0.1, -0.9]])
SIDE = WEIGHTS @ LOWER[1:3] + np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 0.1]])
ROPES = {"upper": (UPPER, 1.5), "lower": (LOWER, 2.0), "side": (SIDE, 0.8)}


@dataclass(frozen=True)
class Pendulum:
    """The same scene twice: `run` in the library, the other fields for the references (9 points)."""

    run: Run
    springs: list[energies.Element]
    rows: np.ndarray  # J, (4, 9)
    held: list[Held]
    x: np.ndarray
    v: np.ndarray

    def force(self, x: np.ndarray, v: np.ndarray, t: float) -> np.ndarray:
        return energies.forces(self.springs, x, v) + self.run.m[:, None] * GRAVITY


def build(integrator: str, stiffness: float, damping: float, **more) -> Pendulum:
    """Upper point 0 nailed; upper 2 and lower 0 joined; side 0 attached between lower 1 and lower 2."""
    bodies = [rope(name, points, mass, stiffness, damping) for name, (points, mass) in ROPES.items()]
    held = [
        nail("nail", "upper", 0),
        join("joint", ("upper", 2), ("lower", 0)),
        attach("hook", ("side", 0), "lower", [1, 2], WEIGHTS),
    ]
    run = Run({"integrator": integrator, "gravity": GRAVITY, "bodies": bodies, "constraints": held, **more})
    springs, begin = [], 0
    for points, _ in ROPES.values():
        for i in range(len(points) - 1):
            length = float(np.linalg.norm(points[i + 1] - points[i]))
            springs.append(energies.spring(begin + i, begin + i + 1, length, stiffness, damping))
        begin += len(points)
    rows = np.concatenate(
        [
            constraints.nail_row(9, 0),
            constraints.points_to_point_rows(9, [2, 3]),
            constraints.attach_row(9, 7, [4, 5], WEIGHTS),
        ]
    )
    outside = [
        Held("nail", [0], goal=np.zeros(3)),
        Held("join", [2, 3]),
        Held("attach", [7, 4, 5], weights=WEIGHTS),
    ]
    x = np.concatenate([points for points, _ in ROPES.values()])
    return Pendulum(run, springs, rows, outside, x, np.zeros_like(x))
