"""Sweeps: what is varied, one folder a run, going on after a break, runs that fail, processes that die."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.data.errors import InputError
from turnbuckle.io import read_recording
from turnbuckle.sweeps.job import execute, record_failure
from turnbuckle.sweeps.local import run_local
from turnbuckle.sweeps.plan import read_json
from turnbuckle.sweeps.values import combine, parse_vary


def hanging(stiffness: float = 1e4, segments: int = 3, duration: float = 0.05) -> turnbuckle.Scene:
    """A rope on a nail."""
    scene = turnbuckle.Scene("hanging", dt=1e-3, duration=duration)
    scene.add_rope("rope", start=[0, 0, 0], end=[0, 0, -1], segments=segments, stretch_stiffness=stiffness, damping=1)
    scene.add_constraint("nail", "top", points={"body": "rope", "index": 0})
    return scene


@pytest.mark.parametrize(
    ("text", "path", "values"),
    [
        ("friction=0.1:0.9:9", "friction", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]),
        ("cells=1:9:3", "cells", [1, 5, 9]),
        ("dt=1e-4:1e-2:3:log", "dt", [1e-4, 1e-3, 1e-2]),
        ("x=-1:1:5", "x", [-1, -0.5, 0, 0.5, 1]),
        ("integrator=verlet,rk4", "integrator", ["verlet", "rk4"]),
        ("gravity=[0,0,-9.81],[0,0,-1.62]", "gravity", [[0, 0, -9.81], [0, 0, -1.62]]),
        ("contact=true,false", "contact", [True, False]),
        ("forces.wind.expression[0]='1,5*x',0", "forces.wind.expression[0]", ["1,5*x", 0]),
        ("n=7", "n", [7]),
    ],
)
def test_values_are_read(text: str, path: str, values: list) -> None:
    assert parse_vary(text) == (path, values)
    kinds = [type(v) for v in parse_vary(text)[1]]
    assert kinds == [type(v) for v in values] or text.startswith("x=")  # whole where all are whole


@pytest.mark.parametrize(
    "text",
    ["friction", "=1,2", "a=", "a=1:2", "a=1:2:0", "a=1:2:3:lin", "a=0:1:3:log", "a=[1,2", "a=1,,2", "a='x", "a={,3", "a=1e400:2:3"],
)  # fmt: skip
def test_wrong_values_are_told(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_vary(text)
    assert "\n" not in str(caught.value) and "--vary" in str(caught.value)


def test_combinations() -> None:
    assert combine({"a": [1, 2], "b": ["x", "y"]}) == [
        {"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 2, "b": "x"}, {"a": 2, "b": "y"},
    ]  # fmt: skip
    assert combine({"a": np.array([1, 2]), "b": (3, 4)}, together=True) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    for vary, together in (({}, False), ({"a": []}, False), ({"a": "xy"}, False), ({"a": [1], "b": [1, 2]}, True),
                           ({"a": [1, 1]}, False), ({"a": range(1000), "b": range(1000)}, False)):  # fmt: skip
        with pytest.raises(InputError):
            combine(vary, together)


def test_a_sweep_measures_what_it_should_and_goes_on(tmp_path: Path) -> None:
    """The rope's stretch is m g / k: a parameter of the function and a field of the scene are varied together."""
    out = tmp_path / "sweep"
    told = []
    result = turnbuckle.sweep(
        hanging,
        {"stiffness": [1e3, 2e3], "integrator": ["verlet", "midpoint"]},
        out=out,
        fixed={"duration": 1.5, "segments": 1, "bodies.rope.damping": 5},
        measure=["bodies.rope.lowest.2"],
        processes=1,
        progress=lambda *one: told.append(one),
    )
    assert told[0] == (0, 4, 0) and told[-1] == (4, 4, 0)
    assert [r.status for r in result.runs] == ["done"] * 4
    stretch = -1.0 - np.array(result.column("bodies.rope.lowest.2"))
    weight = 0.05 * 9.81  # half of the rope's 0.1 kg is at its end
    assert np.allclose(stretch, np.repeat([weight / 1e3, weight / 2e3], 2), rtol=0.02)
    rows = (out / "table.csv").read_text().splitlines()
    assert len(rows) == 5 and rows[0].startswith("stiffness,integrator,status,steps")
    assert (out / "plot.png").read_bytes()[:4] == b"\x89PNG"
    frozen = turnbuckle.Scene.load(result.runs[3].folder / "scene.yaml").definition
    assert frozen.integrator == "midpoint" and frozen.bodies[0].stretch_stiffness == 2e3
    outcome = read_json(result.runs[0].result / "outcome.json")
    assert outcome["versions"]["turnbuckle"] and outcome["values"] == {"stiffness": 1e3, "integrator": "verlet"}

    written = {run.folder.name: os.stat(run.result / "report.json").st_mtime_ns for run in result.runs}
    more = turnbuckle.sweep(
        hanging,
        {"stiffness": [1e3, 2e3, 4e3], "integrator": ["verlet", "midpoint"]},
        out=out,
        fixed={"duration": 1.5, "segments": 1, "bodies.rope.damping": 5},
        processes=1,
    )
    assert [r.status for r in more.runs] == ["done"] * 6 and len(list((out / "runs").iterdir())) == 6
    for run in more.runs[:4]:
        assert os.stat(run.result / "report.json").st_mtime_ns == written[run.folder.name], "done twice"


