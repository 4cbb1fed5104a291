"""Contact, Figure 6 and the histograms of section 6, drawn."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from turnbuckle.benchmarks.contact_plot import NO_PLOT, tidy
from turnbuckle.benchmarks.plot import COLOR, OTHER

SOLVERS = {"newton": COLOR["turnbuckle"], "ica": COLOR["newton vbd"], "anticipation": OTHER}
NAMES = {"newton": "newton (ours)", "ica": "ica (the paper's)", "anticipation": "full anticipation"}
MARKERS = ("o", "D", "^", "s", "v")
MESHES = ("#9cc4ee", "#5b9be0", "#2a78d6", "#174a88", "#0b2747")


class Points(Protocol):
    """Windows: contacts and times."""

    name: str
    contacts: list[float]
    ms: list[float]

    def slope(self) -> float | None: ...


def scaling_figure(solvers: Sequence[Points], meshes: Sequence[Points], method: str, file: Path) -> str:
    """Both sides of Figure 6 into ``file`` (.png); returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return NO_PLOT
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.8), dpi=150, layout="constrained")
    left, right = figure.subplots(1, 2)
    for k, one in enumerate(solvers):
        _scatter(left, one, NAMES.get(one.name, one.name), SOLVERS.get(one.name, OTHER), MARKERS[k % len(MARKERS)])
    for k, one in enumerate(meshes):
        _scatter(right, one, one.name, MESHES[k % len(MESHES)], MARKERS[k % len(MARKERS)])
    left.set_title("Solvers, letters without friction", loc="left")
    right.set_title(f"Meshes, letters with friction, {NAMES.get(method, method)}", loc="left")
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("contacts")
        if axes.has_data():  # whole decades, so that each axis has numbers to read
            for ends, bounds in ((axes.get_xlim(), axes.set_xlim), (axes.get_ylim(), axes.set_ylim)):
                bounds(10.0 ** np.floor(np.log10(ends[0])), 10.0 ** np.ceil(np.log10(ends[1])))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_major_formatter("{x:g}")
        tidy(axes)
        if axes.has_data():
            axes.legend(frameon=False, fontsize=9)
    left.set_ylabel("time of a step of 30 ms [ms]")
    figure.savefig(file)
    return f"Plot: {file}"


def _scatter(axes: Any, one: Points, name: str, color: str, marker: str) -> None:
    if not one.contacts:
        return
    n, ms = np.array(one.contacts), np.array(one.ms)
    slope = one.slope()
    label = name if slope is None else f"{name}, ~ contacts$^{{{slope:.2f}}}$"
    shown = n > 0
    axes.plot(n[shown], ms[shown], marker, color=color, markersize=5, label=label)
    if slope is not None:
        line = np.geomspace(n[shown].min(), n[shown].max(), 2)
        middle = np.exp(np.mean(np.log(ms[shown]) - slope * np.log(n[shown])))
        axes.plot(line, middle * line**slope, color=color, linewidth=1.0, alpha=0.6)


def histograms_figure(
    histograms: Sequence[tuple[str, str, Mapping[int, int], int, str]], shown: int, file: Path
) -> str:
    """Histograms (title, words of the axis, counts, bound, words of the bound) side by side into ``file`` (.png).

    The bound is drawn right of the last value that the paper counts; values above ``shown`` are at the right end.
    """
    if find_spec("matplotlib") is None:
        return NO_PLOT
    from matplotlib.figure import Figure

    columns = min(len(histograms), 3)
    rows = -(-len(histograms) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.4 * rows), dpi=150, layout="constrained")
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in places[len(histograms) :]:
        axes.remove()
    for axes, (title, words, counts, bound, note) in zip(places, histograms, strict=False):
        total = sum(counts.values())
        last = min(max([*counts, bound + 1]), shown)
        values = np.zeros(last + 1)
        for value, count in counts.items():
            values[min(value, last)] += count / max(total, 1)
        inside = np.arange(last + 1) <= bound
        axes.bar(np.arange(last + 1), values, width=0.85, color=np.where(inside, COLOR["turnbuckle"], "#b9b7b0"))
        axes.axvline(bound + 0.5, color=COLOR["paper"], linewidth=1.0, linestyle="--")
        share = sum(c for v, c in counts.items() if v <= bound) / max(total, 1)
        axes.annotate(
            f"{share:.1%} {note}\n(the paper: 90 %)", (0.97, 0.9), xycoords="axes fraction", ha="right", va="top",
            fontsize=9, color=COLOR["paper"], bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        )  # fmt: skip
        axes.set_xlim(0.4, last + 0.6)
        ticks = np.arange(1, last + 1, max(1, last // 10))
        axes.set_xticks(ticks, [f"{k}+" if k == last and max(counts, default=0) > last else f"{k}" for k in ticks])
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel(words)
        tidy(axes)
    figure.savefig(file)
    return f"Plot: {file}"
