"""A disk that fills up, places that refuse: the run stops with a sentence, and what was written is whole."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import wrong_inputs

import turnbuckle
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.io import read_recording
from turnbuckle.io.checkpoint import load

ROOT = Path(__file__).resolve().parent.parent
resource = pytest.importorskip("resource")

# A limit on the size of files is, for who writes them, a disk that is full.
FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from turnbuckle.cli import main
import turnbuckle.run.run  # kernels first: they have files of their own
import turnbuckle, warp as wp
wp.init()
limit = int(sys.argv.pop(1))
turnbuckle.Simulation(turnbuckle.Scene.load(sys.argv[2])).step()
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
main()
"""


def run_full(folder: Path, limit: int, *words: str) -> subprocess.CompletedProcess[str]:
    (folder / "rope.yaml").write_text(wrong_inputs.ROPE.replace("duration: 0.05", "duration: 2"))
    return subprocess.run(
        [sys.executable, "-c", FULL, str(limit), "run", "rope.yaml", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize("suffix", ["npz", "vtkhdf", "usdc"])
def test_a_disk_that_fills_up_stops_the_run_with_its_data_whole(tmp_path: Path, suffix: str) -> None:
    if suffix == "usdc":
        pytest.importorskip("pxr.Usd")
    # The report, the checkpoints and the first frames fit, not the whole recording.
    limit, duration = (400_000 if suffix == "vtkhdf" else 60_000), 2.0
    done = run_full(
        tmp_path,
        limit,
        "--duration",
        str(duration),
        "--out",
        f"a.{suffix}",
        "--report",
        "r.json",
        "--checkpoint",
        "c.checkpoint",
        "--every",
        "10",
    )
    assert "Traceback" not in done.stderr and done.returncode == 1, done.stderr[-2000:]
    told = [line for line in done.stderr.splitlines() if line.startswith("turnbuckle: ")]
    assert len(told) == 1 and f"a.{suffix}" in told[0], done.stderr
    assert "File too large" in told[0], told
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["status"] == "failed" and f"a.{suffix}" in report["failures"][0]["what"]
    model, state = turnbuckle.Scene.load(tmp_path / "rope.yaml").build()
    load(tmp_path / "c.checkpoint", model, state)
    assert 0.0 < state.time < duration + 1e-9
    if suffix in ("npz", "vtkhdf"):
        found = read_recording(tmp_path / f"a.{suffix}")
        assert len(found) > 20 and np.allclose(np.diff(found.times), 0.01) and np.isfinite(found.x(-1)).all()


@pytest.mark.slow
def test_a_film_on_a_disk_that_fills_up(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    done = run_full(tmp_path, 15_000, "--duration", "0.4", "--out", "a.mp4", "--report", "r.json")
    assert "Traceback" not in done.stderr and done.returncode == 1, done.stderr[-2000:]
    assert "a.mp4: ffmpeg failed" in done.stderr
    assert json.loads((tmp_path / "r.json").read_text())["status"] == "failed"


def test_a_checkpoint_that_does_not_fit_leaves_the_one_before(tmp_path: Path) -> None:
    done = run_full(tmp_path, 1_000, "--checkpoint", "c.checkpoint", "--every", "10")
    assert done.returncode == 1 and "c.checkpoint: cannot be written" in done.stderr, done.stderr[-2000:]
    assert [p.name for p in tmp_path.iterdir()] == ["rope.yaml"], "nothing half written is left"


def test_places_that_refuse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may write everywhere, so the refusal is made."""
    scene = turnbuckle.Scene.loads(wrong_inputs.ROPE)

    def refuse(*args: object, **options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    with pytest.raises(InputError, match="cannot be written .Permission denied"):
        turnbuckle.run_scene(scene, out=[tmp_path / "a.npz"])
    monkeypatch.undo()
    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(StepError, match="r.json: cannot be written .Permission denied"):
        turnbuckle.run_scene(scene, duration=0.002, report=tmp_path / "r.json")
    with pytest.raises(InputError, match="s.yaml: cannot be written .Permission denied"):
        scene.save(tmp_path / "s.yaml")
    pytest.importorskip("pxr.Usd")
    with pytest.raises(InputError, match="s.usda: cannot be written .Permission denied"):
        turnbuckle.export_scene(scene, tmp_path / "s.usda")
    assert list(tmp_path.iterdir()) == []


def test_exports_to_places_that_refuse(tmp_path: Path) -> None:
    scene = turnbuckle.Scene.loads(wrong_inputs.ROPE)
    turnbuckle.run_scene(scene, duration=0.02, out=[tmp_path / "a.npz"])
    for suffix in ("obj", "glb", "vtkhdf", "npz", "gif"):
        (tmp_path / f"x_0000.{suffix}").mkdir()  # a folder is in the way of a file
        (tmp_path / f"x.{suffix}").mkdir()
        with pytest.raises(InputError, match="x"):
            turnbuckle.export_recording(tmp_path / "a.npz", tmp_path / f"x.{suffix}")


def test_a_sweep_whose_folder_fills_up_keeps_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = turnbuckle.Scene.loads(wrong_inputs.ROPE)
    full = False

    def write(path: Path, fill: object) -> None:
        if full:
            raise OSError(28, "No space left on device")
        write_atomically(path, fill)

    from turnbuckle.sweeps import plan
    from turnbuckle.sweeps.plan import write_atomically

    monkeypatch.setattr(plan, "write_atomically", write)
    first = turnbuckle.sweep(scene, {"duration": [0.01]}, out=tmp_path / "s", processes=1)
    full = True
    with pytest.raises(InputError, match="cannot be written .No space left"):
        turnbuckle.sweep(scene, {"duration": [0.01, 0.02]}, out=tmp_path / "s", processes=1)
    full = False
    again = turnbuckle.sweep(scene, {"duration": [0.01]}, out=tmp_path / "s", processes=1)
    assert again.runs[0].outcome["began"] == first.runs[0].outcome["began"]
