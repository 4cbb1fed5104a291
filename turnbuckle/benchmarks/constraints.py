"""Constraints a millisecond by kind, residual and force written: Local, section 5, last numbers of its first page."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import warp as wp
from rich.console import Console

import turnbuckle
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.data.state import Kinematics
from turnbuckle.step.recording import StepRecorder

POINTS = 24_000  # about those of the curtain of 2990 cubes; divisible by all that follows
LARGE = 1000  # points of one large points-to-point
DT = 1e-3  # [s]
PASSES = 20  # in one recording

Add = Callable[[turnbuckle.Scene], int]  # adds constraints to a scene with a body "dots", returns how many


def nails(scene: turnbuckle.Scene) -> int:
    scene.add_constraint("nail", "all", points={"body": "dots", "all": True})
    return POINTS


def pairs(scene: turnbuckle.Scene) -> int:
    first, second = np.arange(POINTS, dtype=np.int32).reshape(2, -1)
    sides = [{"body": "dots", "indices": side} for side in (first, second)]
    scene.add_constraint("points_to_point", "pairs", zip=sides)
    return len(first)


def large(scene: turnbuckle.Scene) -> int:
    groups = np.arange(POINTS, dtype=np.int32).reshape(LARGE, -1).T
    for number, group in enumerate(groups):
        scene.add_constraint("points_to_point", f"group-{number}", join={"body": "dots", "indices": group})
    return len(groups)


def attached(corners: int) -> Add:
    """Points on elements of `corners` corners, weights of the middle."""

    def add(scene: turnbuckle.Scene) -> int:
        count = POINTS // (corners + 1)
        point, *element = np.arange(count * (corners + 1), dtype=np.int32).reshape(corners + 1, count)
        scene.add_constraint(
            "attach",
            "attached",
            points={"body": "dots", "indices": point},
            to={"body": "dots", "elements": np.stack(element, axis=1)},
            weights=np.full((count, corners), 1.0 / corners),
        )
        return count

    return add


# kind -> how to add it, and what the paper says it computes in a millisecond (a Pentium 4 of 3.4 GHz)
KINDS: dict[str, tuple[Add, float]] = {
    "nail": (nails, 1000.0),
    "point to point, n = 2": (pairs, 500.0),
    "point to line": (attached(2), 1000.0 / 3.0),
    "point to triangle": (attached(3), 250.0),
    "point to tetrahedron": (attached(4), 200.0),
    f"one point of n = {LARGE}": (large, 1.0),
}


def constraint_ms(add: Add, runs: int = 200) -> tuple[int, float, float]:
    """Number of constraints; median and least time [ms] to land them with their forces, and to measure their residuals.

    Both are recorded `PASSES` times in a row, so that waking the threads is not what is timed.
    """
    scene = turnbuckle.Scene("dots", gravity=[0.0, 0.0, 0.0], dt=DT)
    row = np.arange(POINTS, dtype=float)
    places = np.stack([row * 1e-3, np.cos(row), np.sin(row)], axis=1)
    scene.add_rope("dots", points=places, stretch_stiffness=0.0)
    count = add(scene)
    simulation = turnbuckle.Simulation(scene)
    for _ in range(3):
        report = simulation.step()
    if report.status != "ok":
        raise RuntimeError(f"{count} constraints: the step is {report.status}: {report.messages}")
    stepper, state = simulation.stepper, simulation.state
    ahead = Kinematics(*(wp.clone(a) for a in (state.now.x, state.now.v, state.now.force, state.now.memory)))
    recorder = StepRecorder(simulation.model, state, stepper.scratch, state.now, ahead)
    for _ in range(PASSES):
        recorder.land(ahead)
        recorder.program.barrier()
        stepper.certificate.record_constraints(recorder.program, ahead.x, ahead.v, False)
        recorder.program.barrier()
    program = recorder.program.finish(parallel_from=0)
    spent = []
    for _ in range(runs):
        began = time.perf_counter()
        program.run()
        spent.append(1e3 * (time.perf_counter() - began) / PASSES)
    return count, statistics.median(spent), min(spent)


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Measure, print, write tables."""
    console, busy = console or Console(), load()
    table = Table(
        "Constraints landed, residual and force written",
        ["kind", "number", "us", "a ms (median)", "a ms (best)", "points a ms", "paper a ms"],
    )
    for kind, (add, paper) in KINDS.items():
        count, ms, least = constraint_ms(add)
        points = 1000.0 * count / paper  # the paper computes 1000 points a millisecond, whatever the kind
        table.add(kind, count, 1e3 * ms, count / ms, count / least, points / ms, paper)
    table.notes.append(
        f"{POINTS:,} points under Verlet: positions, velocities and Verlet's w landed, forces written, and the residuals of "
        "the landed state measured by the certificate's own kernels. The paper: a Pentium 4 of 3.4 GHz."
    )
    publish("constraints", [table], console, folder, busy)
    return [table]


if __name__ == "__main__":
    measure()
