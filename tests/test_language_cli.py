"""`turnbuckle check`, `convert` and `run` with files of the description language."""

import re
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import turnbuckle.scenes
from turnbuckle.cli.app import app
from turnbuckle.scene.scene import Scene

APPENDIX = Path(turnbuckle.scenes.__file__).with_name("monocycle_constraints.gascuel")
SWING = """\
/* A rod on a hinge in the world. */
world name swing; dt 1e-3; duration 2e-3; end
object rod box 0.1 0.1 1; mass 2; position 0 0 -0.5; end
constraint object2 rod; hinge 0 0 0  0 0 0.5; angle 1 0 0  1 0 0 max 0; end
"""


def call(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


@pytest.fixture
def swing(tmp_path: Path) -> Path:
    path = tmp_path / "swing.gascuel"
    path.write_text(SWING)
    return path


def test_check_of_constraints_alone_says_what_they_need(tmp_path: Path) -> None:
    shown = call("check", APPENDIX, "--graph", tmp_path / "g.svg").output
    assert "constraints: point and angle 7" in shown and "constraints: point           2" in shown
    needs = "body, wheel, left-thigh, left-leg, left-foot, right-thigh, right-leg, right-foot"
    assert f"needs the objects            {needs}\n" in shown
    assert f"warning: {APPENDIX}:44:19: " in shown and shown.endswith("1 warning\n")
    assert xml.parse(tmp_path / "g.svg").getroot().tag.endswith("svg")


def test_check_of_wrong_files_is_told_with_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "x.gascuel"
    path.write_text("constraint object2 a;\nhinge 1 2 3; end")
    shown = call("check", path, code=2).output
    assert f"wrong input: {path}:2:12: 'hinge' needs 6 numbers" in shown
    path.write_text(
        "object a sphere 1; end constraint object2 b; hinge 0 0 0 0 0 0; end"
    )  # some objects: all must be there
    assert f"{path}:1:35: constraint 'world.b', object2: there is no body 'b'" in call("check", path, code=2).output


def test_check_and_graph_of_a_whole_file_and_of_a_ready_scene(swing: Path, tmp_path: Path) -> None:
    for scene in (swing, "bricard"):
        shown = call("check", scene, "--graph", tmp_path / "g.svg").output
        assert "bodies" in shown
        assert "point + angle" in (tmp_path / "g.svg").read_text()
    assert "name the file .svg" in call("check", swing, "--graph", tmp_path / "g.png", code=2).output
    assert "cannot be written" in call("check", swing, "--graph", tmp_path / "no" / "g.svg", code=2).output
    assert "constraints only" in call("check", APPENDIX, "--set", "dt=1", code=2).output


def test_convert_there_and_back(swing: Path, tmp_path: Path) -> None:
    call("convert", swing, tmp_path / "a.yaml")
    shown = call("convert", tmp_path / "a.yaml", tmp_path / "b.gascuel").output
    assert "1 bodies, 1 constraints" in shown
    assert Scene.load(tmp_path / "b.gascuel").definition == Scene.load(swing).definition
    call("convert", tmp_path / "b.gascuel", tmp_path / "c.yaml")
    assert (tmp_path / "c.yaml").read_text() == (tmp_path / "a.yaml").read_text()
    call("convert", "bricard", tmp_path / "d.gascuel", "--set", "dt=0.5")
    assert Scene.load(tmp_path / "d.gascuel").definition.dt == 0.5


def test_convert_refuses_what_it_cannot_write(swing: Path, tmp_path: Path) -> None:
    assert "name the file to write .yaml or .gascuel" in call("convert", swing, tmp_path / "a.txt", code=2).output
    shown = call("convert", APPENDIX, tmp_path / "a.yaml", code=2).output
    assert "describes constraints only; it needs the objects body" in shown and not (tmp_path / "a.yaml").exists()
    assert "there is no such file" in call("convert", tmp_path / "none.gascuel", tmp_path / "a.yaml", code=2).output


def test_run_of_constraints_alone_is_wrong_input() -> None:
    assert "it needs the objects body, wheel" in call("run", APPENDIX, code=2).output


def test_run(swing: Path) -> None:
    assert re.search(r"^steps +2, ", call("run", swing).output, re.MULTILINE)
