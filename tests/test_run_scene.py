"""`turnbuckle.run_scene`: which steps it takes, what it records, what it reports, how it ends."""

import json
import os
import resource
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from run_scene_example import rope, scene

import turnbuckle
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.io import read_recording
from turnbuckle.io.checkpoint import read_header
from turnbuckle.run.report_json import from_json, to_json
from turnbuckle.run.schedule import make_schedule
from turnbuckle.run.tally import SAMPLES, Times

NAMES = {  # what scripts rely on
    *("scene", "status", "steps", "simulated_seconds", "wall_seconds", "device", "versions", "ms_per_step"),
    *("worst_residual", "worst_conflict", "smallest_gap", "intersections", "contacts_max", "momentum_error"),
    *("iterations", "cmr_rounds", "halvings", "last_resorts", "failures"),
}


def hanging(**more: object) -> turnbuckle.Scene:
    nail = {"type": "nail", "name": "top", "points": [{"body": "r", "index": 0}]}
    return turnbuckle.Scene("hanging", bodies=[rope("r", 0.0)], constraints=[nail], **more)


def exploding(**more: object) -> turnbuckle.Scene:
    made = hanging(dt=0.5, duration=1e3, frames_per_second=2.0, **more)
    made.apply_set("bodies.r.stretch_stiffness=1e9")
    return made


# Steps ----------------------------------------------------------------------------------------------------------------


def test_schedule_of_any_duration_and_step() -> None:
    random = np.random.default_rng(0)
    for _ in range(3000):
        dt = 10.0 ** random.uniform(-6, -1)
        duration = dt * 10.0 ** random.uniform(-2, 3.5)
        if random.random() < 0.5:
            duration = max(round(duration / dt), 1) * dt  # a multiple, up to rounding
        steps = list(make_schedule(duration, dt).steps())
        assert set(steps[:-1]) <= {dt}
        assert sum(steps) == pytest.approx(duration, rel=1e-9)
        assert steps[-1] <= 1.001 * dt and (steps[-1] >= 1e-3 * dt or len(steps) == 1)
        if abs(duration / dt - round(duration / dt)) < 1e-10:
            assert len(steps) == round(duration / dt) and steps[-1] == dt


def test_schedule_of_what_is_left() -> None:
    for duration, dt, done in ((1.0, 1e-3, 377), (0.7, 1e-3, 1), (1.00037, 1e-2, 99), (0.1, 0.03, 2)):
        whole, time = list(make_schedule(duration, dt).steps()), 0.0
        for step in whole[:done]:
            time += step
        assert list(make_schedule(duration, dt, time, done).steps()) == whole[done:]
    assert make_schedule(1.0, 1e-3, 1.0, 1000).left == 0
    assert make_schedule(1.0, 1e-3, 5.0, 5000).left == 0
    assert list(make_schedule(0.5, 0.1, 0.25, 1000).steps()) == pytest.approx([0.1, 0.1, 0.05])  # made with another dt
    assert make_schedule(0.0, 1e-3).left == 0


@pytest.mark.parametrize(("duration", "dt"), [(-1.0, 1e-3), (np.nan, 1e-3), (1.0, 0.0), (1.0, -1.0), (1.0, np.inf)])
def test_wrong_durations_and_steps_are_refused(duration: float, dt: float) -> None:
    with pytest.raises(InputError, match="seconds"):
        turnbuckle.run_scene(hanging(), duration=duration, dt=dt)


