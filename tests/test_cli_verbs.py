"""The command: which scene is meant, what is passed on, what is printed, exit codes. The simulation is a stand-in."""

import json
import re
import sys
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

import turnbuckle.scenes
from turnbuckle.cli.app import app
from turnbuckle.cli.progress import RunProgress
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.scene.scene import Scene

SCENE = """\
bodies:
- {type: rope, name: line, start: [0, 0, 0], end: [1, 0, 0], segments: 4}
constraints:
- {type: nail, name: top, points: {body: line, index: 0}}
"""


def chain(links: int = 3, length: float = 1.0, mesh: str | None = None, up: bool = True) -> Scene:
    """A hanging chain.

    More text that is not shown.
    """
    if mesh == "boom":
        raise InputError("chain: mesh 'boom' cannot be read")
    scene = Scene("chain", duration=0.5)
    scene.add_rope("r", start=[0, 0, 0], end=[length, 0, 0], segments=links)
    return scene


def needy(mesh: str) -> Scene:
    return Scene("needy")


@dataclass
class Report:
    status: str = "done"

    def certificate(self) -> str:
        return "worst residual 1e-15 m"


class StandIn:
    """Takes the place of `turnbuckle.run.run.run`."""

    def __init__(self) -> None:
        self.calls: list[tuple[Scene, dict[str, Any]]] = []
        self.act: Callable[[], Report] = Report

    def __call__(self, scene: Scene, **options: Any) -> Report:
        self.calls.append((scene, options))
        for step in range(5):
            options["progress"](step * 0.1, 0.4, step, 1e-15)
        return self.act()


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[StandIn]:
    stand_in = StandIn()
    module = types.ModuleType("turnbuckle.run.run")
    module.run = stand_in  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "turnbuckle.run.run", module)
    monkeypatch.setattr(turnbuckle.scenes, "REGISTRY", {"chain": chain, "needy": needy}, raising=False)
    (tmp_path / "s.yaml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    yield stand_in


def call(*words: str) -> Result:
    result = CliRunner().invoke(app, list(words))
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    return result


def test_run_passes_everything_on(run: StandIn, tmp_path: Path) -> None:
    result = call(
        *("run", "s.yaml", "--duration", "2", "--dt", "1e-4", "--set", "bodies.line.density=3", "--set", "name=x"),
        *("--out", "a.npz", "--out", "b.png", "--report", "r.json", "--checkpoint", "c.h5", "--every", "10"),
    )
    assert result.exit_code == 0 and "worst residual 1e-15 m" in result.output
    scene, options = run.calls[0]
    assert scene.definition.bodies[0].density == 3.0 and scene.name == "x"
    assert options.pop("progress")
    assert options == {
        "duration": 2.0,
        "dt": 1e-4,
        "out": [Path("a.npz"), Path("b.png")],
        "report": Path("r.json"),
        "checkpoint": Path("c.h5"),
        "every": 10,
        "resume": None,
        "device": "cpu",
    }


def test_ready_scenes_take_parameters_and_fields(run: StandIn) -> None:
    assert call("run", "chain", "--set", "links=7", "--set", "length=2", "--set", "dt=1e-4").exit_code == 0
    scene, _ = run.calls[0]
    rope = scene.definition.bodies[0]
    assert rope.segments == 7 and rope.end[0] == 2.0 and scene.definition.dt == 1e-4
    assert call("run", "chain", "--set", "bodies.r.end=[0, 0, 5]").exit_code == 0
    assert run.calls[1][0].definition.bodies[0].end.tolist() == [0, 0, 5]
    assert call("run", "needy", "--set", "mesh=3").exit_code == 0  # text is expected: a number is a text, too


def test_exit_codes(run: StandIn) -> None:
    def fail() -> Report:
        raise StepError("step 3 failed: 'r' is not finite; take a smaller step")

    def interrupt() -> Report:
        raise KeyboardInterrupt

    run.act = lambda: Report(status="failed")
    result = call("run", "chain")
    assert result.exit_code == 1 and "worst residual" in result.output
    run.act = fail
    result = call("run", "chain")
    assert result.exit_code == 1 and "failed: step 3 failed: 'r' is not finite" in result.output
    run.act = interrupt
    result = call("run", "chain")
    assert result.exit_code == 130 and "whole" in result.output


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["none.yaml"], "none.yaml: there is no such file"),
        (["chian"], "no file and no ready scene 'chian', did you mean 'chain'?"),
        (["."], "is a folder"),
        (["needy"], "needs --set mesh="),
        (["chain", "--set", "links=many"], "chain expects a whole number, got 'many'"),
        (["chain", "--set", "links=true"], "expects a whole number, got true"),
        (["chain", "--set", "up=5.5"], "expects true or false"),
        (["chain", "--set", "lnks=4"], "has no parameter 'lnks', did you mean 'links'?"),
        (["chain", "--set", "links"], "expected path=value"),
        (["chain", "--set", "mesh=boom"], "mesh 'boom' cannot be read"),
        (["chain", "--set", "bodies.q.mass=4"], "there is no 'q'"),
        (["chain", "--set", "dt=-4"], "greater than 0"),
        (["s.yaml", "--set", "bodies[0].densty=4"], "did you mean 'density'"),
        (["s.yaml", "--set", "bodies[0].segments=0"], "at least 1"),
        (["s.yaml", "--dt", "0"], "--dt 0.0: expected a number greater than 0"),
        (["s.yaml", "--dt", "nan"], "--dt nan"),
        (["s.yaml", "--duration", "-1"], "--duration"),
        (["s.yaml", "--duration", "inf"], "--duration"),
        (["s.yaml", "--dt", "abc"], "Invalid value for '--dt'"),
        (["s.yaml", "--out", "a.doc"], "--out a.doc: expected a file that ends in .npz"),
        (["s.yaml", "--out", "a.npz", "--out", "./a.npz"], "twice"),
        (["s.yaml", "--out", "none/a.npz"], "there is no folder 'none'"),
        (["s.yaml", "--report", "."], "is a folder"),
        (["s.yaml", "--every", "5"], "--every N goes with --checkpoint FILE"),
        (["s.yaml", "--every", "3"], "--every N goes with --checkpoint FILE"),
        (["s.yaml", "--every", "0", "--checkpoint", "c"], "at least 1 step"),
        (["s.yaml", "--resume", "none.h5"], "--resume none.h5: there is no such file"),
        (["s.yaml", "--nonsense"], "No such option"),
        ([], "Missing argument"),
    ],
)
def test_wrong_input_is_exit_code_2_and_runs_nothing(run: StandIn, words: list[str], text: str) -> None:
    result = call("run", *words)
    assert result.exit_code == 2
    assert text in result.output, result.output
    assert not run.calls


