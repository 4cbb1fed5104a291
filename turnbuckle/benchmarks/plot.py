"""The plot of Local, Figure 2: time per step against the number of constraints."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.benchmarks.peers.protocol import PeerResult

Points = Sequence[tuple[int, float]]  # (number of constraints, ms a step)
# Validated to be told apart by people with any colour vision; shape and label say the same again.
COLOR = {"turnbuckle": "#2a78d6", "paper": "#52514e", "newton vbd": "#1baf7a", "newton xpbd": "#eda100"}
OTHER = "#e34948"
MARKER = {"newton vbd": "D", "newton xpbd": "^"}


def figure_two(ours: Points, gap: float, paper: Points, peers: Sequence[PeerResult], file: Path) -> str:
    """Draw into `file` (.png); returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return "No plot: pip install matplotlib"
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    count, ms = np.array(ours).T
    axes.plot(count, ms, "o-", color=COLOR["turnbuckle"], linewidth=2, markersize=6)
    _label(
        axes,
        count[-1],
        ms[-1],
        f"turnbuckle, gap {gap:.0e} m" if gap else "turnbuckle, gap 0",
        COLOR["turnbuckle"],
    )
    if paper:
        x, y = np.array(paper).T
        axes.plot(x, y, "s--", color=COLOR["paper"], linewidth=1.5, markersize=6, markerfacecolor="white")
        _label(axes, x[-1], y[-1], "the paper, 2006 (Pentium 4)", COLOR["paper"])
    for peer in peers:
        color = COLOR.get(peer.name, OTHER)
        axes.plot(peer.constraints, peer.ms_per_step, MARKER.get(peer.name, "o"), color=color, markersize=8)
        _label(axes, peer.constraints, peer.ms_per_step, f"{peer.name}, gap {peer.gap:.0e} m", color, right=True)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(x=0.25, y=0.12)
    axes.set_xticks(count, [f"{number:,}" for number in count.astype(int)])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("constraints")
    axes.set_ylabel("time per step [ms]")
    axes.set_title("Curtain of cubes: a whole step", loc="left")
    axes.grid(True, which="major", color="#e4e3df", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file)
    return f"Plot: {file}"


def scaling(cubes: Sequence[int], ms: Sequence[float], a: float, b: float, file: Path) -> str:
    """Time per step against cubes with the fitted line a + b N; returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return "No plot: pip install matplotlib"
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    n = np.geomspace(min(cubes) / 1.5, max(cubes) * 1.5, 100)
    axes.plot(n, a + b * n, color=COLOR["paper"], linewidth=1.5, label=f"{a:.2g} ms + {1e3 * b:.2g} us a cube")
    axes.plot(cubes, ms, "o", color=COLOR["turnbuckle"], markersize=8, label="measured")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(cubes, [f"{number:,}" for number in cubes])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("cubes of five tetrahedra")
    axes.set_ylabel("time per step [ms]")
    axes.set_title("Curtain of cubes: growth with size", loc="left")
    axes.grid(True, which="major", color="#e4e3df", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    figure.savefig(file)
    return f"Plot: {file}"


def _label(axes: Any, x: float, y: float, text: str, color: str, right: bool = False) -> None:
    """Words right of a point, or above and left of it, where no rising line passes."""
    offset, align = ((10, -3), "left") if right else ((-4, 9), "right")
    axes.annotate(text, (x, y), offset, textcoords="offset points", ha=align, color=color, fontsize=9)
