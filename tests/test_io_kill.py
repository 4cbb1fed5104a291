"""A run that is killed leaves what it flushed; one that runs long does not grow."""

import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.io import read_recording

ROOT = Path(__file__).parents[1]

_WRITER = """
import os, sys
import numpy as np
from turnbuckle.data.shape import Shape
from turnbuckle.io import open_recorder

def memory():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

path, points, frames = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
lines = np.stack([np.arange(points - 1), np.arange(1, points)], axis=1).astype(np.int32)
recorder = open_recorder(path, [Shape("rope", 0, points, lines=lines)], up_axis="Z", frames_per_second=10.0)
x = np.random.default_rng(0).normal(size=(points, 3))
"""


_FLUSHED_EARLY = """
        for frame in range(frames):
            recorder.write(frame / 10, x + frame, 0 * x)
            if frame == frames - 4:
                recorder.flush()"""


def _start(code, path, points, frames):
    return subprocess.Popen(
        [sys.executable, "-c", _WRITER + textwrap.dedent(code), str(path), str(points), str(frames)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )


def _check(path, at_least, at_most=None):
    """Number of frames of what a killed run left; each frame f holds x0 + f."""
    x0 = np.random.default_rng(0).normal(size=(50, 3))
    if path.suffix in (".npz", ".vtkhdf"):
        recording = read_recording(path)
        count = len(recording)
        frames = [(recording.times[f] * 10, recording.x(f)) for f in range(count)]
    else:
        from pxr import Usd, UsdGeom

        part = path.with_name(path.name + ".part.usdc") if path.suffix == ".usda" else path
        read_recording(part)  # puts it right, where a save was cut off
        stage = Usd.Stage.Open(str(part))
        points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/World/rope/lines")).GetPointsAttr()
        codes = points.GetTimeSamples()
        count = len(codes)
        frames = [(code, np.array(points.Get(code))) for code in codes]
    assert count >= at_least and (at_most is None or count <= at_most)
    for number, (code, x) in enumerate(frames):
        assert code == pytest.approx(number)
        np.testing.assert_allclose(x, x0 + number, rtol=1e-6, atol=1e-5)
    return count


@pytest.mark.parametrize("suffix", [".npz", ".vtkhdf", ".usdc", ".usda"])
def test_exit_in_the_middle_keeps_what_was_flushed(tmp_path, suffix):
    if suffix.startswith(".usd"):
        pytest.importorskip("pxr")
    code = (
        _FLUSHED_EARLY
        + """
        os._exit(9)  # three frames after the last flush
    """
    )
    path = tmp_path / f"run{suffix}"
    assert _start(code, path, 50, 40).wait() == 9
    _check(path, at_least=37, at_most=40)


@pytest.mark.parametrize("attempts", [1, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("suffix", [".npz", ".vtkhdf", ".usdc"])
def test_kill_at_any_moment(tmp_path, suffix, attempts):
    if suffix.startswith(".usd"):
        pytest.importorskip("pxr")
    code = """
        for frame in range(frames):
            recorder.write(frame / 10, x + frame, 0 * x)
            recorder.flush()
            print(frame + 1, flush=True)
    """
    for attempt in range(attempts):
        path = tmp_path / f"run{attempt}{suffix}"
        process = _start(code, path, 50, 100000)
        while int(process.stdout.readline()) < 60:
            pass
        time.sleep(0.0037 * attempt)
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().split()
        process.wait()
        assert process.returncode == -signal.SIGKILL
        flushed = int(rest[-1]) if rest else 60
        _check(path, at_least=flushed)


def test_a_save_of_usd_that_was_cut_off_is_undone(tmp_path):
    """Wherever it was cut: the old structure is written over from its beginning on, the head last."""
    pytest.importorskip("pxr")
    from pxr import Tf, Usd

    code = (
        _FLUSHED_EARLY
        + """
                os.system(f"cp {path} {path}.before")
                from turnbuckle.io import usd_undo
                usd_undo.forget = lambda path: None
        recorder.flush()
        os._exit(9)
    """
    )
    path = tmp_path / "run.usdc"
    assert _start(code, path, 50, 40).wait() == 9
    before, after, undo = (path.with_name(n).read_bytes() for n in ("run.usdc.before", "run.usdc", "run.usdc.undo"))
    assert len(after) > len(before)
    start = next(i for i in range(88, len(before)) if before[i] != after[i])
    for number, length in enumerate(
        [start + 1, (start + len(before)) // 2, len(before), (len(before) + len(after)) // 2, len(after) - 1]
    ):
        cut = tmp_path / f"cut{number}.usdc"
        cut.write_bytes(before[:88] + after[88:length])  # the head still names the old structure
        cut.with_name(cut.name + ".undo").write_bytes(undo)
        with pytest.raises(Tf.ErrorException):
            Usd.Stage.Open(str(cut))
        assert _check(cut, at_least=37, at_most=37) == 37
        assert cut.read_bytes() == before
    cut.write_bytes(after[:-200])  # without a way back
    with pytest.raises(InputError, match="not whole"):
        read_recording(cut)


def test_torn_last_frame_is_left_out(tmp_path):
    code = """
        for frame in range(frames):
            recorder.write(frame / 10, x + frame, 0 * x)
        recorder.flush()
        os._exit(9)
    """
    path = tmp_path / "run.npz"
    assert _start(code, path, 50, 5).wait() == 9
    part = tmp_path / "run.npz.part"
    with part.open("r+b") as file:
        file.truncate(part.stat().st_size - 100)
    assert _check(path, at_least=4, at_most=4) == 4
    assert len(read_recording(part)) == 4


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads memory from /proc")
@pytest.mark.parametrize("suffix", [".npz", ".vtkhdf", ".usdc"])
def test_memory_does_not_grow(tmp_path, suffix):
    if suffix.startswith(".usd"):
        pytest.importorskip("pxr")
    code = """
        for frame in range(frames):
            recorder.write(frame / 10, x + frame, 0 * x)
            if frame % 10 == 9:
                recorder.flush()
            if frame == frames // 4:
                begin = memory()
        print(memory() - begin)
        recorder.close()
    """
    process = _start(code, tmp_path / f"run{suffix}", 20000, 200)
    grown = int(process.communicate()[0].split()[-1])
    assert process.returncode == 0
    assert grown < 25e6, f"{grown / 1e6:.0f} MB more after 150 frames of 1 MB"
