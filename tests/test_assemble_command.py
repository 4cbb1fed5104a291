"""`turnbuckle assemble`: scenes in and out, exit codes, messages."""

from pathlib import Path

import numpy as np
import pytest
from assembly_scenes import largest_gap, thrown
from typer.testing import CliRunner, Result

from turnbuckle import Scene
from turnbuckle.cli.app import app
from turnbuckle.scenes.bricard import bricard


def assemble(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["assemble", *map(str, arguments)])


@pytest.mark.parametrize("name", ["closed.yaml", "closed.gascuel"])
def test_a_thrown_scene_is_closed_and_written(tmp_path: Path, name: str) -> None:
    thrown(bricard(), 0.2, np.radians(40.0)).save(tmp_path / "thrown.yaml")
    result = assemble(tmp_path / "thrown.yaml", "--out", tmp_path / name, "--watch", tmp_path / "way.npz")
    assert result.exit_code == 0, result.output
    assert "closed: largest gap" in result.output and f"wrote {tmp_path / name}" in result.output
    assert largest_gap(Scene.load(tmp_path / name)) < 1e-10
    assert (tmp_path / "way.npz").is_file()


def test_what_cannot_close_is_written_all_the_same(tmp_path: Path) -> None:
    scene = Scene("short")
    scene.add_rigid("rod", box=[1.0, 0.1, 0.1])
    scene.add_joint("ball", "left", body1="rod", local_pos0=[-1, 0, 0], local_pos1=[-0.5, 0, 0])
    scene.add_joint("ball", "right", body1="rod", local_pos0=[1, 0, 0], local_pos1=[0.5, 0, 0])
    scene.save(tmp_path / "short.yaml")
    result = assemble(tmp_path / "short.yaml", "--out", tmp_path / "out.yaml")
    assert result.exit_code == 1
    assert "'left' cannot close: 0.5 m are left" in result.output
    assert Scene.load(tmp_path / "out.yaml").name == "short"


def test_set_changes_the_scene_first(tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    result = assemble("closed_chain", "--set", "n=6", "--set", "bodies[2].position=[0.1, 0.5, 0]", "--out", out)
    assert result.exit_code == 0, result.output
    loaded = Scene.load(out)
    assert len(loaded.definition.bodies) == 6 and largest_gap(loaded) < 1e-10


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bricard", "--out", "x.txt"], ".yaml or .gascuel"),
        (["bricard", "--out", "nowhere/x.yaml"], "there is no folder"),
        (["bricardo", "--out", "x.yaml"], "bricard"),
        (["bricard", "--out", "x.yaml", "--tolerance", "-1"], "greater than 0"),
        (["bricard", "--out", "x.yaml", "--max-iterations", "-1"], "at least 0"),
        (["bricard", "--out", "x.yaml", "--watch", "film.doc"], "suffix"),
        (["bricard"], "--out"),
    ],
)
def test_wrong_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    result = assemble(*arguments)
    assert result.exit_code == 2 and message in result.output, result.output
    assert list(tmp_path.iterdir()) == []
