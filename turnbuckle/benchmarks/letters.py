"""Contact, Figure 7: rubber letters fall in layers, then walls press them; our steps beside Newton's VBD, judged by ipctk.

`python -m turnbuckle.benchmarks.letters --count 8 --across 2`, or `turnbuckle bench letters`. The whole of the scene, 40 s:
`turnbuckle bench letters --settling 18 --pressing 20 --no-peers`, a quarter of an hour.
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

PAPER_MS = 4000.0  # a step, on a processor of 2008
TARGET_MS = 450.0  # a step in the mean over falling and pressing
COUNT = 164


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    count: int = COUNT,
    across: int = 4,
    falling: float = 2.0,
    settling: float = 0.0,
    pressing: float = 2.0,
    press_time: float = 6.0,
    every: int = 5,
    peers: bool = True,
    iterations: int = 10,
    gap: float = 12.0,
    substeps: int = 4,
    stiffness: float = 1e5,
    peer_wall: float = 500.0,
) -> list[Table]:
    """Measure, print, write tables and plot.

    Letters fall for ``falling`` [s], rest for ``settling``, then walls push in as fast as the scene's for ``pressing``
    (`press_time` [s] is their whole way). Newton's contact is a penalty of ``stiffness`` [N/m]: 1e5 crosses least, 1e3, its
    examples' own, far more. ``gap`` widens Newton's search (times our contact
    distance): with less it holds back what falls. ``peer_wall`` [s] ends the peer early.
    """
    console, busy = console or Console(), load()
    console.print(f"Dropping {count} letters and pressing them, then Newton's beside them; minutes ...")
    press_at = falling + settling
    seconds = press_at + pressing
    parameters = {"count": count, "across": across, "press_at": press_at, "press_time": press_time}
    run = follow(REGISTRY["letters"](**parameters), seconds, every)
    windows = {"all": (0.0, seconds), "falling": (0.0, falling), "pressing": (press_at, seconds)}
    if settling > 0.0:
        windows["settling"] = (falling, press_at)
    full = count >= COUNT and falling == pressing == 2.0 and settling == 0.0
    aims = {"all": TARGET_MS} if full else None
    tables = [steps_table(f"{count} letters", run, windows, aims), stages_table(run, windows)]
    tables[0].notes.append(f"The paper: {PAPER_MS:g} ms a step.")
    answers = []
    if peers:
        own = {"iterations": iterations, "gap": gap, "substeps": substeps, "stiffness": stiffness, "damping": 1e-3}
        task = ContactTask("letters", parameters, seconds, every, peer_wall, own)
        answers.append(run_peer("newton vbd", "newton", "newton_solids", task))
        tables.append(peers_table("Letters: other libraries", run, answers))
    name = "letters_whole" if settling > 0.0 else "letters"
    folder = publish(name, tables, console, folder, busy)
    console.print(steps_figure(run, answers, f"{count} letters", folder / f"{name}.png"), highlight=False)
    return tables


if __name__ == "__main__":
    run_as_command(measure)
