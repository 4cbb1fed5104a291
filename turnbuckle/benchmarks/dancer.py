"""Contact, Figure 1: a six-layered dress on a dancer who turns and kicks; our steps in both moments, judged by ipctk.

`python -m turnbuckle.benchmarks.dancer --layers 2 --around 24 --rows 6`, or `turnbuckle bench dancer`.
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

PAPER_MS = 2700.0  # a step, on a processor of 2008
TARGET_MS = 700.0  # a step in the mean over the moments of turn and kick
MOMENT = 0.5  # [s]


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    layers: int = 6,
    around: int = 100,
    rows: int = 28,
    settle: float = 0.3,
    turn_at: float = 0.6,
    turn_time: float = 0.9,
    kick_at: float = 1.8,
    kick_time: float = 0.7,
    seconds: float = 0.0,
    every: int = 10,
    peers: bool = False,
    iterations: int = 10,
    peer_wall: float = 300.0,
) -> list[Table]:
    """Measure, print, write tables and plot. ``seconds`` ends the run; 0: when the kick has been made.

    The moments are half a second in the middle of the turn, and of the kick. The peer, where it is asked for, is Newton's
    VBD from the start for as much of the scene as it does in ``peer_wall`` [s].
    """
    console, busy = console or Console(), load()
    console.print("Dancing until the kick has been made; many minutes at full size ...")
    parameters = {"layers": layers, "around": around, "rows": rows, "settle": settle, "turn_at": turn_at}
    parameters |= {"turn_time": turn_time, "kick_at": kick_at, "kick_time": kick_time}
    turn, kick = settle + turn_at + 0.5 * turn_time, settle + kick_at + 0.5 * kick_time
    half_turn, half_kick = 0.5 * min(MOMENT, turn_time), 0.5 * min(MOMENT, kick_time)
    end = seconds if seconds > 0.0 else kick + half_kick
    run = follow(REGISTRY["dancer"](**parameters), end, every)
    moments = {"turn": (turn - half_turn, turn + half_turn), "kick": (kick - half_kick, kick + half_kick)}
    windows = {"all": (0.0, end)} | {name: ends for name, ends in moments.items() if ends[0] < end}
    full = layers * around * rows >= 16_800
    aims = {name: TARGET_MS for name in moments if name in windows} if full else None
    tables = [steps_table("Dancer", run, windows, aims), stages_table(run, windows)]
    tables[0].notes.append(f"The paper: {PAPER_MS:g} ms a step.")
    answers = []
    if peers:
        task = ContactTask("dancer", parameters, end, every, peer_wall, {"iterations": iterations})
        answers.append(run_peer("newton vbd", "newton", "newton_cloth", task))
        tables.append(peers_table("Dancer: other libraries", run, answers))
    folder = publish("dancer", tables, console, folder, busy)
    console.print(steps_figure(run, answers, "Dancer", folder / "dancer.png"), highlight=False)
    return tables


if __name__ == "__main__":
    run_as_command(measure)