# Recordings -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt, rate", [(1e-3, 60.0), (7e-4, 100.0), (0.03, 60.0), (1e-3, 1000.0), (1e-3, 1.0)])
def test_frames_come_at_their_rate(tmp_path: Path, dt: float, rate: float) -> None:
    place = tmp_path / "a.npz"
    result = turnbuckle.run_scene(hanging(frames_per_second=rate), duration=0.205, dt=dt, out=[place])
    recording = read_recording(place)
    steps = np.r_[0.0, np.cumsum(list(make_schedule(0.205, dt).steps()))]
    due = [steps[np.searchsorted(steps, k / rate - 1e-8)] for k in range(int(0.205 * rate + 1e-6) + 1)]
    np.testing.assert_allclose(recording.times, np.unique(np.round([*due, 0.205], 12)), atol=1e-9)
    assert (np.diff(recording.times) > 1e-6).all()
    assert result.steps == len(steps) - 1 and result.simulated_seconds == pytest.approx(0.205)
    start = turnbuckle.Simulation(hanging())
    assert np.array_equal(recording.x(0), start.positions())
    assert recording.info["scene"] == "hanging" and recording.info["integrator"] == "verlet"


def test_every_kind_of_output_at_once(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    out = [tmp_path / f"a{suffix}" for suffix in (".npz", ".vtkhdf", ".usdc", ".png", ".gif")]
    report = tmp_path / "report.json"
    result = turnbuckle.run_scene(hanging(), duration=0.05, out=[str(p) for p in out], report=report)
    assert result.status == "done" and result.outputs == [str(p) for p in out]
    first, second = (read_recording(p) for p in out[:2])
    assert np.array_equal(first.times, second.times) and len(first) == 4
    for frame in range(4):
        assert np.array_equal(first.x(frame), second.x(frame)) and np.array_equal(first.v(frame), second.v(frame))
    assert all(p.stat().st_size > 500 for p in out)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["report.json", *(p.name for p in out)])


def test_pictures_have_the_size_asked_for(tmp_path: Path) -> None:
    scene = turnbuckle.Scene("rope", dt=0.01)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=2, stretch_stiffness=1, mass=1)
    turnbuckle.run_scene(scene, duration=0.02, out=[tmp_path / "a.png"], picture_size=(200, 120))
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (200, 120)


def test_elements_of_both_kinds_of_solids_are_counted() -> None:
    scene = turnbuckle.Scene("blocks", dt=1e-3)
    box = {"size": [1, 1, 1], "cells": [1, 1, 1]}
    scene.add_solid("springy", box=box, density=1, k_distance=1)
    scene.add_solid("elastic", box=box, density=1, position=[2, 0, 0], youngs_modulus=1e3)
    assert turnbuckle.run_scene(scene, duration=2e-3).counts["tetrahedra"] == 10


