"""`assemble`: from arbitrary poses to valid ones, without touching speeds (Displacement, 2.3)."""

import time
from collections.abc import Callable
from os import PathLike
from pathlib import Path

from turnbuckle.data.errors import InputError
from turnbuckle.run.assembled_scene import moved_scene
from turnbuckle.run.assembly_bodies import clumps
from turnbuckle.run.assembly_film import Film
from turnbuckle.run.assembly_report import AssemblyReport, OpenJoint
from turnbuckle.run.closing import Closer, Search
from turnbuckle.run.outputs import check_outputs
from turnbuckle.scene.definitions import CoatingDef
from turnbuckle.scene.scene import Scene
from turnbuckle.solvers.displacement.conditions import Poses

Progress = Callable[[int, float], None]


def assemble(
    scene: Scene,
    *,
    tolerance: float = 1e-10,
    max_iterations: int | None = None,
    max_rotation: float = 0.3,
    watch: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> tuple[Scene, AssemblyReport]:
    """The scene with its bodies moved so that all joints and point constraints that act at the start are met.

    Iterations in displacements bring the bodies near (the heaviest moves least, nothing turns by more than
    ``max_rotation`` [rad] at a time), Newton steps on all joints at once close them to ``tolerance`` [m and rad]:
    trees, closed loops, redundant joints. Bodies that are immobile or follow a trajectory stay, speeds stay as they are
    written, and the same scene gives the same poses. A soft body moves as a whole, undeformed: what would need it to
    deform stays open and is reported. Nothing that cannot close makes it fail: the report names it, and by how much.

    ``max_iterations``: in displacements, in all; as many as it takes when left out. ``watch``: a recording (.npz,
    .vtkhdf, .usdc, .gif, .mp4, .png) of the way. ``progress(iterations so far, largest gap)`` is called after each.
    The scene returned can be saved; joints given by what holds at the start are written out where they would change
    their meaning. Raises `InputError` for a scene that cannot be built.
    """
    if not tolerance > 0.0 or not max_rotation > 0.0:
        raise InputError("assemble: tolerance and max_rotation must be greater than 0")
    began = time.perf_counter()
    paths = check_outputs([] if watch is None else [watch], None, None)
    model, state = scene.build(device)
    made = clumps(model, state, coated(scene))
    film = Film(paths, model, made, scene)
    try:
        closer = Closer(made, max_rotation=max_rotation)
        search = closer.search(tolerance, max_iterations, follow(film, progress))
        film.end(search.poses)
    finally:
        problems = film.close()
    result = scene if search.result is search.first else moved_scene(scene, model, state, made, search.poses)
    report = report_of(search, tolerance, time.perf_counter() - began)
    report.messages += film.notes + problems
    report.messages += [f"recorded {Path(path)}" for path in film.paths]
    return result, report


def coated(scene: Scene) -> dict[str, str]:
    """Coatings and their kernels."""
    return {d.name: d.around for d in scene.definition.bodies if isinstance(d, CoatingDef)}


def follow(film: Film, progress: Progress | None) -> Callable[[Poses, float], None]:
    """What is called after each iteration."""
    count = 0

    def step(poses: Poses, largest: float) -> None:
        nonlocal count
        count += 1
        film.frame(poses)
        if progress is not None:
            progress(count, largest)

    return step


def report_of(search: Search, tolerance: float, seconds: float) -> AssemblyReport:
    """The report of a search."""
    end, first = search.result, search.first
    left: dict[str, OpenJoint] = {}  # a point constraint of many rows by the worst of each measure
    for name, gap, angle in zip(end.names, end.gap, end.angle, strict=True):
        old = left.get(name, OpenJoint(name, 0.0, 0.0))
        left[name] = OpenJoint(name, max(old.gap, float(gap)), max(old.angle, float(angle)))
    wide = [joint for joint in left.values() if not max(joint.gap, joint.angle) <= tolerance]
    return AssemblyReport(
        closed=not wide,
        tolerance=tolerance,
        joints=len(left),
        gap=float(end.gap.max(initial=0.0)),
        angle=float(end.angle.max(initial=0.0)),
        start_gap=float(first.gap.max(initial=0.0)),
        start_angle=float(first.angle.max(initial=0.0)),
        iterations=search.iterations,
        steps=search.steps,
        attempts=search.attempts,
        seconds=seconds,
        open=sorted(wide, key=lambda joint: -max(joint.gap, joint.angle)),
    )
