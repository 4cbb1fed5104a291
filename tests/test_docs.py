"""Every example and every code block of README.md and docs/ runs; files, tests and messages they name exist."""

import ast
import re
import runpy
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.scenes import REGISTRY

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").iterdir())
SHORT = "0.02"  # seconds, where a command of a page gives no duration
BLOCK = re.compile(r"^```(python|yaml|bash)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"# (\S+\.yaml)\n")
# What a message has of a user's scene: names in quotes, numbers, kinds and schemes; and what a page leaves out.
SPLIT = re.compile(
    r"'[^']*'|\.\.\.|;|, did you mean|knot\[0\]|[-+\d.]*\d|[\[\]{}]|e\^|\b(?:nail|cube|verlet|explicit_euler)\b"
)
EXIT = re.compile(r"# exit code (\d+)$")


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


def blocks(page: Path) -> Iterator[tuple[str, str, int]]:
    """(language, text, line) of the blocks that run. Blocks in other languages (text) are shown only."""
    text = page.read_text(encoding="utf-8")
    for match in BLOCK.finditer(text):
        yield match[1], match[2], text[: match.start()].count("\n") + 2


def command(line: str) -> Result:
    """Run a line of the command in this process."""
    words = shlex.split(line, comments=True)
    if words[1] == "run" and "--duration" not in words:
        words += ["--duration", SHORT]
    result = CliRunner().invoke(app, words[1:])
    wanted = EXIT.search(line)
    assert result.exit_code == int(wanted[1] if wanted else 0), f"{line}\n{result.output}"
    return result


NEEDED = {"view.md": ("viser",)}  # optional packages of pages


@pytest.mark.parametrize("page", [p for p in PAGES if list(blocks(p))], ids=named)
def test_code_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for extra in NEEDED.get(page.name, ()):
        pytest.importorskip(extra)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__page__"}
    for language, text, line in blocks(page):
        if language == "python":
            exec(compile("\n" * (line - 1) + text, str(page), "exec"), names)
        elif language == "yaml":
            name = NAMED.match(text)
            assert name, f"{page}:{line}: a scene starts with a comment that names its file"
            Path(name[1]).write_text(text, encoding="utf-8")
        else:
            for entry in filter(None, text.splitlines()):
                assert entry.startswith("turnbuckle "), f"{page}:{line}: only the command runs here, not {entry!r}"
                command(entry)


@pytest.mark.parametrize("example", [e for e in EXAMPLES if e.suffix == ".py"], ids=named)
def test_python_examples_run(
    example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    shown = capsys.readouterr().out
    assert shown.count("\n") >= 2 and "nan" not in shown


@pytest.mark.parametrize("example", [e for e in EXAMPLES if e.suffix == ".yaml"], ids=named)
def test_scene_examples_run(example: Path) -> None:
    assert "\n0 warnings" in command(f"turnbuckle check {shlex.quote(str(example))}").output
    command(f"turnbuckle run {shlex.quote(str(example))}")


def test_each_example_is_listed() -> None:
    listed = (ROOT / "docs" / "quickstart.md").read_text(encoding="utf-8")
    assert [e.name for e in EXAMPLES if e.suffix in (".py", ".yaml") and f"`{e.name}`" not in listed] == []


def test_ready_scenes_are_those_of_the_readme() -> None:
    table = (ROOT / "README.md").read_text(encoding="utf-8").split("| Ready scenes | |\n|---|---|\n")[1]
    rows = table.split("\n\n")[0].splitlines()
    assert {re.match(r"\| `(\w+)` \|", row)[1] for row in rows} == set(REGISTRY)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_what_a_page_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"`((?:turnbuckle|tests|docs|examples)/[\w/.-]+)", text):
        assert (ROOT / path).exists(), f"{page.name} names {path}"
    for path, test in re.findall(r"`(tests/\w+\.py)::(\w+)`", text):
        assert f"def {test}(" in (ROOT / path).read_text(encoding="utf-8"), f"{page.name} names {path}::{test}"
    for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", re.sub(r"`[^`\n]+`", "", text)):
        if "://" not in link:
            assert (page.parent / link).exists(), f"{page.name} links to {link}"


def literals() -> str:
    """All texts of the source, the places of values in f-strings left as `{}`."""
    found = []
    for path in sorted((ROOT / "turnbuckle").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
                found.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(found)


def test_messages_that_are_explained_exist() -> None:
    """The words between names, numbers and dots of each explained message stand in one text of the source."""
    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    messages = [m for m in re.findall(r"^`(.+)`$", text, re.MULTILINE) if not m.startswith("Warp")]
    assert len(messages) > 60
    source = literals()
    for message in messages:
        pieces = SPLIT.split(message)
        longest = max((piece.strip(" :;,()") for piece in pieces), key=len)
        assert len(longest) > (4 if message.startswith("broke") else 8) and longest in source, (
            f"{message!r}: there is no {longest!r}"
        )


def told_by_steps() -> set[str]:
    """The longest fixed words of each message with which a step says that it is not `ok`."""
    found = set()
    for path in sorted((ROOT / "turnbuckle" / "step").glob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.args):
                continue
            adds = call.func.attr == "append" and ast.unparse(call.func.value).endswith("messages")
            if not (adds or call.func.attr == "_failed"):
                continue
            text = call.args[0] if adds else call.args[1]
            if isinstance(text, ast.JoinedStr):
                found.add(max((p.value for p in text.values if isinstance(p, ast.Constant)), key=len).strip())
            elif isinstance(text, ast.Constant):
                found.add(text.value)
    return found


def test_every_message_of_a_step_is_explained() -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    told = told_by_steps()
    assert len(told) > 12
    assert [words for words in sorted(told) if words.strip(" :;") not in page] == []


def test_every_public_name_is_in_the_reference() -> None:
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"(?:auto\w+::|\{comment-table\}) turnbuckle\.(\w+)$", text, re.MULTILINE))
    assert shown == set(turnbuckle.__all__)


def test_no_page_names_a_place_of_this_machine() -> None:
    private = re.compile(r"(?<![\w.])/(?:work|tmp|root|home)/")
    for page in [*PAGES, *EXAMPLES]:
        if page.is_file():
            assert not private.search(page.read_text(encoding="utf-8")), page
