"""What a peer's script is asked for and what it answers, the same for all of them."""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from turnbuckle.scenes.curtain_geometry import CurtainGeometry, curtain_geometry

DENSITY = 1000.0  # [kg/m^3]
WARM_UP = 4  # steps that are not timed: what compiles does it there
GRAVITY = -9.81  # [m/s^2], along Y


@dataclass(frozen=True)
class Task:
    """The curtain to simulate, and for how long."""

    m: int
    steps: int
    dt: float  # [s]
    iterations: int
    seconds: float  # stop after that much wall time, whatever the number of steps

    def geometry(self) -> CurtainGeometry:
        return curtain_geometry(self.m)


@dataclass(frozen=True)
class PeerResult:
    """The answer of a peer, all its numbers measured on its own committed state."""

    name: str
    version: str
    cubes: int
    tets: int
    constraints: int
    dt: float  # [s]
    steps: int
    iterations: int
    ms_per_step: float  # median
    gap: float  # [m], worst distance of two joined corners or of a nail from its place, over all steps
    dropped: float  # [m], how far the lowest corner went: a scene that does not move proves nothing
    how: str  # how nails, joints and elements were expressed


def task_from_arguments() -> Task:
    parser = argparse.ArgumentParser(description="Simulate the curtain and print one JSON object.")
    parser.add_argument("--m", type=int, default=150)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--dt", type=float, default=2e-3)
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=40.0)
    return Task(**vars(parser.parse_args()))


def lumped_masses(curtain: CurtainGeometry) -> np.ndarray:
    """Mass of every point [kg], shape (points,): a quarter of each tetrahedron around it."""
    a, b, c, d = np.moveaxis(curtain.vertices[curtain.tetrahedra], 1, 0)
    volume = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0
    quarter = np.repeat(DENSITY * volume / 4.0, 4)
    return np.bincount(curtain.tetrahedra.ravel(), weights=quarter, minlength=len(curtain.vertices))


def simulate(
    task: Task,
    step: Callable[[], None],
    positions: Callable[[], np.ndarray],
    name: str,
    version: str,
    how: str,
    steps_a_call: int = 1,
) -> None:
    """Warm up, time `step`, measure `positions` outside the timed part, and print the answer.

    A call of `step` is `steps_a_call` steps. The gap starts to count after the warm-up steps, as the time does.
    """
    curtain = task.geometry()
    for _ in range(WARM_UP):
        step()
    times: list[float] = []
    gap = 0.0
    start = time.perf_counter()
    while len(times) * steps_a_call < task.steps and time.perf_counter() - start < task.seconds:
        before = time.perf_counter()
        step()
        times.append(1e3 * (time.perf_counter() - before) / steps_a_call)
        gap = max(gap, curtain.worst_gap(positions()))
    dropped = float(curtain.vertices[:, 1].min() - positions()[:, 1].min())
    result = PeerResult(
        name=name,
        version=version,
        cubes=curtain.cubes,
        tets=len(curtain.tetrahedra),
        constraints=len(curtain.nails) + len(curtain.pairs),
        dt=task.dt,
        steps=len(times) * steps_a_call,
        iterations=task.iterations,
        ms_per_step=statistics.median(times),
        gap=gap,
        dropped=dropped,
        how=how,
    )
    print(json.dumps(asdict(result)))
