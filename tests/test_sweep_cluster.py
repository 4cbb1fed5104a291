"""A sweep on a real Dask cluster on loopback, one of whose workers is killed in the middle."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import turnbuckle
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.io import read_recording
from turnbuckle.sweeps.job import execute
from turnbuckle.sweeps.plan import read_json

pytest.importorskip("distributed")
ROOT = Path(__file__).resolve().parent.parent


def rope(damping: float) -> turnbuckle.Scene:
    scene = turnbuckle.Scene("rope", dt=1e-3, duration=1.0)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=10, damping=damping)
    scene.add_constraint("nail", "top", points={"body": "rope", "index": 0})
    return scene


class Cluster:
    """A scheduler and its workers, each a process."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.log = (folder / "log.txt").open("w")
        self.scheduler = self.start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        until = time.monotonic() + 60
        while not read_json(self.file) and time.monotonic() < until:
            time.sleep(0.05)
        self.address = read_json(self.file)["address"]
        self.workers = [
            self.start("dask_worker", "--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
            for _ in range(workers)
        ]

    def start(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{what}", *words, "--scheduler-file", str(self.file)],
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}", "TURNBUCKLE_THREADS": "1"},
            stdout=self.log,
            stderr=self.log,
        )

    def stop(self) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path, workers=2)
    yield made
    made.stop()


def test_a_worker_killed_in_the_middle_loses_nothing_and_doubles_nothing(tmp_path: Path, cluster: Cluster) -> None:
    killed: list[int] = []

    def kill_one(ended: int, total: int, failed: int) -> None:
        """After the second run has ended, a worker that has ended one and is at work again is killed."""
        until = time.monotonic() + 20
        while ended >= 2 and not killed and time.monotonic() < until:
            done = [read_json(path)["where"]["process"] for path in tmp_path.glob("out/runs/*/result/outcome.json")]
            at_work = [int(attempt.name.split("-")[-2]) for attempt in tmp_path.glob("out/runs/*/attempt-*")]
            for worker in sorted(set(at_work) & set(done)):
                killed.append(worker)
                os.kill(worker, signal.SIGKILL)
                break

    damping = [round(0.1 * n, 1) for n in range(8)]
    result = turnbuckle.sweep(
        rope, {"damping": damping}, out=tmp_path / "out", cluster=cluster.address, record=["npz"], progress=kill_one
    )
    assert killed and killed[0] in [w.pid for w in cluster.workers]
    assert [run.status for run in result.runs] == ["done"] * 8
    assert [row["damping"] for row in result.rows()] == damping
    folders = list((tmp_path / "out" / "runs").iterdir())
    assert len(folders) == 8
    for folder in folders:
        assert sorted(p.name for p in folder.iterdir()) == ["result", "scene.yaml"]
        names = sorted(p.name for p in (folder / "result").iterdir())
        assert names == ["outcome.json", "recording.npz", "report.json"]
        assert read_json(folder / "result" / "report.json")["steps"] == 1000
    # What the killed worker had under way was done by the other one, and what it had done before was kept.
    places = [run.outcome["where"]["process"] for run in result.runs]
    assert set(places) <= {w.pid for w in cluster.workers} and len(set(places)) == 2

    again = turnbuckle.sweep(rope, {"damping": damping}, out=tmp_path / "out", cluster=cluster.address, record=["npz"])
    assert [run.outcome["began"] for run in again.runs] == [run.outcome["began"] for run in result.runs]


def test_no_scheduler_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turnbuckle.sweeps.cluster.PATIENCE", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x", "tcp://127.0.0.1:99999999", ""):
        with pytest.raises(InputError, match="--cluster"):
            turnbuckle.sweep(rope, {"damping": [0.1]}, out=tmp_path / "out", cluster=address)


@pytest.mark.slow
def test_a_scheduler_that_is_lost_keeps_what_is_done(tmp_path: Path, cluster: Cluster) -> None:
    """The same sweep goes on without it, in processes of this machine."""

    def kill_scheduler(ended: int, total: int, failed: int) -> None:
        if ended == 2:
            cluster.scheduler.kill()

    damping = [round(0.1 * n, 1) for n in range(4)]
    with pytest.raises(StepError, match="the scheduler was lost; run the same again to go on"):
        turnbuckle.sweep(
            rope, {"damping": damping}, out=tmp_path / "out", cluster=cluster.address, progress=kill_scheduler
        )
    done = [read_json(f / "result" / "outcome.json") for f in (tmp_path / "out" / "runs").iterdir()]
    assert sum(bool(one) for one in done) >= 2
    result = turnbuckle.sweep(rope, {"damping": damping}, out=tmp_path / "out", processes=1)
    assert [run.status for run in result.runs] == ["done"] * 4
    began = {run.outcome["began"] for run in result.runs}
    assert {one["began"] for one in done if one} <= began


@pytest.mark.slow
def test_workers_without_our_folder_get_the_scene_and_send_the_files(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They see the folder here, so the first answer, that it is out of reach, is made up."""
    monkeypatch.setattr("turnbuckle.sweeps.cluster.execute", far_away)
    result = turnbuckle.sweep(
        rope, {"damping": [0.1, 0.2]}, out=tmp_path / "out", cluster=cluster.address, record=["npz"]
    )
    assert [run.status for run in result.runs] == ["done"] * 2
    for run in result.runs:
        assert sorted(p.name for p in run.result.iterdir()) == ["outcome.json", "recording.npz", "report.json"]
        assert len(read_recording(run.result / "recording.npz")) == 61 and run.report["steps"] == 1000


def far_away(job: dict) -> dict:
    return execute({**job, "folder": job["folder"] + "-out-of-reach"})
