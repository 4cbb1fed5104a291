"""Every scene with contact at three step sizes over a window of its time: status, intersections, halvings, last resorts.

`python -m turnbuckle.benchmarks.contact_windows --scene letters`, or `turnbuckle bench contact_windows`. Small versions of
the scenes; all have the same defaults of contact. A row passes if every step is ok, no judged state intersects (ipctk),
halvings and last resorts are in less than 1 % of the steps, and what can move has moved.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.contact_run import ContactRun, follow
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.data.errors import InputError
from turnbuckle.scenes import REGISTRY

RARE = 0.01  # of the steps, in which a halving or a last resort is allowed
MOVED = 1e-3  # [m] in the mean, by which points must have moved


@dataclass(frozen=True)
class Window:
    """A small version of a scene, and what is run of it."""

    parameters: dict[str, Any]
    steps: tuple[float, float, float]  # [s]
    seconds: float


DANCE = {"settle": 0.1, "turn_at": 0.1, "turn_time": 0.9, "kick_at": 1.05, "kick_time": 0.5}
WINDOWS = {
    "falling_cloth": Window({"cells": 20}, (8e-3, 4e-3, 2e-3), 1.2),
    "letters": Window({"count": 12, "across": 2, "press_at": 1.2, "press_time": 2.0}, (0.04, 0.03, 0.015), 3.0),
    "mixed_stack": Window({"storeys": 1, "cloth_cells": 12}, (0.01, 5e-3, 2.5e-3), 1.0),
    "dancer": Window({"layers": 2, "around": 40, "rows": 10, **DANCE}, (4e-3, 2e-3, 1e-3), 1.6),
    "local_global": Window({}, (0.03, 0.01, 2.5e-3), 1.0),
    "hung_and_hit": Window({"cells": 12}, (0.01, 5e-3, 2.5e-3), 1.2),
    "monocycle": Window({"contact": True}, (1 / 60, 1 / 120, 1 / 240), 1.0),
    "otary": Window({"contact": True, "soft": False}, (1 / 120, 1 / 240, 1 / 480), 0.4),
}


def run(name: str, dt: float, seconds: float | None = None, every: int = 5, wall: float = np.inf) -> ContactRun:
    """One window of one scene; states are judged by ipctk every ``every`` steps."""
    window = WINDOWS[name]
    scene = REGISTRY[name](**window.parameters, dt=dt)
    return follow(scene, window.seconds if seconds is None else seconds, every, wall=wall)


def faults(done: ContactRun) -> list[str]:
    """What a run does not fulfil, in words."""
    out, steps = [], len(done.status)
    bad = [status for status in done.status if status != "ok"]
    if bad:
        out.append(f"{len(bad)} steps {'failed' if 'failed' in bad else 'degraded'}: {done.messages[:1]}")
    if done.crossing:
        out.append(f"{done.crossing} of {done.judged} judged states intersect")
    for name in ("halvings", "last_resorts"):
        count = int((np.array(getattr(done, name)) > 0).sum())
        if count >= max(RARE * steps, 1.0):
            out.append(f"{name.replace('_', ' ')} in {count} of {steps} steps")
    if not done.went > MOVED:  # NaN too
        out.append(f"points moved by {done.went:.1e} m in the mean")
    return out


def row(done: ContactRun) -> list[Any]:
    """Of the table."""
    resorts, halved = (int((np.array(v) > 0).sum()) for v in (done.last_resorts, done.halvings))
    return [
        done.name, 1e3 * done.dt, len(done.status), sum(status == "ok" for status in done.status), done.crossing,
        done.judged, halved, resorts, max(done.rounds), max(done.contacts), float(np.mean(done.ms[1:])),
        "; ".join(faults(done)) or "yes",
    ]  # fmt: skip


COLUMNS = [
    "scene", "dt, ms", "steps", "ok", "intersecting", "judged", "halved", "last resorts", "rounds", "contacts",
    "mean ms", "passes",
]  # fmt: skip


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    scene: str = "all",
    every: int = 5,
    wall: float = 1e9,
) -> list[Table]:
    """Run all, or one ``scene``, at three step sizes each; ``wall`` [s] of ours at most for each run."""
    console, busy = console or Console(), load()
    if scene != "all" and scene not in WINDOWS:
        raise InputError(f"contact_windows: there is no window for {scene!r}; give one of {', '.join(WINDOWS)}")
    table = Table("Scenes with contact at three step sizes", COLUMNS)
    table.notes.append("Halved, last resorts: steps with any; rounds, contacts: the most in a step.")
    for name in WINDOWS if scene == "all" else [scene]:
        for dt in WINDOWS[name].steps:
            done = run(name, dt, every=every, wall=wall)
            table.add(*row(done))
            console.print("  ".join(f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in table.rows[-1]))
    publish("contact_windows" if scene == "all" else f"contact_windows_{scene}", [table], console, folder, busy)
    return [table]


if __name__ == "__main__":
    run_as_command(measure)