def test_wrong_files_are_told_line_by_line(run: StandIn, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(SCENE.replace("segments", "segmets").replace("top", "t o p"))
    for verb in ("run", "check"):
        result = call(verb, "bad.yaml")
        assert result.exit_code == 2
        assert "bad.yaml:2: bodies[0].segmets: unknown field, did you mean 'segments'?" in result.output
        assert "bad.yaml:4: constraints[0].name: expected a name" in result.output


def test_scenes_lists_parameters(run: StandIn) -> None:
    result = call("scenes")
    assert result.exit_code == 0
    assert "chain(links=3, length=1.0, mesh=None, up=True)\n    A hanging chain.\n" in result.output
    assert "needy(mesh)" in result.output and "not shown" not in result.output


def test_schema_is_json() -> None:
    result = call("schema")
    assert result.exit_code == 0
    assert json.loads(result.output)["properties"]["dt"]["exclusiveMinimum"] == 0


def test_bench_names(run: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    called: list[str] = []
    both = {name: lambda name=name: called.append(name) for name in ("curtain", "scaling")}
    monkeypatch.setattr("turnbuckle.benchmarks.REGISTRY", both)
    assert call("bench", "scaling").exit_code == 0 and called == ["scaling"]
    assert call("bench").exit_code == 0 and called == ["scaling", "curtain", "scaling"]
    result = call("bench", "curtian")
    assert result.exit_code == 2 and "did you mean 'curtain'?" in result.output


def test_progress_shows_time_speed_and_residual_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "140")
    monkeypatch.setenv("TERM", "xterm")
    with RunProgress("chain") as progress:
        for step in range(0, 501, 100):
            progress.update(step * 1e-3, 0.5, step, 2.5e-15)
    shown = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", capsys.readouterr().err)
    assert "Building chain" in shown and "0.500 / 0.500 s" in shown
    assert re.search(r"[1-9]\d* steps/s", shown) and "worst residual 2.5e-15" in shown


def test_progress_is_one_line_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    with RunProgress("chain") as progress:
        progress.update(0.0, 0.5, 0, 0.0)
        progress.update(0.5, 0.5, 500, 1e-15)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and "Building chain" in captured.err
    with pytest.raises(ValueError), RunProgress("chain"):  # an error while building leaves the terminal in order
        raise ValueError
