"""The plots of the benchmarks of contact that show steps over the time of the scene."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.benchmarks.contact_protocol import ContactResult
from turnbuckle.benchmarks.contact_run import ContactRun
from turnbuckle.benchmarks.plot import COLOR, OTHER

NO_PLOT = "No plot: pip install matplotlib"
CONTACTS = "#8a5fd0"


def tidy(axes: Any) -> None:
    """The looks that all plots share."""
    axes.grid(True, which="major", color="#e4e3df", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def steps_figure(run: ContactRun, answers: Sequence[ContactResult | str], title: str, file: Path) -> str:
    """Time of each step and contacts over the simulated time, into ``file`` (.png); returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return NO_PLOT
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.6), dpi=150, layout="constrained")
    times, counts = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    t, ms = np.array(run.time)[1:], np.array(run.ms)[1:]
    times.plot(t, ms, color=COLOR["turnbuckle"], linewidth=0.9, label=f"turnbuckle, mean {ms.mean():.3g} ms")
    for answer in answers:
        if isinstance(answer, str) or not answer.ms:
            continue
        theirs = np.array(answer.ms)
        label = f"{answer.name}, mean {theirs.mean():.3g} ms, {answer.crossing} of {answer.judged} states intersect"
        color = COLOR.get(answer.name, OTHER)
        times.plot(answer.dt * np.arange(2, len(theirs) + 2), theirs, color=color, linewidth=0.9, label=label)
    times.set_yscale("log")
    times.yaxis.set_major_formatter("{x:g}")
    times.set_ylabel("time per step [ms]")
    times.set_title(title, loc="left")
    times.legend(frameon=False, fontsize=9)
    counts.plot(t, np.array(run.contacts)[1:], color=CONTACTS, linewidth=0.9)
    counts.set_ylabel("contacts, ours")
    counts.set_xlabel("time of the scene [s]")
    for axes in (times, counts):
        tidy(axes)
    figure.savefig(file)
    return f"Plot: {file}"
