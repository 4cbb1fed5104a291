"""The tab "Plots": energy, residual, rounds and iterations, time per stage, over simulated time."""

import time
from typing import Any

import numpy as np

from turnbuckle.live.frame import Frame
from turnbuckle.live.history import History
from turnbuckle.live.session import Session

EVERY = 0.4  # [s] between two drawings
ENERGIES = (("kinetic", "#2f9e44"), ("elastic", "#f08c00"), ("gravity", "#1971c2"), ("total", "#343a40"))
COLORS = ("#1971c2", "#f08c00", "#2f9e44", "#e03131", "#7048e8", "#0c8599", "#c2255c", "#74b816", "#868e96")
HEIGHT = 170
LEAST = 1e-17  # [m] what a residual of zero is drawn as


class PlotPanel:
    """Four plots, of samples that the session keeps."""

    def __init__(self, gui: Any, session: Session) -> None:
        self._history: History = session.history
        self._drawn, self._length = 0.0, -1
        self.energy = _plot(gui, "Energy [J]", [name for name, _ in ENERGIES], [c for _, c in ENERGIES])
        self.residual = _plot(gui, "Worst residual, log10 of [m]", ["residual"], [COLORS[3]])
        self.rounds = _plot(gui, "Work a step", ["rounds", "iterations", "contacts"], COLORS)
        self._stages: list[str] = []
        self.stages = _plot(gui, "Time [ms] a step", ["total"], ["#343a40"])

    def update(self, frame: Frame) -> None:
        """Draw what there is, a few times a second."""
        now = time.perf_counter()
        if len(self._history) < 2 or now - self._drawn < EVERY or self._length == self._history.added:
            return
        self._drawn, self._length = now, self._history.added
        history = self._history
        self.energy.data = history.columns("time", *(name for name, _ in ENERGIES))
        times, residual = history.columns("time", "residual")
        self.residual.data = (times, np.log10(np.maximum(residual, LEAST)))
        self.rounds.data = history.columns("time", "rounds", "iterations", "contacts")
        stages = history.stages()
        if stages != self._stages:
            self._stages = stages
            names = ["total", *stages]
            data = history.columns("time", *(f"ms {n}" for n in names))
            self.stages.series = _series(names, ["#343a40", *COLORS])
            self.stages.data = data
        else:
            self.stages.data = history.columns("time", "ms total", *(f"ms {n}" for n in stages))


def _series(names: list[str], colors: Any) -> tuple[dict[str, Any], ...]:
    lines = [{"label": n, "stroke": colors[i % len(colors)], "width": 1.5} for i, n in enumerate(names)]
    return ({"label": "time [s]"}, *lines)


def _plot(gui: Any, title: str, names: list[str], colors: Any) -> Any:
    empty = (np.array([0.0, 1e-9]), *(np.zeros(2) for _ in names))
    return gui.add_uplot(
        empty,
        _series(names, colors),
        title=title,
        scales={"x": {"time": False}},
        height=HEIGHT,
        legend={"show": True},
        axes=({"size": 28}, {"size": 58}),
    )
