"""Displacement, section 5.3: the monocycle under the paper's schemes and ours, and automatic assembly.

`python -m turnbuckle.benchmarks.monocycle`, or `turnbuckle bench monocycle`.
"""

import statistics
import time
from collections import Counter
from dataclasses import dataclass
from math import radians
from pathlib import Path

from rich.console import Console

import turnbuckle
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.monocycle_plot import iterations_figure
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.scenes import REGISTRY

FRAME = 1.0 / 60.0  # [s]
LIMB = 1.0  # [m], a thigh of Appendix A
TOLERANCE = 1e-3 * LIMB
SECONDS = 5.0  # of the ride
MOST = 200  # iterations a frame
PAPER_ITERATIONS = 6  # "under six" most of the time
STEPS_A_SECOND = 2000.0  # asked of the default solver
THROW, ANGLE = 0.20, radians(40.0)  # [m], [rad]
ASSEMBLY_SECONDS = 0.2  # asked of the assembly of `bricard`
SEEDS = range(5)


@dataclass(frozen=True)
class Ride:
    """The monocycle under one scheme of the displacement solver, a step a frame."""

    scheme: int
    iterations: Counter[int]  # frames by number of iterations
    ms_per_frame: float  # median
    distance: float  # [m] that the body went
    status: str  # the worst of all steps

    def share_within(self, limit: int) -> float:
        """Part of the frames that took fewer than `limit` iterations."""
        return sum(n for k, n in self.iterations.items() if k < limit) / self.iterations.total()


def ride(scheme: int, seconds: float = SECONDS) -> Ride:
    """Step the monocycle at 60 frames a second with the displacement solver."""
    scene = REGISTRY["monocycle"](dt=FRAME, duration=seconds)
    scene.apply_set("solver=displacement")
    scene.apply_set(f"displacement.scheme={scheme}")
    scene.apply_set(f"displacement.tolerance={TOLERANCE!r}")
    scene.apply_set(f"displacement.max_iterations={MOST}")
    simulation = turnbuckle.Simulation(scene)
    start = simulation.pose("body")[0][2]
    times, states = [], {"ok"}
    counted: Counter[int] = Counter()
    for _ in range(round(seconds / FRAME)):
        before = time.perf_counter()
        report = simulation.step()
        times.append(1e3 * (time.perf_counter() - before))
        counted[report.iterations.get("displacement", 0)] += 1
        states.add(report.status)
        if report.status == "failed":
            break
    worst = max(states, key=["ok", "degraded", "failed"].index)
    return Ride(scheme, counted, statistics.median(times), float(simulation.pose("body")[0][2] - start), worst)


def rides_table(rides: list[Ride]) -> Table:
    """Iterations a frame of both schemes."""
    columns = ["scheme", "median", f"under {PAPER_ITERATIONS}", "90 %", "most", "ms a frame", "went [m]", "status"]
    table = Table(f"Monocycle, displacement solver: iterations to {TOLERANCE:g} m a frame of 1/60 s", columns)
    for one in rides:
        counts = sorted(one.iterations.elements())
        ninety = counts[int(0.9 * (len(counts) - 1))]
        share = f"{one.share_within(PAPER_ITERATIONS):.0%}"
        name = ("one (3.1.2)", "two (3.1.3)")[one.scheme - 1]
        middle = int(statistics.median_low(counts))
        table.add(name, middle, share, ninety, counts[-1], one.ms_per_frame, one.distance, one.status)
    table.notes.append(
        "A step a frame. The paper: scheme two, under six most of the time, with limit, masses and force unstated."
    )
    return table


def steps_a_second(seconds: float = 3.0) -> tuple[float, float, float, str]:
    """The default solver: median and best steps a second, worst residual of all joints [m], worst status."""
    simulation = turnbuckle.Simulation(REGISTRY["monocycle"]())
    for _ in range(20):
        simulation.step()
    times, worst, states = [], 0.0, {"ok"}
    start = time.perf_counter()
    while time.perf_counter() - start < seconds:
        before = time.perf_counter()
        report = simulation.step()
        times.append(time.perf_counter() - before)
        worst = max(worst, report.worst_residual)
        states.add(report.status)
    status = max(states, key=["ok", "degraded", "failed"].index)
    return 1.0 / statistics.median(times), 1.0 / min(times), worst, status


def assembly() -> list[tuple[int, float, float]]:
    """`bricard` thrown apart and assembled: seed, wall time [s], worst gap left [m or rad]."""
    found = []
    turnbuckle.assemble(REGISTRY["bricard"](throw=0.01))  # compiles
    for seed in SEEDS:
        scene = REGISTRY["bricard"](throw=THROW, angle=ANGLE, seed=seed)
        before = time.perf_counter()
        _, report = turnbuckle.assemble(scene)
        found.append((seed, time.perf_counter() - before, max(report.gap, report.angle)))
    return found


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Measure, print, write tables and plot."""
    console, busy = console or Console(), load()
    console.print("Riding the monocycle, then assembling; half a minute ...")
    rides = [ride(scheme) for scheme in (1, 2)]
    speed = Table("Default solver", ["what", "measured", "best", "asked", "worst residual", "status"])
    median, best, worst, status = steps_a_second()
    speed.add("monocycle, steps a second", median, best, STEPS_A_SECOND, worst, status)
    speed.notes.append("Steps of 1/240 s, the report of each step included.")
    built = Table("Assembly of bricard", ["seed", "seconds", "asked", "gap left [m, rad]"])
    for seed, seconds, gap in assembly():
        built.add(seed, seconds, ASSEMBLY_SECONDS, gap)
    built.notes.append("Parts thrown 20 cm and turned 40 degrees apart, each in a direction of its own.")
    tables = [rides_table(rides), speed, built]
    folder = publish("monocycle", tables, console, folder, busy)
    drawn = iterations_figure([(one.scheme, one.iterations) for one in rides], folder / "monocycle.png")
    console.print(drawn, highlight=False)
    return tables


if __name__ == "__main__":
    measure()
