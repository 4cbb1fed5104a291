"""Contact, section 6 and 5.4: rounds of constraint manifold refinement a step, and sweeps an inner loop of `ica`.

`python -m turnbuckle.benchmarks.contact_histograms --letters 4 --seconds 0.6`, or `turnbuckle bench contact_histograms`.
"""

from collections import Counter
from pathlib import Path

from rich.console import Console

import turnbuckle
from turnbuckle.benchmarks.contact_figures import histograms_figure
from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.contact_solvers import PaperSolver, plugged
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.scenes import REGISTRY

ROUNDS, INNER, SHARE = 3, 9, 0.9  # the paper: three rounds or fewer, under ten sweeps, in 90 % of the cases
SHOWN = 20  # the largest value with a bar of its own


class Histograms:
    """What was counted over the steps of one scene with one solver."""

    def __init__(self, scene: str, solver: str) -> None:
        self.scene, self.solver = scene, solver
        self.rounds: Counter[int] = Counter()
        self.inner: Counter[int] = Counter()
        self.outer: Counter[int] = Counter()
        self.steps = self.halvings = self.missed = 0
        self.failed = ""


def count(scene: turnbuckle.Scene, solver: str, seconds: float) -> Histograms:
    """Step ``scene`` with our solver ("newton") or with `ica` under the paper's stopping rule.

    Steps without contacts count in neither histogram.
    """
    simulation = turnbuckle.Simulation(scene)
    out = Histograms(scene.definition.name, solver)
    plug = plugged(simulation, solver)
    simulation.stepper.solver = plug
    for _ in range(round(seconds / simulation.dt)):
        report = simulation.step()
        if report.status == "failed":
            out.failed = f"{out.scene}, {solver}: failed at {report.time:.3g} s: {report.messages[0]}"
            break
        out.steps += 1
        out.halvings += report.halvings
        if report.contacts:
            out.rounds[report.rounds] += 1
    if isinstance(plug, PaperSolver):
        out.inner.update(plug.inner)
        out.outer.update(plug.outer)
        out.missed = plug.missed
    return out


def share(counts: Counter[int], bound: int) -> float | None:
    """Part of the counts at most ``bound``; None where there are none."""
    return sum(n for value, n in counts.items() if value <= bound) / counts.total() if counts else None


def table_of(found: list[Histograms]) -> Table:
    """A row a scene and solver."""
    columns = [
        "scene",
        "solver",
        "steps",
        f"rounds <= {ROUNDS}",
        "most",
        "halvings",
        "inner loops",
        f"sweeps <= {INNER}",
    ]
    table = Table("Histograms: rounds a step, sweeps an inner loop", [*columns, "outer, median", "missed"])
    for one in found:
        parts = [share(one.rounds, ROUNDS), share(one.inner, INNER)]
        rounds, inner = ("-" if part is None else f"{part:.1%}" for part in parts)
        outer = sorted(one.outer.elements())
        cells = [one.steps, rounds, max(one.rounds, default=0), one.halvings, one.inner.total(), inner]
        table.add(one.scene, one.solver, *cells, outer[len(outer) // 2] if outer else None, one.missed)
        for name, part in (("rounds", parts[0]), ("sweeps", parts[1])):
            if part is not None:
                verdict = "as the paper says" if part > SHARE else "less than the paper's 90 %"
                table.notes.append(f"{one.scene}, {one.solver}, {name}: {part:.1%}, {verdict}.")
        if one.failed:
            table.notes.append(one.failed)
    table.notes.append(
        "ica: warm-started, with the paper's stopping rule (5.5), at most 20 sweeps an inner loop. Missed: solves that it "
        "gave up, which ours finished."
    )
    return table


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    letters: int = 48,
    across: int = 4,
    seconds: float = 3.0,
    cells: int = 49,
    cloth_seconds: float = 2.0,
) -> list[Table]:
    """Measure, print, write tables and plot. ``letters 0`` or ``cells 0`` leaves a scene out."""
    console, busy = console or Console(), load()
    console.print("Counting rounds and sweeps; many minutes at full size ...")
    found = []
    for solver in ("newton", "ica"):
        if letters > 0:
            found.append(count(REGISTRY["letters"](count=letters, across=across), solver, seconds))
        if cells > 0:
            found.append(count(REGISTRY["falling_cloth"](cells=cells), solver, cloth_seconds))
    table = table_of(found)
    folder = publish("contact_histograms", [table], console, folder, busy)
    shown = []
    for one in found:
        title = f"{one.scene}, {one.solver}"
        shown.append((title, "rounds of refinement a step", one.rounds, ROUNDS, "in three or fewer"))
        if one.inner:
            shown.append((title, "sweeps an inner loop", one.inner, INNER, "in under ten"))
    console.print(histograms_figure(shown, SHOWN, folder / "contact_histograms.png"), highlight=False)
    return [table]


if __name__ == "__main__":
    run_as_command(measure)
