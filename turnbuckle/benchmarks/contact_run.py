"""Our own side of the benchmarks of contact: a scene is stepped, each step timed, committed states judged by the referee."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import turnbuckle
from turnbuckle.benchmarks.contact_referee import Referee
from turnbuckle.data.report import StepReport
from turnbuckle.data.rigid import DYNAMIC


@dataclass
class ContactRun:
    """What was measured, a value a step."""

    name: str
    dt: float  # [s]
    points: int
    solids: int  # tetrahedra
    vertices: int  # of the surfaces
    build_s: float
    time: list[float] = field(default_factory=list)  # [s] at the end of the step
    ms: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)  # [ms]
    contacts: list[int] = field(default_factory=list)
    rounds: list[int] = field(default_factory=list)
    halvings: list[int] = field(default_factory=list)
    last_resorts: list[int] = field(default_factory=list)
    status: list[str] = field(default_factory=list)
    judged: int = 0  # committed states that the referee saw
    crossing: int = 0  # of them, those that intersect
    went: float = 0.0  # [m] that points moved in the mean
    messages: list[str] = field(default_factory=list)

    def within(self, begin: float = 0.0, end: float = np.inf) -> np.ndarray:
        """(steps,) bool: those that end in a window of the simulated time [s]. The first compiles and never counts."""
        t = np.array(self.time)
        inside = (t > begin + 0.5 * self.dt) & (t < end + 0.5 * self.dt)
        inside[:1] = False
        return inside

    def of(self, name: str, within: np.ndarray) -> np.ndarray:
        """A field's values in a window."""
        return np.array(getattr(self, name))[within]


Watch = Callable[[turnbuckle.Simulation, StepReport], None]


def follow(
    scene: turnbuckle.Scene, seconds: float, every: int = 10, watch: Watch | None = None, wall: float = np.inf
) -> ContactRun:
    """Step ``scene`` for ``seconds`` of its time, at most ``wall`` [s] of ours; every ``every``-th state is judged.

    ``watch`` is called after each step, outside of what is timed.
    """
    before = time.perf_counter()
    simulation = turnbuckle.Simulation(scene)
    model = simulation.model
    assert model.surfaces is not None
    run = ContactRun(
        name=scene.definition.name,
        dt=simulation.dt,
        points=int((model.mass > 0.0).sum()),
        solids=len(model.corotational.corners) + len(model.tetrahedra.corners),
        vertices=model.surfaces.vertices,
        build_s=time.perf_counter() - before,
    )
    referee = Referee(model.surfaces)
    start = simulation.state.positions().copy()
    began = time.perf_counter()
    steps = round(seconds / simulation.dt)
    for number in range(1, steps + 1):
        before = time.perf_counter()
        report = simulation.step()
        spent = time.perf_counter() - before
        note(run, report, 1e3 * spent)
        if report.status == "failed":
            break
        if number % every == 0 or number == steps:
            referee.judge(model.surfaces.positions(simulation.state.positions()))
        if watch is not None:
            watch(simulation, report)
        if time.perf_counter() - began > wall:
            break
    run.judged, run.crossing = referee.judged, referee.crossing
    moved = np.linalg.norm(simulation.state.positions() - start, axis=1)
    carried = np.append(model.rigid.motion == DYNAMIC, False)[model.body_of]  # -1: no body
    run.went = float(moved[(model.mass > 0.0) | carried].mean())
    return run


def note(run: ContactRun, report: StepReport, ms: float) -> None:
    """Write down one step."""
    run.time.append(report.time)
    run.ms.append(ms)
    run.stages.append({stage: 1e3 * s for stage, s in report.seconds.items()})
    run.contacts.append(report.contacts)
    run.rounds.append(report.rounds)
    run.halvings.append(report.halvings)
    run.last_resorts.append(report.last_resorts)
    run.status.append(report.status)
    run.messages += [m for m in report.messages if len(run.messages) < 5]
