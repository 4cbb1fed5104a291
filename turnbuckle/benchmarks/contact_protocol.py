"""What a peer's script of contact is asked for and what it answers, and how it is run: in a process of its own."""

import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from turnbuckle.benchmarks.contact_referee import Referee
from turnbuckle.data.contact import Surfaces

START = 120.0  # [s] of wall time, above what the peer may step: imports, compiling, building


@dataclass(frozen=True)
class ContactTask:
    """A ready scene to simulate, and for how long."""

    scene: str
    parameters: dict[str, Any]
    seconds: float  # of simulated time
    every: int = 10  # every that many of our steps, positions are judged
    wall: float = 300.0  # stop after that much wall time [s]
    options: dict[str, Any] = field(default_factory=dict)  # the peer's own


@dataclass(frozen=True)
class ContactResult:
    """The answer of a peer, all its numbers measured on its own committed states."""

    name: str
    version: str
    dt: float  # [s] between the times; that of our scene
    ms: list[float]  # wall time of each dt, substeps included
    judged: int
    crossing: int  # of the judged states, those that intersect
    most_edges: int  # edges through faces at worst
    went: float  # [m] that points moved in the mean
    how: str


def task_from_arguments() -> ContactTask:
    """The task: one JSON object as the only argument."""
    return ContactTask(**json.loads(sys.argv[1]))


def simulate(
    task: ContactTask,
    dt: float,
    step: Callable[[], None],
    positions: Callable[[], np.ndarray],
    moves: np.ndarray,
    surfaces: Surfaces,
    name: str,
    version: str,
    how: str,
) -> None:
    """Time ``step`` (one of our dt), judge ``positions`` (points, 3) outside the timed part, and print the answer.

    ``moves`` (points,) bool: which points are free. The first step compiles and is not counted.
    """
    referee = Referee(surfaces)
    start = positions()
    times: list[float] = []
    steps = round(task.seconds / dt)
    began = time.perf_counter()
    for number in range(1, steps + 1):
        before = time.perf_counter()
        step()
        times.append(1e3 * (time.perf_counter() - before))
        if number % task.every == 0 or number == steps:
            x = positions()
            if not np.isfinite(x).all():
                how += f"; not finite after {number * dt:.3g} s"
                break
            referee.judge(surfaces.positions(x))
        if number == 1:
            began = time.perf_counter()
        elif time.perf_counter() - began > task.wall:
            break
    went = float(np.linalg.norm(positions() - start, axis=1)[moves].mean())
    counts = (referee.judged, referee.crossing, referee.most_edges)
    print(json.dumps(asdict(ContactResult(name, version, dt, times[1:], *counts, went, how))))


def run_peer(name: str, package: str, module: str, task: ContactTask) -> ContactResult | str:
    """The peer's answer, or a sentence why there is none."""
    if importlib.util.find_spec(package) is None:
        return f"{name} skipped: pip install {package}"
    command = [sys.executable, "-m", f"turnbuckle.benchmarks.peers.{module}", json.dumps(asdict(task))]
    limit = START + 2.0 * task.wall
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return f"{name} skipped: no answer in {limit:.0f} s"
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"{name} failed with exit code {done.returncode}: {last}"
    answer: Mapping[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return ContactResult(**answer)
