"""The plot of a sweep: a panel a measure, over the first thing that was varied, a line for each of all else."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from turnbuckle.sweeps.table import SHOWN, Row
from turnbuckle.sweeps.values import slug

COLORS = ("#2a78d6", "#1baf7a", "#eda100", "#e34948", "#52514e", "#8c5fd0", "#00a3b4", "#b8527a")
MARKERS = "oD^sPvX*"
LINES = 12  # more are not told apart: the others are left out, and the title says so


def draw(table: Sequence[Row], varied: Sequence[str], measures: Sequence[str], file: Path) -> str:
    """Draw into ``file`` (.png); returns a line for the user. Raises OSError."""
    wanted = list(measures) or list(SHOWN)
    names = [n for n in wanted if any(_is_number(row.get(n)) for row in table)]
    if not names:
        return "no plot: no run has a number to draw"
    if find_spec("matplotlib") is None:
        return "no plot: pip install 'turnbuckle[sweep]'"
    from matplotlib.figure import Figure

    across = next((path for path in varied if all(_is_number(row[path]) for row in table)), varied[0])
    others = [path for path in varied if path != across]
    lines: dict[str, list[Row]] = {}
    for row in table:
        lines.setdefault(slug({path: row[path] for path in others}) if others else "", []).append(row)
    numeric = all(_is_number(row[across]) for row in table)
    places = {} if numeric else {str(value): i for i, value in enumerate(dict.fromkeys(str(r[across]) for r in table))}
    figure = Figure(figsize=(7.0, 1.0 + 2.4 * len(names)), dpi=130, layout="constrained")
    for axes, name in zip(figure.subplots(len(names), 1, squeeze=False)[:, 0], names, strict=True):
        drawn = []
        for i, (label, line) in enumerate(list(lines.items())[:LINES]):
            points = [(r[across] if numeric else places[str(r[across])], r[name]) for r in line if _is_number(r[name])]
            points.sort()
            drawn += points
            if points:
                style = {"color": COLORS[i % len(COLORS)], "marker": MARKERS[i % len(MARKERS)], "label": label or None}
                axes.plot(*zip(*points, strict=True), linewidth=1.5, markersize=5, **style)
        x, y = zip(*drawn, strict=True)
        if numeric and min(x) > 0 and max(x) > 50 * min(x):
            axes.set_xscale("log")
        if min(y) > 0 and max(y) > 50 * min(y):
            axes.set_yscale("log")
        if not numeric:
            axes.set_xticks(list(places.values()), list(places))
        axes.set_ylabel(name)
        axes.grid(True, color="#e4e3df", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(across)
    left = f" (the first {LINES} of {len(lines)} lines)" if len(lines) > LINES else ""
    figure.suptitle(f"{len(table)} runs, {sum(r['status'] == 'failed' for r in table)} failed{left}", x=0.01, ha="left")
    if others:
        figure.axes[0].legend(fontsize="small", frameon=False)
    figure.savefig(file)
    return f"plot: {file}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
