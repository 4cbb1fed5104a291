"""A closed chain of boxes on ball joints: time a step and how far the joints open, beside other libraries.

`python -m turnbuckle.benchmarks.chain`, or `turnbuckle bench chain`.
"""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from scipy.spatial.transform import Rotation

import turnbuckle
from turnbuckle.benchmarks.chain_plot import chain_figure
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.peers.chain_protocol import (
    DT,
    LENGTH,
    MASS,
    SPAN,
    THICKNESS,
    TILT,
    WARM_UP,
    ChainResult,
    ChainTask,
    worst_gap,
)
from turnbuckle.benchmarks.peers.launch import chain_peers
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.benchmarks.timing import line_fit
from turnbuckle.scenes import REGISTRY

SIZES = (100, 400, 1000, 10000)
PEER_SIZES = {"mujoco connect": (100, 400), "mujoco tree": (100,), "newton xpbd": (100,)}
TARGET_MS, TARGET_GAP = 1.0, 1e-10  # [ms], [m] at n = 100


@dataclass(frozen=True)
class OwnChain:
    """What was measured on our chain of n boxes."""

    n: int
    steps: int
    build_s: float  # scene to model and state
    first_step_s: float  # compiling and recording included
    ms_per_step: float  # median, the report of each step included
    stages_ms: dict[str, float]  # medians
    gap: float  # [m], worst opening of a joint, measured from the poses alone
    moved: float  # [m]
    status: str  # the worst of all steps


def poses(simulation: turnbuckle.Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) [m] and orientations (n, 4) xyzw of all boxes, in their own frames."""
    bodies, state = simulation.model.rigid, simulation.state.rigid
    turn = Rotation.from_quat(state.q.numpy()[1:])
    x = state.x.numpy()[1:] + turn.apply(bodies.frame_x[1:])
    return x, (turn * Rotation.from_quat(bodies.frame_q[1:])).as_quat()


def measure_chain(n: int, seconds: float = 3.0, least: int = 20, most: int = 480) -> OwnChain:
    """Build and step `closed_chain(n)` for about `seconds` of wall time, between `least` and `most` steps."""
    options = {"length": LENGTH, "thickness": THICKNESS, "mass": MASS, "span": SPAN, "tilt": TILT}
    scene = REGISTRY["closed_chain"](n=n, dt=DT, **options)
    ends, _ = ChainTask(n, 0, 0.0).start()
    started = 0.5 * (ends[1:] + ends[:-1])
    before = time.perf_counter()
    simulation = turnbuckle.Simulation(scene)
    built = time.perf_counter()
    report = simulation.step()
    first = time.perf_counter()
    for _ in range(WARM_UP):
        simulation.step()

    times: list[float] = []
    stages: dict[str, list[float]] = {}
    states = {report.status}
    gap = moved = 0.0
    start = time.perf_counter()
    while len(times) < least or (time.perf_counter() - start < seconds and len(times) < most):
        began = time.perf_counter()
        report = simulation.step()
        times.append(1e3 * (time.perf_counter() - began))
        for stage, spent in report.seconds.items():
            stages.setdefault(stage, []).append(1e3 * spent)
        states.add(report.status)
        x, q = poses(simulation)
        gap = max(gap, worst_gap(x, q, ends[0], ends[-1]))
        moved = max(moved, float(np.linalg.norm(x - started, axis=1).max()))
    return OwnChain(
        n=n,
        steps=len(times),
        build_s=built - before,
        first_step_s=first - built,
        ms_per_step=statistics.median(times),
        stages_ms={stage: statistics.median(spent) for stage, spent in stages.items()},
        gap=gap,
        moved=moved,
        status=max(states, key=["ok", "degraded", "failed"].index),
    )


def chain_table(results: Sequence[OwnChain], answers: Sequence[ChainResult | str]) -> Table:
    """Ours and the peers': time and gap in one table."""
    columns = [
        "library",
        "boxes",
        "ms a step",
        "us a box",
        "/ ours",
        "worst gap [m]",
        "moved [m]",
        "steps",
        "build() [s]",
    ]
    table = Table("Closed chain on ball joints: time and gap", columns)
    ours = {own.n: own for own in results}
    for own in results:
        cells = [own.ms_per_step, 1e3 * own.ms_per_step / own.n, 1.0, own.gap, own.moved, own.steps, own.build_s]
        table.add("turnbuckle", own.n, *cells)
        if own.status != "ok":
            table.notes.append(f"n = {own.n}: a step was {own.status}")
    for answer in answers:
        if isinstance(answer, str):
            table.notes.append(answer)
            continue
        ratio = answer.ms_per_step / ours[answer.n].ms_per_step if answer.n in ours else None
        each = 1e3 * answer.ms_per_step / answer.n
        cells = [answer.ms_per_step, each, ratio, answer.gap, answer.moved, answer.steps, None]
        table.add(f"{answer.name} {answer.version}", answer.n, *cells)
        note = f"{answer.name}: {answer.how}."
        if note not in table.notes:
            table.notes.append(note)
    table.notes.append(f"Steps of {1e3 * DT:.3g} ms, the same boxes and start for all; gaps from the poses alone.")
    if len(results) > 2:
        n, ms = np.array([[own.n, own.ms_per_step] for own in results]).T
        a, b, misfit = line_fit(n, ms)
        off = ", ".join(f"{m:+.0%}" for m in misfit)
        table.notes.append(f"Ours: {a:.3g} ms + {1e3 * b:.3g} us a box; off that line: {off}.")
    if 100 in ours:
        own = ours[100]
        verdict = "met" if own.ms_per_step <= TARGET_MS and own.gap <= TARGET_GAP else "missed"
        table.notes.append(f"Aim at 100 boxes: {TARGET_MS:g} ms, every joint within {TARGET_GAP:g} m: {verdict}.")
    return table


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Measure, print, write the table and the plot."""
    console, busy = console or Console(), load()
    console.print("Measuring chains of 100 to 10,000 boxes, then the libraries beside them; one to two minutes ...")
    results = [measure_chain(n) for n in SIZES]
    answers = list(chain_peers(PEER_SIZES))
    table = chain_table(results, answers)
    folder = publish("chain", [table], console, folder, busy)
    peers = [answer for answer in answers if not isinstance(answer, str)]
    ours = [(own.n, own.ms_per_step, own.gap) for own in results]
    drawn = chain_figure(ours, [(p.name, p.n, p.ms_per_step, p.gap) for p in peers], folder / "chain.png")
    console.print(drawn, highlight=False)
    return [table]


if __name__ == "__main__":
    measure()
