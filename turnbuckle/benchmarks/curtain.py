"""Local, Figures 1 and 2: a whole step of the curtain, beside the paper and other libraries.

`python -m turnbuckle.benchmarks.curtain`, or `turnbuckle bench curtain`.
"""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.own import DT, OwnResult, measure_curtain
from turnbuckle.benchmarks.peers.launch import curtain_peers
from turnbuckle.benchmarks.peers.protocol import PeerResult
from turnbuckle.benchmarks.plot import figure_two
from turnbuckle.benchmarks.table import Table, publish

SIZES = (40, 150, 500)
PAPER_M = 150
PAPER_MS = {40: 12.0, 150: 46.15}  # [ms] a step on a Pentium 4 of 3.4 GHz: Figure 1; section 5


def own_table(results: Sequence[OwnResult], sizes: Sequence[int]) -> Table:
    """Our steps, with the paper's where it gives one."""
    columns = ["cubes", "tets", "joined", "ms a step", "forces", "constr.", "gap [m]", "/ size"]
    table = Table("Curtain: a whole step (three damped energies, constraints, Verlet, report)", [*columns, "paper"])
    for m, own in zip(sizes, results, strict=True):
        stages = [own.stages_ms.get(stage) for stage in ("forces", "constraints")]
        counts = [own.cubes, own.tets, own.constraints]
        table.add(*counts, own.ms_per_step, *stages, own.gap, own.relative_gap, PAPER_MS.get(m))
        if own.status != "ok":
            table.notes.append(f"m = {m}: a step was {own.status}")
    table.notes.append(f"Steps of {1e3 * DT:g} ms; times in ms; paper: a Pentium 4 of 3.4 GHz, 2006.")
    table.notes.append("Joined: nails and points to point. Gap: the worst of them all, from the positions alone.")
    return table


def peers_table(own: OwnResult, answers: Sequence[PeerResult | str]) -> Table:
    """Other libraries on the same geometry, masses and step, on this machine, in this run."""
    columns = ["library", "ms a step", "/ ours", "gap [m]", "sank [m]", "steps", "iterations"]
    table = Table(f"Curtain of {own.cubes} cubes, {own.constraints} constraints: other libraries", columns)
    table.add("turnbuckle", own.ms_per_step, 1.0, own.gap, own.dropped, own.steps, 1)
    for answer in answers:
        if isinstance(answer, str):
            table.notes.append(answer)
            continue
        ratio = answer.ms_per_step / own.ms_per_step
        cells = [answer.ms_per_step, ratio, answer.gap, answer.dropped, answer.steps, answer.iterations]
        table.add(f"{answer.name} {answer.version}", *cells)
        table.notes.append(f"{answer.name}: {answer.how}.")
    table.notes.append("Elements differ (each library's own), so how far they sink does too: it shows that they move.")
    return table


def curtain(peers: bool = True, sizes: Sequence[int] = SIZES) -> tuple[list[Table], list[OwnResult], list]:
    """Tables, our results by size, and the peers' answers for m = 150."""
    results = [measure_curtain(m) for m in sizes]
    tables = [own_table(results, sizes)]
    answers: list[PeerResult | str] = []
    if peers and PAPER_M in sizes:
        answers = list(curtain_peers(PAPER_M, DT))
        tables.append(peers_table(results[list(sizes).index(PAPER_M)], answers))
    return tables, results, answers


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Measure, print, write tables and plot."""
    console, busy = console or Console(), load()
    console.print("Measuring the curtain, then the libraries beside it; two to four minutes ...")
    tables, results, answers = curtain()
    folder = publish("curtain", tables, console, folder, busy)
    ours = [(own.constraints, own.ms_per_step) for own in results]
    paper = [(own.constraints, PAPER_MS[m]) for m, own in zip(SIZES, results, strict=True) if m in PAPER_MS]
    gap = max(own.gap for own in results)
    drawn = figure_two(ours, gap, paper, [a for a in answers if not isinstance(a, str)], folder / "curtain.png")
    console.print(drawn, highlight=False)
    return tables


if __name__ == "__main__":
    measure()
