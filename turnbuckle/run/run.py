"""`run`: a whole simulation with recordings, checkpoints and a report. Exported as `turnbuckle.run_scene`."""

import time
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from turnbuckle.data.errors import StepError, TurnbuckleError
from turnbuckle.data.report import StepReport
from turnbuckle.io.atomic import write_atomically
from turnbuckle.io.checkpoint import load, read_header
from turnbuckle.run.interrupt import Interrupt
from turnbuckle.run.outputs import Outputs, RecordingError, check_outputs, fresh_name
from turnbuckle.run.result import RunResult
from turnbuckle.run.saving import Saver
from turnbuckle.run.schedule import Schedule, make_schedule
from turnbuckle.run.tally import Tally, versions
from turnbuckle.scene.check_rigid import rigid_warnings
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation

Progress = Callable[[float, float, int, float], None]
Stop = Callable[[Simulation, StepReport], bool]
AnyPath = str | PathLike[str]
STANDS = "; the last good state stands: "  # between what went wrong and the advice, in the message of a failed step
LOOK = "look at the last frame recorded, and run again from a checkpoint with a smaller dt"


class _Stopped(KeyboardInterrupt):
    """Ctrl-C, heard between two steps."""


def run(
    scene: Scene,
    *,
    duration: float | None = None,
    dt: float | None = None,
    out: Sequence[AnyPath] = (),
    report: AnyPath | None = None,
    checkpoint: AnyPath | None = None,
    every: int | None = None,
    resume: AnyPath | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
    stop: Stop | None = None,
    picture_size: tuple[int, int] = (1280, 720),
) -> RunResult:
    """Simulate ``scene`` and write what is asked for.

    ``duration`` [s] and ``dt`` [s] are the scene's when left out; the last step is shorter where dt does not divide the
    duration. ``out``: recordings, each in the format of its suffix (.npz, .vtkhdf, .usdc, .png, .gif, .mp4), with a frame
    at the start, then ``frames_per_second`` of the scene, and one at the end; pictures and films are ``picture_size``
    (width, height) [pixels]. ``report``: the `RunReport` as JSON.
    ``checkpoint``: the whole state, at the end and after ``every`` steps (half a minute of wall time when left out);
    ``resume``: a checkpoint to go on from, up to ``duration`` in all. The rest of a resumed run has the bits of a run
    that never stopped; its recordings begin where it was resumed, beside older ones, and its report covers the steps
    since. What `turnbuckle check` says of joints that start open is among its messages.
    ``progress(simulated s, duration s, steps, worst residual m)`` is called after each step, and so is
    ``stop(simulation, step report)``, which may change the simulation and ends the run by returning True.

    A step that fails ends the run: the report says "failed" and why, everything recorded stays. Raises `InputError`
    for wrong input before anything runs, `StepError` where a recording or checkpoint cannot be written any more, and
    on Ctrl-C KeyboardInterrupt once the step is done and all files are whole.
    """
    definition = scene.definition
    duration = definition.duration if duration is None else duration
    dt = definition.dt if dt is None else dt
    make_schedule(duration, dt)
    report, checkpoint = _path(report), _path(checkpoint)
    paths = check_outputs(out, report, checkpoint)
    saver = Saver(checkpoint, every)
    if resume is not None:
        read_header(resume)
    simulation = Simulation(scene, device)
    state = simulation.state
    tally = Tally(simulation.model)
    if resume is None:
        tally.result.messages += rigid_warnings(simulation.model, state)
    else:
        load(resume, simulation.model, state)
        paths = [fresh_name(path, state.steps) for path in paths]
        if paths:
            named = ", ".join(str(path) for path in paths)
            tally.result.messages.append(
                f"recordings begin at t = {state.time:.6g} s, where the run was resumed: {named}"
            )
    schedule = make_schedule(duration, dt, state.time, state.steps)
    result = tally.result
    info = {"scene": scene.name, "integrator": definition.integrator, "dt": dt, "versions": versions()}
    if resume is not None:
        result.resumed = {"file": str(resume), "time": state.time, "steps": state.steps}
        info["resumed"] = result.resumed
    outputs = Outputs(paths, simulation.model, definition.frames_per_second, info, picture_size)
    result.messages += outputs.notes
    result.outputs = [str(path) for path in outputs.paths]
    begin, began = state.time, time.perf_counter()
    ended: BaseException | None = None
    try:
        with Interrupt() as interrupt:
            _advance(simulation, schedule, outputs, saver, tally, interrupt, (progress, duration), stop)
    except BaseException as error:  # also Ctrl-C: whatever it is, what was written must be whole before it goes on
        ended = error
        _tell(tally, state.time, error)
    ended = _close(simulation, outputs, saver, tally, ended)
    tally.finish(simulation.model, state, begin, time.perf_counter() - began)
    if checkpoint is not None and saver.saved:
        result.outputs.append(str(checkpoint))
    if report is not None:
        _write_report(report, result)
    if ended is None or (isinstance(ended, TurnbuckleError) and not isinstance(ended, RecordingError)):
        return result
    raise KeyboardInterrupt if isinstance(ended, _Stopped) else ended


