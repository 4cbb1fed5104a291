"""The histogram of the monocycle: frames by the iterations that they took."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from turnbuckle.benchmarks.plot import COLOR

NAMES = {1: "scheme one (3.1.2)", 2: "scheme two (3.1.3)"}
COLORS = {1: COLOR["newton vbd"], 2: COLOR["turnbuckle"]}
SHOWN = 40  # iterations; more are counted at the right end


def iterations_figure(rides: Sequence[tuple[int, Mapping[int, int]]], file: Path) -> str:
    """Histograms of schemes (number, frames by iterations) into `file` (.png); returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return "No plot: pip install matplotlib"
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.6 * len(rides)), dpi=150, layout="constrained")
    rows = figure.subplots(len(rides), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (scheme, counted) in zip(rows, rides, strict=True):
        frames = [0] * (SHOWN + 1)
        for iterations, count in counted.items():
            frames[min(iterations, SHOWN)] += count
        share = [count / sum(counted.values()) for count in frames]
        axes.bar(range(SHOWN + 1), share, width=0.9, color=COLORS.get(scheme, COLOR["paper"]))
        if scheme == 2:  # the scheme of which section 3.1.3 says so
            axes.axvline(5.5, color=COLOR["paper"], linewidth=1.0, linestyle="--")
            note = {"color": COLOR["paper"], "fontsize": 8}
            axes.annotate("the paper: under six most of the time", (5.7, 0.9 * max(share)), **note)
        axes.set_title(NAMES.get(scheme, str(scheme)), loc="left", fontsize=10)
        axes.set_ylabel("part of frames")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        axes.spines[["top", "right"]].set_visible(False)
    ticks = range(0, SHOWN + 1, 5)
    rows[-1].set_xticks(ticks, [f"{k}" if k < SHOWN else f"{k}+" for k in ticks])
    rows[-1].set_xlabel("iterations a frame of 1/60 s")
    figure.savefig(file)
    return f"Plot: {file}"
