"""Every page of the gallery runs, shorter and without its film; its own asserts hold the number of its figure."""

import re
import runpy
from pathlib import Path

import pytest

GALLERY = Path(__file__).parent.parent / "docs" / "gallery"
PAGES = sorted(GALLERY.rglob("*.py"))
SLOW = {"figure_1_dancer", "figure_6_scaling"}
NEEDED = dict.fromkeys(
    ("figure_6_scaling", "figure_7_letters", "section_6_histogram"), "manifold3d"
)  # optional packages of pages


def page(path: Path) -> object:
    marks = [pytest.mark.slow] if path.stem in SLOW else []
    return pytest.param(path, id=f"{path.parent.name}/{path.stem}", marks=marks)


@pytest.mark.parametrize("path", [page(path) for path in PAGES])
def test_page_runs(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if path.stem in NEEDED:
        pytest.importorskip(NEEDED[path.stem])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TURNBUCKLE_QUICK", "1")
    monkeypatch.setenv("MPLBACKEND", "agg")
    runpy.run_path(str(path), run_name="__main__")
    assert "paper" in capsys.readouterr().out  # its counts and times stand beside the paper's


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_page_asserts_its_number(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert "\n# The number\n" in text and "\nassert " in text.split("\n# The number\n")[1]


def test_every_page_is_in_the_list_of_figures() -> None:
    text = (GALLERY.parent / "papers.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"\{doc\}`figures/(\w+/\w+)`", text)) - {"local/index"}
    assert listed == {f"{path.parent.name}/{path.stem}" for path in PAGES}
