"""The command as a process of its own: speed of `--help`, exit codes, quiet ends."""

import subprocess
import sys
import time
from pathlib import Path

START = [sys.executable, "-c", "from turnbuckle.cli import main; main()"]


def command(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*START, *words], capture_output=True, text=True, timeout=60, cwd=folder)


def test_help_is_fast_and_imports_nothing_heavy() -> None:
    best = 9.0
    for _ in range(3):
        begin = time.perf_counter()
        result = command("--help")
        best = min(best, time.perf_counter() - begin)
    assert result.returncode == 0
    for verb in ("run", "check", "scenes", "schema", "bench"):
        assert f"  {verb} " in result.stdout
    assert best < 0.6, "0.2 s on an idle machine"
    script = (
        "import sys, turnbuckle.cli; print([m for m in ('numpy', 'warp', 'pydantic', 'scipy') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert result.stdout.strip() == "[]", result.stderr


def test_exit_codes_of_the_process(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("bodies:\n- {type: rope, name: r, lenght: 3}\n")
    result = command("run", "bad.yaml", folder=tmp_path)
    assert result.returncode == 2 and "bad.yaml:2: bodies[0].lenght: unknown field" in result.stderr
    assert result.stdout == "" and "Traceback" not in result.stderr
    assert command("check", "none.yaml", folder=tmp_path).returncode == 2
    assert command("nonsense").returncode == 2
    assert command("run", "--help").returncode == 0


def test_a_closed_pipe_is_no_error() -> None:
    process = subprocess.Popen([*START, "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert "Traceback" not in process.stderr.read()
    process.stderr.close()
    process.wait(timeout=60)
