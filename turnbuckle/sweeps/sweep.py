"""`sweep`: one scene, many values. Exported as `turnbuckle.sweep`."""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.io.atomic import write_atomically
from turnbuckle.sweeps.cluster import run_cluster
from turnbuckle.sweeps.job import Job
from turnbuckle.sweeps.local import run_local
from turnbuckle.sweeps.plan import RESULT, SCENE, Run, freeze
from turnbuckle.sweeps.plot import draw
from turnbuckle.sweeps.source import Make, Source, maker
from turnbuckle.sweeps.table import Row, csv_text, missing, rows, text
from turnbuckle.sweeps.values import combine

RECORDINGS = ("npz", "vtkhdf", "usdc", "usda", "usd", "png", "gif", "mp4")
Progress = Callable[[int, int, int], None]  # runs ended, runs in all, of them failed


@dataclass
class SweepResult:
    """What came of a sweep."""

    folder: Path
    runs: list[Run]  # in the order of the combinations
    varied: list[str]
    measures: list[str]
    notes: list[str]  # files written, and what could not be drawn

    @property
    def failed(self) -> list[Run]:
        """The runs that failed; each has its `reason`."""
        return [run for run in self.runs if run.status == "failed"]

    def rows(self) -> list[Row]:
        """The table as dicts, a row a run."""
        return rows(self.runs, self.measures)

    def column(self, name: str) -> list[Any]:
        """One column of the table, such as "ms_per_step", a varied path, or a path of the report."""
        return [row[name] for row in rows(self.runs, [*self.measures, name])]

    def table(self) -> str:
        """The table for people."""
        return text(self.rows(), self.varied, self.measures)


def sweep(
    scene: Source,
    vary: Mapping[str, Sequence[Any]],
    *,
    out: str | os.PathLike[str] | None = None,
    fixed: Mapping[str, Any] | None = None,
    together: bool = False,
    record: Sequence[str] = (),
    measure: Sequence[str] = (),
    retry: bool = False,
    processes: int | None = None,
    cluster: str | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
) -> SweepResult:
    """Run ``scene`` once for each combination of the values of ``vary``, each in a folder of its own below ``out``.

    ``scene``: a `Scene`, the path of a scene file, or a function that returns a `Scene` (such as those of
    `turnbuckle.scenes.REGISTRY`), whose parameters may be varied by name. ``vary``: paths of fields, as for `--set`
    (`dt`, `contact.friction`, `bodies.cloth.damping`), or parameters, each with a list of values; ``together``: the first
    values of all, then the second ones, in place of all combinations. ``fixed``: values that all runs share.
    ``out``: the folder, `sweep_NAME` when left out. ``record``: recordings of each run, by suffix ("npz", "usdc", ...).
    ``measure``: further columns of the table, as paths of the report ("energies.kinetic") or of where bodies came to
    lie ("bodies.cloth.lowest.2").

    Runs that are done are not run again: call it again after a break, or with more values. Runs that failed keep their
    reason; with ``retry`` they are tried again. ``processes`` of this machine (one a processor), or the Dask scheduler at
    the address ``cluster``. ``progress(ended, all, failed)`` is called as runs end.

    Raises `InputError` for wrong input before anything runs; a run that is wrong by itself has failed, and no other with
    it. `StepError` where the cluster is lost or the table cannot be written; what is done stays done.
    """
    name, make = maker(scene, fixed or {})
    return sweep_made(
        name, make, vary, out=out, together=together, record=record, measure=measure, retry=retry,
        processes=processes, cluster=cluster, device=device, progress=progress,
    )  # fmt: skip


def sweep_made(
    name: str,
    make: Make,
    vary: Mapping[str, Sequence[Any]],
    *,
    out: str | os.PathLike[str] | None,
    together: bool,
    record: Sequence[str],
    measure: Sequence[str],
    retry: bool,
    processes: int | None,
    cluster: str | None,
    device: str,
    progress: Progress | None,
) -> SweepResult:
    """`sweep` of whatever ``make`` makes of values."""
    folder = Path(out if out is not None else f"sweep_{name}").absolute()
    suffixes = sorted({suffix.lower().lstrip(".") for suffix in record})
    unknown = [suffix for suffix in suffixes if suffix not in RECORDINGS]
    if unknown:
        raise InputError(f"sweep: there are no recordings of {unknown[0]!r}; use {', '.join(RECORDINGS)}")
    if processes is not None and processes < 1:
        raise InputError(f"sweep: processes is {processes}; give at least 1")
    if processes is not None and cluster is not None:
        raise InputError("sweep: give processes of this machine or a cluster, not both")
    settings = {"record": suffixes, "device": device}
    runs = freeze(folder, name, make, combine(vary, together), settings)
    try:
        if retry:
            for run in runs:
                _again(run)
        waiting = [run for run in runs if run.status == "waiting"]
        jobs: list[Job] = [{"folder": str(run.folder), "values": run.values, **settings} for run in waiting]
        told, failures = len(runs) - len(jobs), sum(run.status == "failed" for run in runs)
        if progress is not None:
            progress(told, len(runs), failures)
        for number, outcome in _ended(jobs, processes, cluster):
            waiting[number].outcome = outcome
            told, failures = told + 1, failures + (outcome["status"] == "failed")
            if progress is not None:
                progress(told, len(runs), failures)
    finally:
        _clear(runs)
    result = SweepResult(folder, runs, list(vary), list(measure), [])
    result.notes += missing(runs, measure)
    _write(result)
    return result


def _ended(jobs: list[Job], processes: int | None, cluster: str | None) -> Iterator[tuple[int, dict[str, Any]]]:
    if not jobs:
        return iter(())
    return run_local(jobs, processes) if cluster is None else run_cluster(jobs, cluster)


def _again(run: Run) -> None:
    """Put a failed result aside, so that the run waits again."""
    if run.status != "failed" or not (run.folder / SCENE).is_file():
        return
    number = 1
    while (run.folder / f"failed-{number}").exists():
        number += 1
    (run.folder / RESULT).rename(run.folder / f"failed-{number}")
    run.outcome = {}


def _clear(runs: Sequence[Run]) -> None:
    """Remove attempts that came to nothing."""
    for run in runs:
        for left in run.folder.glob("attempt-*"):
            shutil.rmtree(left, ignore_errors=True)


def _write(result: SweepResult) -> None:
    """table.csv and plot.png. Raises `StepError`."""
    table, file, picture = result.rows(), result.folder / "table.csv", result.folder / "plot.png"
    try:
        write_atomically(file, lambda opened: opened.write(csv_text(table).encode()))
        result.notes += [f"table: {file}", draw(table, result.varied, result.measures, picture)]
    except OSError as error:
        raise StepError(f"sweep {result.folder}: the table cannot be written ({error.strerror or error})") from None