def test_zero_duration_records_the_start(tmp_path: Path) -> None:
    result = turnbuckle.run_scene(hanging(), duration=0.0, out=[tmp_path / "a.npz"])
    assert (result.status, result.steps) == ("done", 0)
    assert read_recording(tmp_path / "a.npz").times.tolist() == [0.0]
    assert "hanging: done" in result.certificate()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"out": ["a.xyz"]}, "suffix '.xyz'"),
        ({"out": ["none/a.npz"]}, "no folder"),
        ({"out": ["/proc/a.npz"]}, "cannot be written"),
        ({"out": ["a.npz", "./a.npz"]}, "already"),
        ({"out": ["folder.npz"]}, "folder"),
        ({"report": "none/a.json"}, "no folder"),
        ({"report": "a.npz", "out": ["a.npz"]}, "already"),
        ({"checkpoint": "none/a.ckpt"}, "no folder"),
        ({"every": 5}, "without a checkpoint"),
        ({"checkpoint": "a.ckpt", "every": 0}, "at least 1"),
        ({"resume": "none.ckpt"}, "no such file"),
        ({"device": "cuda:99"}, "device"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder.npz").mkdir()
    made = hanging()
    if "device" not in options:
        made.build = lambda device: pytest.fail("was built")  # type: ignore[method-assign]
    with pytest.raises(InputError, match=words):
        turnbuckle.run_scene(made, **options)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.npz"]


# The report -----------------------------------------------------------------------------------------------------------


def test_report_has_the_names_scripts_rely_on(tmp_path: Path) -> None:
    place = tmp_path / "report.json"
    calls: list[tuple[float, float, int, float]] = []
    result = turnbuckle.run_scene(
        scene("verlet"), report=place, progress=lambda *given: calls.append(given), checkpoint=tmp_path / "a.ckpt"
    )
    data = json.loads(place.read_text())
    assert set(data) >= NAMES and data["schema_version"] == 1
    assert (data["scene"], data["status"], data["steps"], data["device"]) == ("everything", "done", 120, "cpu")
    assert set(data["versions"]) == {"turnbuckle", "python", "numpy", "scipy", "warp"}
    assert set(data["ms_per_step"]) >= {"total", "forces", "integration", "constraints"}
    assert data["ms_per_step"]["total"] > data["ms_per_step"]["forces"] > 0
    assert set(data["worst_residual"]) == {"nail", "points_to_point", "attach", "slide", "velocity"}
    assert 0 < max(data["worst_residual"].values()) < 1e-12
    assert data["counts"]["nail"] == 6 and data["counts"]["constraints"] == 10 and data["counts"]["tetrahedra"] == 5
    assert 0 < data["degraded_steps"] < 120 and data["failures"] == []
    assert data["energies"]["dissipation"] > 0 and np.isfinite(list(data["energies"].values())).all()
    assert sum("gradual activation" in text for text in data["messages"]) == 1
    assert any("broke: weak[0]" in text for text in data["messages"])
    assert calls[-1] == (pytest.approx(0.12), 0.12, 120, max(data["worst_residual"].values())) and len(calls) == 120
    assert read_header(tmp_path / "a.ckpt")["steps"] == 120
    assert to_json(from_json(place.read_text())) == place.read_text() == result.to_json()
    text = result.certificate()
    for word in (
        "everything: done",
        "120, 0.12 s simulated",
        "ms a step",
        "slide",
        "momentum",
        "dissipation",
        "a.ckpt",
    ):
        assert word in text
    for wrong in ("", "[]", '{"schema_version": 1, "x": 2}', '{"schema_version": 7}'):
        with pytest.raises(InputError, match="report"):
            from_json(wrong)


def test_residuals_of_the_report_are_the_worst_of_all_steps() -> None:
    reports: list[turnbuckle.StepReport] = []
    result = turnbuckle.run_scene(scene("explicit_euler"), stop=lambda simulation, report: bool(reports.append(report)))
    counted = [r for r in reports if not r.settling]
    assert len(reports) > len(counted) > 20
    for kind, value in result.worst_residual.items():
        assert value == max(r.position_residual.get(kind, 0.0) for r in counted) < 1e-12
    assert result.momentum_error["linear"] == max(r.momentum_error[0] for r in reports)
    assert result.degraded_steps == sum(r.status == "degraded" for r in reports)


def test_wall_times_are_thinned_and_not_hoarded() -> None:
    times = Times()
    for k in range(10 * SAMPLES):
        times.add({"total": k * 1e-3, "forces": 2.0})
    assert len(times.samples) <= SAMPLES
    assert times.medians()["total"] == pytest.approx(5 * SAMPLES, rel=0.02) and times.medians()["forces"] == 2000.0


# Ends -----------------------------------------------------------------------------------------------------------------


def test_stop_ends_the_run() -> None:
    result = turnbuckle.run_scene(hanging(), stop=lambda simulation, report: simulation.state.steps == 7)
    assert (result.status, result.steps) == ("done", 7)


def test_a_step_that_fails_loses_nothing(tmp_path: Path) -> None:
    out = [tmp_path / "a.npz", tmp_path / "a.vtkhdf"]
    result = turnbuckle.run_scene(exploding(), out=out, report=tmp_path / "r.json", checkpoint=tmp_path / "a.ckpt")
    assert result.status == "failed" and 3 < result.steps < 2000
    (failure,) = json.loads((tmp_path / "r.json").read_text())["failures"]
    assert failure["time"] == pytest.approx(0.5 * result.steps)
    assert "finite" in failure["what"] and "dt" in failure["advice"]
    for path in out:
        recording = read_recording(path)
        assert len(recording) == result.steps + 1
        assert np.isfinite(recording.x(result.steps)).all()
    assert not (tmp_path / "a.ckpt").exists(), "the state just before is of no use"
    assert "failed" in result.certificate() and "finite" in result.certificate()


@pytest.mark.parametrize(
    ("bad", "words"), [(lambda t: [np.nan] * 3, "not finite"), (lambda t: [1.0, 2.0], "shape"), (None, "type")]
)
def test_a_goal_that_fails_in_the_run(tmp_path: Path, bad: object, words: str) -> None:
    made = turnbuckle.Scene("goals", bodies=[rope("r", 0.0)])
    goal = lambda t: [0, 0, 0] if t < 0.0105 else bad(t) if bad else t.no  # noqa: E731
    made.add_constraint("nail", "hand", points=[{"body": "r", "index": 0}], goal=goal)
    if bad is None:  # an error in the user's own code is shown as it is; files are whole
        with pytest.raises(AttributeError):
            turnbuckle.run_scene(made, out=[tmp_path / "a.npz"], report=tmp_path / "r.json")
    else:
        assert turnbuckle.run_scene(made, out=[tmp_path / "a.npz"], report=tmp_path / "r.json").status == "failed"
        assert "'hand'" in json.loads((tmp_path / "r.json").read_text())["failures"][0]["what"]
    data = json.loads((tmp_path / "r.json").read_text())
    assert data["status"] == "failed" and data["steps"] < 12 and read_recording(tmp_path / "a.npz").times[0] == 0.0


def test_ctrl_c_ends_after_the_step(tmp_path: Path) -> None:
    def press(time: float, total: float, steps: int, worst: float) -> None:
        if steps == 25:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        turnbuckle.run_scene(
            hanging(),
            out=[tmp_path / "a.npz"],
            report=tmp_path / "r.json",
            checkpoint=tmp_path / "a.ckpt",
            progress=press,
        )
    assert signal.getsignal(signal.SIGINT) is before
    data = json.loads((tmp_path / "r.json").read_text())
    assert (data["status"], data["steps"]) == ("failed", 25) and "Ctrl-C" in data["failures"][0]["what"]
    assert read_recording(tmp_path / "a.npz").times[-1] == pytest.approx(0.025)
    resumed = turnbuckle.run_scene(hanging(), duration=0.05, resume=tmp_path / "a.ckpt")
    assert resumed.steps == 25 and resumed.energies == turnbuckle.run_scene(hanging(), duration=0.05).energies


def test_runs_in_a_thread() -> None:
    results = []
    thread = threading.Thread(target=lambda: results.append(turnbuckle.run_scene(hanging(), duration=0.01)))
    thread.start()
    thread.join()
    assert results[0].status == "done" and results[0].steps == 10


@pytest.mark.parametrize("suffix", [".npz", ".gif"])
def test_a_full_disk_ends_the_run_with_its_data_whole(tmp_path: Path, suffix: str) -> None:
    place, other = tmp_path / f"a{suffix}", tmp_path / "b.npz"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    made = hanging(frames_per_second=1000.0 if suffix == ".npz" else 60.0)
    limit = 200_000 if suffix == ".npz" else 400_000
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limits[1]))  # writes beyond fail with an OSError
    try:
        with pytest.raises(StepError, match=f"{place}.*cannot be written"):
            turnbuckle.run_scene(made, duration=20.0, out=[place, other], report=tmp_path / "r.json")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    data = json.loads((tmp_path / "r.json").read_text())
    assert data["status"] == "failed" and 10 < data["steps"] < 20_000
    assert str(place) in data["failures"][0]["what"]
    recording = read_recording(other if suffix == ".gif" else place)
    assert len(recording) > 5 and np.isfinite(recording.x(len(recording) - 1)).all()
    if suffix == ".gif":  # the other recording has the last frame too
        assert recording.times[-1] == pytest.approx(data["simulated_seconds"])
