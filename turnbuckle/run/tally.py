"""Adds up the reports of steps into the report of the run. Costs microseconds a step and memory that does not grow."""

import platform
import re
import statistics
import sys
from collections.abc import Iterable

import numpy as np
import scipy
import warp as wp

from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.state import State
from turnbuckle.run.result import RunResult
from turnbuckle.step.step import TOLERANCE

SAMPLES = 20_000  # of wall times kept at most; beyond, every second one is dropped and half as many are taken
KINDS_OF_MESSAGES = 200  # told apart at most
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Times:
    """Wall times of steps by stage, thinned evenly when they become many."""

    def __init__(self) -> None:
        self.samples: list[dict[str, float]] = []
        self.stride = 1
        self.wait = 0

    def add(self, seconds: dict[str, float]) -> None:
        """One step."""
        if self.wait:
            self.wait -= 1
            return
        self.wait = self.stride - 1
        self.samples.append(seconds)
        if len(self.samples) >= SAMPLES:
            del self.samples[1::2]
            self.stride *= 2
            self.wait = self.stride - 1

    def medians(self) -> dict[str, float]:
        """Milliseconds: "total", then one entry a stage."""
        names = dict.fromkeys(name for s in self.samples for name in s)
        ordered = [n for n in names if n == "total"] + [n for n in names if n != "total"]
        return {n: 1e3 * float(statistics.median(s.get(n, 0.0) for s in self.samples)) for n in ordered}


class Tally:
    """The report of a run in the making."""

    def __init__(self, model: Model) -> None:
        self.result = RunResult(scene=model.name, device=model.device, versions=versions())
        self.result.messages += model.repairs
        self._solves = model.conflicts == "solve"
        self._missed = TOLERANCE * model.size
        self._times = Times()
        self._messages: dict[str, list] = {}  # text without its numbers -> [first text, count, time of the first]

    def add(self, report: StepReport) -> None:
        """One step that was committed."""
        result = self.result
        result.steps += 1
        if not report.settling:
            worst = result.worst_residual
            for kind, value in report.position_residual.items():
                if value > worst.get(kind, -1.0):
                    worst[kind] = value
                on_points = not kind.startswith("joint")
                if self._solves and on_points and value > self._missed and value > result.worst_conflict:
                    result.worst_conflict = value
            worst = result.worst_rate_residual
            for kind, value in report.rate_residual.items():
                if value > worst.get(kind, -1.0):
                    worst[kind] = value
        linear, angular = report.momentum_error
        error = result.momentum_error
        if linear > error["linear"]:
            error["linear"] = linear
        if angular > error["angular"]:
            error["angular"] = angular
        self._times.add(report.seconds)
        result.energies = report.energies
        if report.messages:
            self._note(report.messages, report.time)
        if report.status == "degraded":
            result.degraded_steps += 1
        if report.rounds:
            _count(result.cmr_rounds, report.rounds)
        for solver, n in report.iterations.items():
            _count(result.iterations.setdefault(solver, {}), n)
        result.halvings += report.halvings
        result.last_resorts += report.last_resorts
        result.intersections = max(result.intersections, report.intersections)
        result.contacts_max = max(result.contacts_max, report.contacts)
        for condition, value in report.contact_residual.items():
            result.contact_residual[condition] = max(value, result.contact_residual.get(condition, 0.0))
        gap = report.smallest_gap
        if gap is not None and (result.smallest_gap is None or gap < result.smallest_gap):
            result.smallest_gap = gap

    def fail(self, time: float, what: str, advice: str) -> None:
        """The run ends here, and why."""
        self.result.status = "failed"
        self.result.failures.append({"time": float(time), "what": what, "advice": advice})

    @property
    def worst(self) -> float:
        """Largest position residual of any kind so far [m, or rad of the rotations of joints]."""
        return max(self.result.worst_residual.values(), default=0.0)

    def finish(self, model: Model, state: State, begin: float, wall: float) -> RunResult:
        """The report, after the last step. ``begin``: simulated time at the first [s]; ``wall`` [s]."""
        result = self.result
        result.simulated_seconds = state.time - begin
        result.wall_seconds = wall
        result.ms_per_step = self._times.medians()
        result.energies = {name: float(value) for name, value in (result.energies or state.energies).items()}
        result.counts = counts(model, state)
        result.messages += [
            text if n == 1 else f"{text} (the first of {n} such steps, at t = {at:.6g} s)"
            for text, n, at in self._messages.values()
        ]
        return result

    def _note(self, messages: Iterable[str], time: float) -> None:
        for text in messages:
            key = _NUMBER.sub("#", text)
            if key in self._messages:
                self._messages[key][1] += 1
            elif len(self._messages) < KINDS_OF_MESSAGES:
                self._messages[key] = [text, 1, time]


def _count(histogram: dict[str, int], value: int) -> None:
    histogram[str(value)] = histogram.get(str(value), 0) + 1


def counts(model: Model, state: State) -> dict[str, int]:
    """Points, springs, tetrahedra, rigid bodies, joints, constraints on points, and those by kind, acting or not."""
    kinds: dict[str, int] = {}
    for group in state.groups.values():
        kinds[group.kind] = kinds.get(group.kind, 0) + len(group.rows)
    springs = len(model.springs.pairs)
    tetrahedra = len(model.tetrahedra.corners) + len(model.corotational.corners)
    bodies = {"points": model.points, "springs": springs, "tetrahedra": tetrahedra}
    if model.rigid.count > 1:
        bodies |= {"rigid_bodies": model.rigid.count - 1, "joints": len(state.joints)}
    return {**bodies, "constraints": sum(kinds.values()), **kinds}


def versions() -> dict[str, str]:
    """Of what a result depends on."""
    own = sys.modules[__name__.partition(".")[0]]  # the public face, which nothing below the command imports
    return {
        "turnbuckle": str(getattr(own, "__version__", "unknown")),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "warp": str(wp.__version__),
    }
