"""Five hundred wrong inputs: each one clear message and exit code 2, and never a traceback."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import wrong_inputs
from wrong_inputs import Case, call

BASES = {"nets.yaml": wrong_inputs.NETS, "contact.yaml": wrong_inputs.CONTACT, "joints.yaml": wrong_inputs.JOINTS,
         "rope.yaml": wrong_inputs.ROPE, "pair.gascuel": wrong_inputs.DESCRIPTION}  # fmt: skip
REFUSED: dict[str, int] = {}  # kind of input -> how many were refused
LEAST = {
    "scenes": 180,
    "descriptions": 70,
    "meshes": 50,
    "recordings": 50,
    "checkpoints": 45,
    "foreign": 45,
    "others": 60,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("wrong")


@pytest.fixture(scope="module")
def made(folder: Path) -> dict[str, Path]:
    return wrong_inputs.made_files(folder)


def judge(kind: str, cases: Iterator[Case]) -> None:
    """Every case is refused in one message, or does its work; most are refused."""
    problems, refused = [], 0
    for case in cases:
        answer = call(case.words)
        if answer.exception is not None:
            problems.append(f"{case.name}: {type(answer.exception).__name__}: {str(answer.exception)[:200]}")
        elif answer.code not in (0, 2):
            problems.append(f"{case.name}: exit code {answer.code}: {answer.error[-300:]}")
        elif answer.code == 2:
            refused += 1
            told = answer.error[answer.error.find("turnbuckle: wrong input") :].strip()
            # One sentence, or a line for each of several problems of a file, each with its place.
            lines = told.splitlines()
            listed = len(lines) > 1 and lines[0] == "turnbuckle: wrong input:"
            clear = told.startswith("turnbuckle: wrong input") and (listed or len(lines) == 1)
            if not clear or "Traceback" in answer.error or len(told) > 2500 or re.search(r"0x[0-9a-f]{8}", told):
                problems.append(f"{case.name}: unclear: {answer.error[:300]!r}")
    assert not problems, "\n".join(problems)
    REFUSED[kind] = refused
    assert refused >= LEAST[kind], f"only {refused} of the {kind} were wrong"


def test_the_inputs_are_good_before_they_are_spoiled(folder: Path) -> None:
    (folder / "hull.obj").write_text(wrong_inputs.TETRAHEDRON)
    for name, text in BASES.items():
        (folder / name).write_text(text)
        assert call(["check", str(folder / name)]).code == 0, name
    for name, text in (("good.urdf", wrong_inputs.URDF), ("good.xml", wrong_inputs.MJCF)):
        (folder / name).write_text(text)
        if name == "good.urdf" or pytest.importorskip("mujoco"):
            assert call(["import", str(folder / name), str(folder / "good.yaml")]).code == 0, name


KINDS: dict[str, Callable[[Path, dict[str, Path]], Iterator[Case]]] = {
    "scenes": lambda folder, made: wrong_inputs.scenes(folder, 220),
    "descriptions": lambda folder, made: wrong_inputs.descriptions(folder, 80),
    "meshes": lambda folder, made: wrong_inputs.meshes(folder),
    "recordings": lambda folder, made: wrong_inputs.recordings(folder, made, 80),
    "checkpoints": lambda folder, made: wrong_inputs.checkpoints(folder, made, 60),
    "foreign": lambda folder, made: wrong_inputs.foreign(folder, 60),
    "others": wrong_inputs.others,
}


@pytest.mark.parametrize("kind", KINDS)
def test_wrong_inputs(kind: str, folder: Path, made: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    judge(kind, KINDS[kind](folder, made))


def test_there_were_five_hundred() -> None:
    if len(REFUSED) < len(KINDS):
        pytest.skip("some kinds were not run here")
    assert sum(REFUSED.values()) >= 500, REFUSED
