"""Contact, Figure 2: elastic energy of a structure that meets a wall, with local projection and with our response.

`python -m turnbuckle.benchmarks.local_global`, or `turnbuckle bench local_global`.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.contact_plot import NO_PLOT
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.scenes.local_global import (
    AWAY,
    NORMAL,
    REST,
    A,
    B,
    C,
    elastic_energy,
    local_global,
    moved,
    optimal,
    projected,
    wall_distance,
)
from turnbuckle.step.simulation import Simulation

STEPS = (0.03, 0.01, 0.0025)  # [s]
GRID = 41  # places of c a side, in a map of the energy
FAR = 0.06  # [m] half the side of a map


def at_rest(push: float, dt: float) -> tuple[np.ndarray, float]:
    """Where a, b, b', c (4, 3) [m] come to rest in the scene, and the elastic energy that the report gives [J]."""
    scene = local_global(push=push, dt=dt)
    simulation = Simulation(scene)
    for _ in range(round(float(scene.definition.duration or 2.0) / dt)):
        report = simulation.step()
        assert report.status == "ok", report.messages
    return simulation.state.positions()[:4].copy(), report.energies["elastic"]


def energies(pushes: tuple[float, ...]) -> tuple[Table, np.ndarray]:
    """The table, and places at rest for the first push."""
    table = Table(
        "Elastic energy of the structure against the wall [mJ]",
        ["push [mm]", "dt [ms]", "c alone projected", "our response", "least for a and c", "local / ours"],
        notes=["Least: over the places of b, by another minimiser (BFGS), with a and c where the simulation has them."],
    )
    shown = REST
    for push in pushes:
        for dt in STEPS:
            x, energy = at_rest(push, dt)
            local = elastic_energy(projected(moved(REST, push), float(wall_distance(x[[C]])[0])))
            table.add(1e3 * push, 1e3 * dt, 1e3 * local, 1e3 * energy, 1e3 * elastic_energy(optimal(x)), local / energy)
            shown = x if shown is REST else shown
    return table, shown


def energy_maps(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energy [J] over places of c in the plane y = 0 around that of ``x``, (GRID, GRID): b as ``x`` has it, and optimal."""
    offset = np.linspace(-FAR, FAR, GRID)
    fixed, free = np.empty((GRID, GRID)), np.empty((GRID, GRID))
    for i, up in enumerate(offset):
        for j, right in enumerate(offset):
            y = x.copy()
            y[C] += [right, 0.0, up]
            fixed[i, j], free[i, j] = elastic_energy(y), elastic_energy(optimal(y))
    return fixed, free


def draw(push: float, x: np.ndarray, file: Path) -> str:
    """The paper's figure into ``file``; returns the line to tell the user."""
    if find_spec("matplotlib") is None:
        return NO_PLOT
    from matplotlib.figure import Figure

    start = moved(REST, push)
    local = projected(start, float(wall_distance(x[[C]])[0]))
    figure = Figure(figsize=(9.6, 4.6), dpi=130, layout="constrained")
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    maps = energy_maps(start)
    top = float(np.max(maps[0]))
    for axes, values, place, title in (
        (both[0], maps[0], local, "local: c alone is moved"),
        (both[1], maps[1], x, "global: b moves, too"),
    ):
        side = 1e3 * np.linspace(-FAR, FAR, GRID)
        shown = axes.pcolormesh(
            1e3 * start[C, 0] + side, 1e3 * start[C, 2] + side, 1e3 * values, cmap="coolwarm", vmin=0.0, vmax=1e3 * top
        )
        _structure(axes, start, "0.35", "--")
        _structure(axes, place, "black", "-")
        _wall(axes)
        axes.set_title(f"{title}: {1e3 * elastic_energy(place):.3g} mJ", loc="left")
        axes.set_aspect("equal")
        axes.set_xlabel("x [mm]")
    both[0].set_ylabel("z [mm]")
    figure.colorbar(shown, ax=both, label="elastic energy for c there [mJ]")
    figure.savefig(file)
    return f"Plot: {file}"


def _structure(axes: Any, x: np.ndarray, color: str, style: str) -> None:
    """a, b, c as a line with dots."""
    line = 1e3 * np.stack([x[A], x[B].mean(axis=0), x[C]])
    axes.plot(line[:, 0], line[:, 2], style, color=color, marker="o", markersize=4)


def _wall(axes: Any) -> None:
    foot = REST[C] - AWAY * NORMAL
    along = np.array([[-0.07], [0.07]]) * [NORMAL[2], 0.0, -NORMAL[0]]
    line = 1e3 * (foot + along)
    axes.plot(line[:, 0], line[:, 2], color="#555", linewidth=3)


def measure(
    console: Console | None = None, folder: Path | None = None, *, pushes: tuple[float, ...] = (0.02, 0.04)
) -> list[Table]:
    """Run the scene at three step sizes for each push [m]; print the energies, write the table and the figure."""
    console, busy = console or Console(), load()
    table, x = energies(pushes)
    folder = publish("local_global", [table], console, folder, busy)
    console.print(draw(pushes[0], x, folder / "local_global.png"), highlight=False)
    return [table]


if __name__ == "__main__":
    run_as_command(measure)
