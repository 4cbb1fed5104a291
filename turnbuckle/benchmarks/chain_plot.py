"""The plot of the chain: time a step against its length, and beside it how far the joints open."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from turnbuckle.benchmarks.plot import COLOR, OTHER

MARKERS = {"mujoco connect": "D", "mujoco tree": "s", "newton xpbd": "^"}
COLORS = {**COLOR, "mujoco connect": "#e34948", "mujoco tree": "#8a5fd0"}
LEAST = 1e-17  # [m], where a gap of zero is drawn


def chain_figure(
    ours: Sequence[tuple[int, float, float]], peers: Sequence[tuple[str, int, float, float]], file: Path
) -> str:
    """Ours (boxes, ms, gap [m]) and peers' (name, boxes, ms, gap); returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return "No plot: pip install matplotlib"
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.6), dpi=150, layout="constrained")
    times, gaps = figure.subplots(1, 2)
    series = {"turnbuckle": list(ours)}
    for name, n, ms, gap in peers:
        series.setdefault(name, []).append((n, ms, gap))
    for name, points in series.items():
        n, ms, gap = zip(*points, strict=True)
        style = {"color": COLORS.get(name, OTHER), "marker": MARKERS.get(name, "o"), "markersize": 6, "label": name}
        times.plot(n, ms, linewidth=2, **style)
        gaps.plot(n, [max(g, LEAST) for g in gap], linewidth=2, **style)
    for axes, title, unit in ((times, "Time per step", "ms"), (gaps, "Worst gap of a joint", "m")):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(x=0.12, y=0.12)
        sizes = sorted({point[0] for points in series.values() for point in points})
        axes.set_xticks(sizes, [f"{number:,}" for number in sizes])
        axes.minorticks_off()
        axes.set_xlabel("boxes")
        axes.set_ylabel(f"[{unit}]")
        axes.set_title(title, loc="left")
        axes.grid(True, which="major", color="#e4e3df", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    times.yaxis.set_major_formatter("{x:g}")
    times.legend(frameon=False)
    figure.savefig(file)
    return f"Plot: {file}"