def test_runs_that_fail_keep_their_reason_and_are_tried_again_when_asked(tmp_path: Path) -> None:
    """One value flies apart (explicit, far too stiff), one makes no scene; the others are done."""
    scene = hanging(duration=0.3)
    vary = {"bodies.rope.stretch_stiffness": [1e4, 1e12], "bodies.rope.segments": [3, 0]}
    result = turnbuckle.sweep(scene, vary, out=tmp_path / "s", processes=1)
    assert [run.status for run in result.runs] == ["done", "failed", "failed", "failed"]
    apart, wrong = result.runs[2], result.runs[1]
    assert "segments" in wrong.reason and apart.reason and "t = " in apart.reason
    assert json.loads((apart.result / "report.json").read_text())["status"] == "failed"
    assert apart.reason.splitlines()[0][:20] in result.table()

    again = turnbuckle.sweep(scene, vary, out=tmp_path / "s", processes=1)
    assert not list(again.runs[2].folder.glob("failed-*")), "not asked to try again"
    third = turnbuckle.sweep(scene, vary, out=tmp_path / "s", processes=1, retry=True)
    assert third.runs[2].status == "failed" and (third.runs[2].folder / "failed-1" / "outcome.json").is_file()


def test_wrong_input_runs_nothing(tmp_path: Path) -> None:
    scene = hanging()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("do not touch")
    (tmp_path / "file").write_text("")
    for source, vary, options in (
        (scene, {"bodies.rope.stifness": [1, 2]}, {}),
        (scene, {"dt": [1e-3, object()]}, {}),
        (tmp_path / "none.yaml", {"dt": [1e-3]}, {}),
        (scene, {"dt": [1e-3]}, {"record": ["avi"]}),
        (scene, {"dt": [1e-3]}, {"processes": 0}),
        (scene, {"dt": [1e-3]}, {"out": tmp_path / "full"}),
        (scene, {"dt": [1e-3]}, {"out": tmp_path / "file"}),
        (scene, {"dt": [1e-3]}, {"out": tmp_path / "no" / "where"}),
        (lambda: None, {"dt": [1e-3]}, {}),
    ):
        with pytest.raises(InputError):
            turnbuckle.sweep(source, vary, **{"out": tmp_path / "out", **options})
    assert (tmp_path / "full" / "thesis.txt").read_text() == "do not touch"


