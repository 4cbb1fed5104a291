"""Contact, Figure 5: a cloth falls on its edge and folds; our steps beside Newton's VBD, both judged by ipctk.

`python -m turnbuckle.benchmarks.falling_cloth --seconds 0.5`, or `turnbuckle bench falling_cloth`.
"""

from pathlib import Path

from rich.console import Console

from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.contact_plot import steps_figure
from turnbuckle.benchmarks.contact_protocol import ContactTask, run_peer
from turnbuckle.benchmarks.contact_run import follow
from turnbuckle.benchmarks.contact_tables import peers_table, stages_table, steps_table
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.scenes import REGISTRY

PAPER_MS = 480.0  # a step, on a processor of 2008
TARGET_MS, TARGET_RATIO = 40.0, 5.0  # a step in the mean; times Newton's


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    seconds: float = 4.0,
    cells: int = 49,
    mu: float = 0.3,
    every: int = 10,
    peers: bool = True,
    iterations: int = 10,
    gap: float = 6.0,
    peer_wall: float = 400.0,
) -> list[Table]:
    """Measure, print, write tables and plot. ``gap`` widens Newton's search (times our contact
    distance): with less it holds back what falls. ``peer_wall`` [s] ends the peer early; ``iterations`` are Newton's VBD's."""
    console, busy = console or Console(), load()
    console.print(f"Dropping a cloth for {seconds:g} s, then Newton's beside it; two to six minutes for 4 s ...")
    parameters = {"cells": cells, "mu": mu}
    run = follow(REGISTRY["falling_cloth"](**parameters), seconds, every)
    windows = {"all": (0.0, seconds)}
    if seconds >= 2.0:
        windows |= {"first second": (0.0, 1.0), "last second": (seconds - 1.0, seconds)}
    full = cells >= 49 and seconds >= 4.0  # the run that the aims are for
    aims = {"all": TARGET_MS} if full else None
    tables = [steps_table(f"Falling cloth, {seconds:g} s", run, windows, aims), stages_table(run, windows)]
    tables[0].notes.append(f"The paper: {PAPER_MS:g} ms a step.")
    answers = []
    if peers:
        task = ContactTask(
            "falling_cloth", parameters, seconds, every, peer_wall, {"iterations": iterations, "gap": gap}
        )
        answers.append(run_peer("newton vbd", "newton", "newton_cloth", task))
        tables.append(peers_table("Falling cloth: other libraries", run, answers))
        ratios = [row[3] for row in tables[-1].rows[1:] if row[3] is not None]
        if ratios and full:
            verdict = "met" if min(ratios) >= TARGET_RATIO else "missed"
            tables[-1].notes.append(f"Aim: at least {TARGET_RATIO:g} times faster than Newton's VBD: {verdict}.")
    folder = publish("falling_cloth", tables, console, folder, busy)
    console.print(steps_figure(run, answers, "Falling cloth", folder / "falling_cloth.png"), highlight=False)
    return tables


if __name__ == "__main__":
    run_as_command(measure)
