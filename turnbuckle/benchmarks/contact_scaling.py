"""Contact, Figure 6: time of a whole step against contacts, by solver (left, frictionless) and by mesh (right).

`python -m turnbuckle.benchmarks.contact_scaling --counts 4 8 --seconds 1.2`, or `turnbuckle bench contact_scaling`.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console

import turnbuckle
from turnbuckle.benchmarks.contact_figures import scaling_figure
from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.contact_solvers import METHODS, PaperSolver, plugged
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.scenes import REGISTRY
from turnbuckle.step.snapshot import Snapshot

WINDOW = 0.6  # [s], as in the paper: each point is a mean over so much of the scene
LEAST = 20.0  # contacts of a window that a slope counts


@dataclass
class Series:
    """Windows of a method or of a mesh: contacts and times of a whole step in the mean."""

    name: str
    contacts: list[float] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)

    def slope(self) -> float | None:
        """Exponent p of ms ~ contacts^p over the windows that have contacts enough; 1 is linear."""
        n, t = np.array(self.contacts), np.array(self.ms)
        enough = n >= LEAST
        if enough.sum() < 3 or np.ptp(np.log(n[enough])) < np.log(4.0):  # too narrow to tell
            return None
        return float(np.polyfit(np.log(n[enough]), np.log(t[enough]), 1)[0])


def compare(count: int, across: int, seconds: float, every: int, limit: int, series: dict[str, Series]) -> list[str]:
    """Drop ``count`` letters without friction; each ``every``-th step is made by every method from the same state.

    Ours goes on. Full anticipation stands back above ``limit`` contacts. Adds a point a window; returns notes.
    """
    simulation = turnbuckle.Simulation(REGISTRY["letters"](count=count, across=across, mu=0.0, press=0.0))
    stepper, state = simulation.stepper, simulation.state
    solvers = {method: plugged(simulation, method) for method in METHODS}
    window: dict[str, list[tuple[int, float]]] = {method: [] for method in METHODS}
    steps, a_window = round(seconds / simulation.dt), round(WINDOW / simulation.dt)
    for number in range(1, steps + 1):
        if number > 2 and number % every == 0:  # the first steps compile
            start, contacts = Snapshot(state), 0
            for method, solver in solvers.items():
                if method == "anticipation" and contacts > limit:
                    continue
                stepper.solver = solver
                before = time.perf_counter()
                report = simulation.step()
                spent = 1e3 * (time.perf_counter() - before)
                contacts = max(contacts, report.contacts)
                if report.status != "failed" and report.contacts:
                    window[method].append((report.contacts, spent))
                start.restore(state)
            stepper.solver = solvers["newton"]
        simulation.step()
        if number % a_window == 0 or number == steps:
            for method, points in window.items():
                if points:
                    n, ms = np.mean(points, axis=0)
                    series[method].contacts.append(float(n))
                    series[method].ms.append(float(ms))
                points.clear()
    missed = {m: s.missed for m, s in solvers.items() if isinstance(s, PaperSolver) and s.missed}
    return [f"{count} letters: {m} did not converge in {n} solves; ours finished those." for m, n in missed.items()]


def resolution(tetrahedra: int, counts: Sequence[int], across: int, mu: float, seconds: float, method: str) -> Series:
    """Piles of ``counts`` letters of that many tetrahedra each, dropped; every step by one method."""
    out = Series("")
    for count in counts:
        scene = REGISTRY["letters"](count=count, across=across, mu=mu, press=0.0, tetrahedra=tetrahedra)
        simulation = turnbuckle.Simulation(scene)
        simulation.stepper.solver = plugged(simulation, method)
        out.name = f"{len(simulation.model.corotational.corners) / count:.0f} tetrahedra a letter"
        steps, a_window = round(seconds / simulation.dt), round(WINDOW / simulation.dt)
        points: list[tuple[int, float]] = []
        for number in range(1, steps + 1):
            before = time.perf_counter()
            report = simulation.step()
            if number > 2 and report.contacts:
                points.append((report.contacts, 1e3 * (time.perf_counter() - before)))
            if points and (number % a_window == 0 or number == steps):
                n, ms = np.mean(points, axis=0)
                out.contacts.append(float(n))
                out.ms.append(float(ms))
                points.clear()
    return out


def table_of(title: str, what: str, series: Sequence[Series]) -> Table:
    """A row a window, and the exponents."""
    table = Table(title, [what, "contacts", "ms a step", "us a contact"])
    for one in series:
        for n, ms in sorted(zip(one.contacts, one.ms, strict=True)):
            table.add(one.name, n, ms, 1e3 * ms / n if n else None)
    for one in series:
        slope = one.slope()
        if slope is not None:
            table.notes.append(
                f"{one.name}: time ~ contacts^{slope:.2f} (1: linear; windows of {LEAST:g} contacts or more)."
            )
    table.notes.append(f"Whole steps of 30 ms, means over {WINDOW:g} s of the scene.")
    return table


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    counts: tuple[int, ...] = (8, 16, 32, 64, 128),
    across: int = 4,
    seconds: float = 1.8,
    every: int = 5,
    limit: int = 600,
    resolutions: tuple[int, ...] = (70, 140, 280, 560),
    resolution_counts: tuple[int, ...] = (4, 16, 64),
    mu: float = 0.4,
    method: str = "newton",
) -> list[Table]:
    """Measure, print, write tables and plot.

    Left: piles of ``counts`` letters, frictionless; full anticipation where a step has at most ``limit`` contacts. Right:
    piles of ``resolution_counts`` letters of about ``resolutions`` tetrahedra each, friction ``mu``, solved by ``method`` ("ica" is
    the paper's). ``counts 0`` or ``resolutions 0`` leaves a side out.
    """
    console, busy = console or Console(), load()
    console.print("Piles of letters by three solvers, then by meshes of four sizes; many minutes at full size ...")
    series = {name: Series(name) for name in METHODS}
    notes = [n for count in counts if count > 0 for n in compare(count, across, seconds, every, limit, series)]
    left = table_of("Figure 6, left: solvers, without friction", "solver", list(series.values()))
    left.notes.append(
        "The same states for all: sampled steps are made by each. ica and anticipation stop by the paper's rule (5.5), newton "
        "(ours) at its own, stricter tolerance."
    )
    left.notes += notes
    meshes = [resolution(size, resolution_counts, across, mu, seconds, method) for size in resolutions if size > 0]
    right = table_of(f"Figure 6, right: letters by mesh, {method}", "mesh", meshes)
    folder = publish("contact_scaling", [left, right], console, folder, busy)
    drawn = scaling_figure(list(series.values()), meshes, method, folder / "contact_scaling.png")
    console.print(drawn, highlight=False)
    return [left, right]


if __name__ == "__main__":
    run_as_command(measure)
