"""Our own side of a benchmark: the curtain as a scene, its steps timed, its gaps measured from positions alone."""

import statistics
import time
from dataclasses import dataclass

import numpy as np

import turnbuckle
from turnbuckle.benchmarks.peers.protocol import DENSITY, GRAVITY
from turnbuckle.scenes.curtain_geometry import CurtainGeometry, curtain_geometry

DT = 1e-3  # [s]
STIFFNESS = 50.0  # [J], of each of the three energies; stable up to steps of 2 ms
DAMPING = 0.02  # [J s], of each


@dataclass(frozen=True)
class OwnResult:
    """What was measured on one curtain."""

    cubes: int
    tets: int
    constraints: int
    steps: int
    build_s: float  # scene to model and state
    first_step_s: float  # compiling and recording included
    ms_per_step: float  # median, the report of each step included
    stages_ms: dict[str, float]  # medians
    gap: float  # [m], worst violation of a constraint over all timed steps
    relative_gap: float  # over the size of the scene
    dropped: float  # [m], how far the lowest corner went
    status: str  # the worst of all steps


def curtain_scene(curtain: CurtainGeometry, integrator: str = "verlet") -> turnbuckle.Scene:
    """The curtain with all three energies damped, nailed and joined."""
    scene = turnbuckle.Scene("curtain", up_axis="Y", gravity=[0.0, GRAVITY, 0.0], dt=DT, integrator=integrator)
    stiffness = dict.fromkeys(("k_distance", "k_area", "k_volume"), STIFFNESS)
    damping = dict.fromkeys(("damping_distance", "damping_area", "damping_volume"), DAMPING)
    mesh = {"vertices": curtain.vertices, "tetrahedra": curtain.tetrahedra}
    scene.add_solid("cubes", **mesh, density=DENSITY, **stiffness, **damping)
    scene.add_constraint("nail", "nails", points={"body": "cubes", "indices": curtain.nails})
    sides = [{"body": "cubes", "indices": side} for side in curtain.pairs.T]
    scene.add_constraint("points_to_point", "joints", zip=sides)
    return scene


def measure_curtain(m: int, seconds: float = 2.0, least: int = 10) -> OwnResult:
    """Build and step `curtain(m)` for about `seconds` of wall time, `least` steps at least."""
    curtain = curtain_geometry(m)
    before = time.perf_counter()
    simulation = turnbuckle.Simulation(curtain_scene(curtain))
    built = time.perf_counter()
    report = simulation.step()
    first = time.perf_counter()
    for _ in range(3):
        simulation.step()

    times: list[float] = []
    stages: dict[str, list[float]] = {}
    gap, states = 0.0, {report.status}
    start = time.perf_counter()
    while len(times) < least or time.perf_counter() - start < seconds:
        began = time.perf_counter()
        report = simulation.step()
        times.append(1e3 * (time.perf_counter() - began))
        for stage, spent in report.seconds.items():
            stages.setdefault(stage, []).append(1e3 * spent)
        states.add(report.status)
        if len(times) % 10 == 1:
            gap = max(gap, curtain.worst_gap(simulation.positions()))
    x = simulation.positions()
    gap = max(gap, curtain.worst_gap(x))
    size = float(np.linalg.norm(np.ptp(curtain.vertices, axis=0)))
    return OwnResult(
        cubes=curtain.cubes,
        tets=len(curtain.tetrahedra),
        constraints=len(curtain.nails) + len(curtain.pairs),
        steps=len(times),
        build_s=built - before,
        first_step_s=first - built,
        ms_per_step=statistics.median(times),
        stages_ms={stage: statistics.median(spent) for stage, spent in stages.items()},
        gap=gap,
        relative_gap=gap / size,
        dropped=float(curtain.vertices[:, 1].min() - x[:, 1].min()),
        status=max(states, key=["ok", "degraded", "failed"].index),
    )