def _path(path: AnyPath | None) -> Path | None:
    return None if path is None else Path(path)


def _advance(
    simulation: Simulation,
    schedule: Schedule,
    outputs: Outputs,
    saver: Saver,
    tally: Tally,
    interrupt: Interrupt,
    shown: tuple[Progress | None, float],
    stop: Stop | None,
) -> None:
    """Take the steps. Raises what ends the run early, but for a step that failed, which the tally holds then."""
    state, (progress, duration) = simulation.state, shown
    outputs.write(state)
    for dt in schedule.steps():
        report = simulation.step(dt)
        if report.status == "failed":
            what, _, advice = "; ".join(report.messages).partition(STANDS)
            tally.fail(state.time, what, advice or LOOK)
            return
        tally.add(report)
        if state.time >= outputs.next_frame:
            outputs.write(state)
        if saver.due(state.steps):
            outputs.flush()
            saver.save(simulation.model, state)
        if progress is not None:
            progress(state.time, duration, state.steps, tally.worst)
        if interrupt.asked:
            raise _Stopped
        if stop is not None and stop(simulation, report):
            return


def _tell(tally: Tally, time: float, error: BaseException) -> None:
    if isinstance(error, KeyboardInterrupt):
        tally.fail(time, "stopped by Ctrl-C", "resume from a checkpoint to go on")
    elif isinstance(error, RecordingError):
        tally.fail(time, str(error), "make room or choose another place, and resume from a checkpoint")
    elif isinstance(error, TurnbuckleError):
        what, _, advice = str(error).partition(STANDS)
        tally.fail(time, what, advice or LOOK)
    else:
        tally.fail(time, f"{type(error).__name__}: {error}", "see the traceback")


def _close(
    simulation: Simulation, outputs: Outputs, saver: Saver, tally: Tally, ended: BaseException | None
) -> BaseException | None:
    """The last frame, whole recordings, the last checkpoint. Returns what is to be raised in the end."""
    state = simulation.state
    problems = []
    if not isinstance(ended, RecordingError):
        try:
            outputs.write(state)
        except RecordingError as error:
            problems.append(str(error))
    problems += outputs.close()
    # After a failed step the checkpoint stays the last one of the run: the state just before is hardly of use.
    if tally.result.status == "done" or isinstance(ended, _Stopped | RecordingError):
        try:
            saver.save(simulation.model, state)
        except StepError as error:
            problems.append(str(error))
    for problem in problems:
        _tell(tally, state.time, RecordingError(problem))
    if problems and not isinstance(ended, KeyboardInterrupt):
        return ended if isinstance(ended, RecordingError) else RecordingError(problems[0])
    return ended


def _write_report(path: Path, result: RunResult) -> None:
    """Raises `StepError`."""
    try:
        write_atomically(path, lambda file: file.write(result.to_json().encode()))
    except OSError as error:
        raise StepError(f"report {path}: cannot be written ({error.strerror or error})") from None


run_scene = run  # its public name: `turnbuckle.run` is this package
