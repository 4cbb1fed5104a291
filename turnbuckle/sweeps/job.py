"""One run of a sweep, wherever it is executed: in a process of this machine or on a worker of a cluster.

It writes into a folder of its own, an attempt, which is moved to `result` in one piece at the end. Of two attempts at the
same run (a worker that was given up but lives on) the first that ends counts, the other is thrown away.
"""

import contextlib
import os
import shutil
import socket
import tempfile
import threading
import time
import traceback
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError, TurnbuckleError
from turnbuckle.data.report import StepReport
from turnbuckle.run.run import run as run_scene
from turnbuckle.run.tally import versions
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation
from turnbuckle.sweeps.plan import OUTCOME, REPORT, RESULT, SCENE, read_json, write_json

Job = dict[str, Any]  # folder, values, record (suffixes), device; `files`, where the folder cannot be reached
Outcome = dict[str, Any]
FAR = "far"  # status where the folder of the run cannot be reached from here
_ONE = threading.Lock()  # a run at a time: a worker of Dask may have several threads


def execute(job: Job) -> Outcome:
    """Do the run, unless it has a result already; returns its outcome. Never raises but for what stops the process.

    The outcome has `status` (`done`, `failed`), `reason`, `advice`, `values`, `wall_seconds`, `versions`, `where`, and
    for `done` the bodies as they lay at the end.
    """
    folder = Path(job["folder"])
    if not (folder / SCENE).is_file():
        return _execute_far(job) if "files" in job else {"status": FAR}
    with _ONE:
        return _execute(job, folder)


def _execute(job: Job, folder: Path) -> Outcome:
    found = read_json(folder / RESULT / OUTCOME)
    if found:
        return found
    attempt = folder / f"attempt-{socket.gethostname()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    try:
        attempt.mkdir()
        outcome = _run(job, folder / SCENE, attempt)
        write_json(attempt / OUTCOME, outcome)
        return _promote(attempt, folder / RESULT, outcome)
    except OSError as error:
        return failed(job, f"the folder of the run cannot be written ({error.strerror or error})")
    finally:
        shutil.rmtree(attempt, ignore_errors=True)


def _execute_far(job: Job) -> Outcome:
    """The run in a folder made for it; its files come back with the outcome."""
    with tempfile.TemporaryDirectory(prefix="turnbuckle-") as made:
        folder = Path(made)
        for name, data in job["files"].items():
            (folder / name).write_bytes(data)
        with _ONE:
            outcome = _execute(job, folder)
        files = {file.name: file.read_bytes() for file in (folder / RESULT).glob("*")}
    return {**outcome, "files": files}


def bring_home(job: Job, outcome: Outcome) -> Outcome:
    """Put the files of a run that was done far away into its folder, in one piece. Raises OSError."""
    attempt = Path(job["folder"]) / f"attempt-{uuid.uuid4().hex}"
    attempt.mkdir()
    for name, data in outcome.pop("files").items():
        (attempt / name).write_bytes(data)
    return _promote(attempt, Path(job["folder"]) / RESULT, outcome)


def failed(job: Job, reason: str, advice: str = "") -> Outcome:
    """The outcome of a run that left none itself."""
    return {"status": "failed", "reason": reason, "advice": advice, "values": job["values"], "where": _here()}


def record_failure(job: Job, reason: str, advice: str = "") -> Outcome:
    """Give a run without result the result that it failed, from outside: its process is gone. Raises OSError."""
    folder = Path(job["folder"])
    for left in folder.glob("attempt-*"):
        shutil.rmtree(left, ignore_errors=True)
    attempt = folder / f"attempt-{uuid.uuid4().hex}"
    attempt.mkdir()
    outcome = failed(job, reason, advice)
    write_json(attempt / OUTCOME, outcome)
    return _promote(attempt, folder / RESULT, outcome)


def _promote(attempt: Path, result: Path, outcome: Outcome) -> Outcome:
    """The attempt becomes the result, unless there is one: then that counts."""
    try:
        os.rename(attempt, result)  # onto a folder that is not empty, this is refused
    except OSError:
        found = read_json(result / OUTCOME)
        if found:
            return found
        raise
    return outcome


def _run(job: Job, scene_file: Path, attempt: Path) -> Outcome:
    began = time.time()
    kept: list[Simulation] = []

    def look(simulation: Simulation, report: StepReport) -> bool:
        kept[:] = [simulation]
        return False

    outcome: Outcome = {"status": "done", "reason": "", "advice": "", "values": job["values"]}
    try:
        result = run_scene(
            Scene.load(scene_file),
            out=[attempt / f"recording.{suffix}" for suffix in job["record"]],
            report=attempt / REPORT,
            device=job["device"],
            stop=look,
        )
        if result.status != "done":
            first: dict[str, Any] = dict(result.failures[0]) if result.failures else {}
            outcome |= {
                "status": "failed",
                "reason": f"{first.get('what', 'the run failed')} (t = {float(first.get('time', 0.0)):.6g} s)",
                "advice": str(first.get("advice", "")),
            }
    except KeyboardInterrupt:
        raise
    except InputError as error:
        outcome |= {"status": "failed", "reason": str(error)}
    except TurnbuckleError as error:
        outcome |= {"status": "failed", "reason": str(error)}
    except Exception as error:  # a bug, or memory: one run, not the sweep
        outcome |= {"status": "failed", "reason": f"{type(error).__name__}: {error}", "advice": "see its log.txt"}
        with contextlib.suppress(OSError):
            (attempt / "log.txt").write_text(traceback.format_exc())
    if kept:
        outcome["bodies"] = _bodies(kept[0])
    return {**outcome, "began": began, "wall_seconds": time.time() - began, "versions": versions(), "where": _here()}


def _bodies(simulation: Simulation) -> dict[str, Any]:
    """Where each body lay at the end: middle of its points [m], their mean velocity [m/s], lowest and highest [m]."""
    x, v = simulation.state.positions(), simulation.state.velocities()
    found = {}
    for shape in simulation.model.shapes:
        own, speed = x[shape.begin : shape.end], v[shape.begin : shape.end]
        if not len(own) or not (np.isfinite(own).all() and np.isfinite(speed).all()):
            continue
        found[shape.name] = {
            "middle": own.mean(axis=0).tolist(),
            "velocity": speed.mean(axis=0).tolist(),
            "lowest": own.min(axis=0).tolist(),
            "highest": own.max(axis=0).tolist(),
        }
    return found


def _here() -> dict[str, Any]:
    return {"host": socket.gethostname(), "process": os.getpid()}
