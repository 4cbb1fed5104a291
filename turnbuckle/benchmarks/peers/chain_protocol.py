"""The chain that peers are asked for and what they answer: `closed_chain` as plain arrays."""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.scenes.closed_chain import chain_shape

LENGTH, THICKNESS, MASS = 0.2, 0.05, 1.0  # [m], [m], [kg]
SPAN, TILT = 0.7, 0.6
DT = 1.0 / 240.0  # [s]
GRAVITY = -9.81  # [m/s^2], along z
WARM_UP = 10  # steps that are not timed


@dataclass(frozen=True)
class ChainTask:
    """A chain, and for how long to simulate it."""

    n: int
    steps: int
    seconds: float  # stop after that much wall time, whatever the number of steps

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the boxes (n + 1, 3) [m] and their orientations (n, 4) xyzw at the start; boxes lie along their x."""
        ends, turns = chain_shape(self.n, LENGTH, SPAN, TILT)
        return ends, turns.as_quat()


@dataclass(frozen=True)
class ChainResult:
    """The answer of a peer, all its numbers measured on its own committed state."""

    name: str
    version: str
    n: int
    steps: int
    ms_per_step: float  # median
    gap: float  # [m], worst distance of two joined points over all steps
    moved: float  # [m], how far a box got from its start: a chain that does not move proves nothing
    how: str


def worst_gap(x: np.ndarray, q: np.ndarray, first: np.ndarray, last: np.ndarray | None) -> float:
    """Worst opening [m] of all joints: boxes at x (n, 3) turned by q (n, 4) xyzw; ends held at first and last (None: free)."""
    half = Rotation.from_quat(q).apply([0.5 * LENGTH, 0.0, 0.0])
    left, right = x - half, x + half
    ends = [left[:1] - first, right[:-1] - left[1:]]
    if last is not None:
        ends.append(right[-1:] - last)
    return float(np.linalg.norm(np.concatenate(ends), axis=1).max())


def task_from_arguments() -> ChainTask:
    parser = argparse.ArgumentParser(description="Simulate the chain and print one JSON object.")
    parser.add_argument("--n", type=int, default=100)
    parser.add_argument("--steps", type=int, default=480)
    parser.add_argument("--seconds", type=float, default=20.0)
    return ChainTask(**vars(parser.parse_args()))


def simulate(
    task: ChainTask,
    step: Callable[[], None],
    poses: Callable[[], tuple[np.ndarray, np.ndarray]],
    name: str,
    version: str,
    how: str,
    closed: bool = True,
    steps_a_call: int = 1,
) -> None:
    """Warm up, time `step`, measure `poses` (x (n, 3), q (n, 4) xyzw) outside the timed part, and print the answer."""
    ends, _ = task.start()
    first, last = ends[0], ends[-1] if closed else None
    start = 0.5 * (ends[1:] + ends[:-1])
    for _ in range(WARM_UP):
        step()
    times: list[float] = []
    gap = moved = 0.0
    began = time.perf_counter()
    while len(times) * steps_a_call < task.steps and time.perf_counter() - began < task.seconds:
        before = time.perf_counter()
        step()
        times.append(1e3 * (time.perf_counter() - before) / steps_a_call)
        x, q = poses()
        gap = max(gap, worst_gap(x, q, first, last))
        moved = max(moved, float(np.linalg.norm(x - start, axis=1).max()))
    done = len(times) * steps_a_call
    print(json.dumps(asdict(ChainResult(name, version, task.n, done, statistics.median(times), gap, moved, how))))