def test_a_scene_that_cannot_be_written_leaves_no_folder(tmp_path: Path) -> None:
    """So the same name can be taken once it is mended."""

    def pushed(stiffness: float) -> turnbuckle.Scene:
        scene = hanging(stiffness)
        scene.add_force("wind", callable=lambda x, v, t, mass: 0.0 * x)
        return scene

    with pytest.raises(InputError, match="'wind' is a Python callable"):
        turnbuckle.sweep(pushed, {"stiffness": [1e3, 1e4]}, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    result = turnbuckle.sweep(hanging, {"stiffness": [1e3]}, out=tmp_path / "out", processes=1)
    with pytest.raises(InputError, match="'wind' is a Python callable"):
        turnbuckle.sweep(pushed, {"stiffness": [1e3]}, out=tmp_path / "out")
    assert [run.status for run in result.runs] == ["done"]
    assert sorted(p.name for p in (tmp_path / "out" / "runs").iterdir()) == [result.runs[0].folder.name]


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    hanging().save("hanging.yaml")
    words = ["sweep", "hanging.yaml", "--vary", "bodies.rope.damping=0:2:2", "--set", "duration=0.02"]
    done = CliRunner().invoke(app, [*words, "--record", "npz", "--processes", "1", "--measure", "energies.kinetic"])
    assert done.exit_code == 0, done.output
    assert "energies.kinetic" in done.stdout and "2 runs, 0 failed" in done.stdout
    recordings = sorted(Path("sweep_hanging").glob("runs/*/result/recording.npz"))
    assert len(recordings) == 2 and read_recording(recordings[0]).times[-1] == pytest.approx(0.02)
    for wrong in (
        ["--vary", "dt"], ["--vary", "dt=1,2", "--vary", "dt=3"], ["--vary", "dt=1e-3", "--set", "dt=1e-3"],
        ["--vary", "dt=1e-3", "--processes", "0"], ["--vary", "nothing=1,2"], ["--vary", "dt=-1,0"],
        ["--vary", "dt=1e-3,2e-3", "--cluster", "tcp://127.0.0.1:9", "--processes", "2"],
    ):  # fmt: skip
        result = CliRunner().invoke(app, ["sweep", "hanging.yaml", "--out", "other", *wrong])
        assert result.exit_code == 2 and result.stderr.startswith("turnbuckle: wrong input"), (wrong, result.output)


def jobs_of(tmp_path: Path, count: int, duration: float) -> list[dict]:
    jobs = []
    for number in range(count):
        folder = tmp_path / "runs" / f"run{number}"
        folder.mkdir(parents=True)
        hanging(stiffness=1e4 + number, duration=duration).save(folder / "scene.yaml")
        jobs.append({"folder": str(folder), "values": {"n": number}, "record": ["npz"], "device": "cpu"})
    return jobs


def test_a_process_that_is_killed_costs_no_run(tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, 3, duration=1.0)
    killed: list[int] = []

    def kill_one() -> None:
        until = time.monotonic() + 60
        while not killed and time.monotonic() < until:
            for attempt in tmp_path.glob("runs/*/attempt-*"):
                killed.append(int(attempt.name.split("-")[-2]))
                os.kill(killed[0], signal.SIGKILL)
                return
            time.sleep(0.005)

    hunter = threading.Thread(target=kill_one)
    hunter.start()
    outcomes = dict(run_local(jobs, processes=1))
    hunter.join()
    assert killed and sorted(outcomes) == [0, 1, 2]
    assert [outcomes[n]["status"] for n in range(3)] == ["done"] * 3
    assert all(one["where"]["process"] != killed[0] for one in outcomes.values())


def test_the_first_of_two_attempts_counts(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, 1, duration=0.01)
    first = record_failure(job, "its worker was given up")
    assert execute(job)["reason"] == first["reason"] == "its worker was given up"
    assert [p.name for p in Path(job["folder"]).iterdir() if p.is_dir()] == ["result"]


def test_a_run_whose_folder_is_out_of_reach_sends_its_files(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, 1, duration=0.01)
    files = {"scene.yaml": (Path(job["folder"]) / "scene.yaml").read_bytes()}
    far = {**job, "folder": str(tmp_path / "nowhere")}
    assert execute(far) == {"status": "far"}
    outcome = execute({**far, "files": files})
    assert outcome["status"] == "done" and set(outcome["files"]) == {"outcome.json", "report.json", "recording.npz"}


def test_ctrl_c_leaves_no_process_and_the_same_command_goes_on(tmp_path: Path) -> None:
    hanging(duration=20.0).save(tmp_path / "slow.yaml")
    command = [sys.executable, "-m", "turnbuckle", "sweep", "slow.yaml", "--vary", "bodies.rope.damping=0:1:2"]
    environment = {**os.environ, "PYTHONPATH": str(Path(turnbuckle.__file__).parents[1])}
    # A shell starts what it sends to the background with Ctrl-C ignored, and children inherit that.
    process = subprocess.Popen(
        [*command, "--processes", "1"], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    until = time.monotonic() + 60
    while not (attempts := list(tmp_path.glob("sweep_hanging/runs/*/attempt-*"))) and time.monotonic() < until:
        time.sleep(0.02)
    worker = int(attempts[0].name.split("-")[-2])
    process.send_signal(signal.SIGINT)
    assert process.stderr is not None
    told = process.stderr.read()
    assert process.wait(timeout=30) == 130 and "stopped" in told and "Traceback" not in told
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)
    assert not list(tmp_path.glob("sweep_hanging/runs/*/attempt-*")) and not list(
        tmp_path.glob("sweep_hanging/runs/*/result")
    )


@pytest.mark.parametrize("how", ["SIGTERM", "SIGKILL"])
def test_a_sweep_that_is_killed_leaves_no_process_behind(tmp_path: Path, how: str) -> None:
    hanging(duration=1e4).save(tmp_path / "slow.yaml")
    command = [sys.executable, "-m", "turnbuckle", "sweep", "slow.yaml", "--vary", "bodies.rope.damping=0:1:2"]
    environment = {**os.environ, "PYTHONPATH": str(Path(turnbuckle.__file__).parents[1])}
    process = subprocess.Popen([*command, "--processes", "1"], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while not (attempts := list(tmp_path.glob("sweep_hanging/runs/*/attempt-*"))) and time.monotonic() < until:
        time.sleep(0.02)
    worker = int(attempts[0].name.split("-")[-2])
    os.kill(worker, 0)
    process.send_signal(getattr(signal, how))
    process.wait(timeout=30)
    until = time.monotonic() + 10
    while time.monotonic() < until:
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{worker}/stat").exists() and ") Z " in Path(f"/proc/{worker}/stat").read_text():
            return  # ended, and nobody has asked for its code yet
        time.sleep(0.05)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("the worker runs on without its sweep")


def test_a_measure_that_no_run_has_is_told(tmp_path: Path) -> None:
    result = turnbuckle.sweep(
        hanging, {"stiffness": [1e4]}, out=tmp_path / "out", measure=["energies.kinetik", "steps"]
    )
    (told,) = [note for note in result.notes if note.startswith("measure ")]
    assert "energies.kinetik" in told and "did you mean 'energies.kinetic'" in told


def test_friction_is_that_of_contact() -> None:
    scene = turnbuckle.Scene("slide", dt=1e-3, contact=True)
    scene.add_rigid("box", box=[0.1, 0.1, 0.1])
    scene.apply_set("friction=0.7")
    assert scene.definition.contact.friction == 0.7
    off = hanging()
    with pytest.raises(turnbuckle.InputError, match="contact is off"):
        off.apply_set("friction=0.7")
