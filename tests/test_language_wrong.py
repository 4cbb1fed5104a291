"""Description files that are wrong in every line and every token: line, column, what was expected, and no traceback."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import turnbuckle.scenes
from turnbuckle.data.errors import InputError
from turnbuckle.scene.language.reader import parse_description, read_constraints_only
from turnbuckle.scene.language.tokens import Token, tokenise
from turnbuckle.scene.scene import Scene

APPENDIX = Path(turnbuckle.scenes.__file__).with_name("monocycle_constraints.gascuel").read_text(encoding="utf-8")
WHOLE = """\
/* Everything that the language has, once. */
world name all; up Y; gravity 0 -9.81 0; dt .01; integrator verlet; displacement scheme 1 alpha .5; end
object a box 1 2 3; mass 2; inertia (2 0 0) (0 2 0) (0 0 2); color 1 0 0; immobile; end
object b part sphere 1 density 3; part (capsule .1 2 position 0 0 1); spin 0 0 1; markers (0 0 0) (0 0 1); end
object c cylinder 1 2; trajectory times 0 1 positions (0 0 0) (0 0 1) interpolation linear; end
object d type rope; first 0 0 0; last 0 0 1; segments 4; end
object e type solid; box 1 1 1 cells 1 2 1; end
object f type coating; around b; thickness .1; end
force on b; push "sin(t)" 0 "-m"; torque 0 0 1; at 0 0 1; end
constraint object1 a; object2 b; hinge 0 0 0 0 0 0; axial 0 0 1 min -1 max 1; motor axial target-velocity 1; end
constraint object2 b; angle 1 0 0 1 0 0 min 0 max .1; twist 0 1 0 0 1 0 about 1 0 0 1 0 0 max .2; from 0; until 2; end
constraint object1 b; object2 c; curve (0 0 0) (0 0 1) (0 1 1) interpolation spline closed; enabled no; end
constraint type revolute; name r; object1 b; object2 c; anchor 0 0 0; axis 0 0 1; lower-limit -1; break-force 9; end
constraint type nail; points of d index 0; points of d side +x thickness .1; goal times 0 1 positions (0 0 0) (1 0 0); end
constraint type points_to_point; groups (of d index 4) (of e index 0); end
skin name s; objects (a b); section of a position 0 0 0 axis 0 0 1 radius 1; section of b position 0 0 0 axis 0 0 1
radius 1; end
"""
REPLACED = (
    "",
    "end",
    ";",
    "constraint",
    "0",
    "-1e400",
    "nan",
    "(",
    ")",
    '"',
    '"x"',
    "max",
    "hinge",
    "zzz",
    "/*",
    "\x07",
)
PLACE = re.compile(r"([^:\n]+):(\d+):(\d+): [^\n]{5,}")


def problem_of(text: str, alone: bool, folder: Path) -> tuple[int, int] | None:
    """Where the first problem of a text is, None where it has none. Anything but an `InputError` comes through."""
    try:
        if alone:
            file = folder / "x.gascuel"
            file.write_text(text, encoding="utf-8")
            read_constraints_only(file)
        else:
            parse_description(text, folder, "x.gascuel")
    except InputError as error:
        lines = str(error).splitlines()
        for line in lines:
            assert PLACE.fullmatch(line) or line.startswith("... and "), line
        match = PLACE.fullmatch(lines[0])
        return int(match[2]), int(match[3])
    return None


def block_starts(tokens: list[Token]) -> Iterator[tuple[int, int]]:
    """For each token, where its block begins."""
    begin, inside = (1, 1), False
    for token in tokens:
        if not inside and token.kind == "word":
            begin, inside = (token.position.line, token.position.column), True
        elif token.written == "end":
            inside = False
        yield begin


def test_the_texts_are_right(tmp_path: Path) -> None:
    assert problem_of(APPENDIX, True, tmp_path) is None
    assert problem_of(WHOLE, False, tmp_path) is None


def spliced(text: str, token: Token, new: str) -> str:
    """The text with one token replaced; everything else stays where it is."""
    lines = text.split("\n")
    line, column = token.position.line - 1, token.position.column - 1
    lines[line] = lines[line][:column] + new + lines[line][column + len(token.written) :]
    return "\n".join(lines)


@pytest.mark.parametrize(("text", "alone"), [(APPENDIX, True), (WHOLE, False)], ids=["appendix", "whole"])
def test_each_token_deleted_doubled_and_replaced(text: str, alone: bool, tmp_path: Path) -> None:
    tokens = tokenise(text)[:-1]
    wrong = 0
    rng = np.random.default_rng(3)
    for token, begin in zip(tokens, block_starts(tokens), strict=True):
        some = ["", f"{token.written} {token.written}", *rng.choice(REPLACED, size=3 if alone else 4)]
        for new in some:
            place = problem_of(spliced(text, token, str(new)), alone, tmp_path)
            wrong += place is not None
            # All before the block is as it was, so nothing is wrong there. (A name that goes may be missed later.)
            assert place is None or place >= begin, f"{token} -> {new!r}: told at {place}"
    assert wrong > 2.5 * len(tokens)


def test_a_text_cut_off_anywhere(tmp_path: Path) -> None:
    for end in range(0, len(APPENDIX), 3):
        problem_of(APPENDIX[:end], True, tmp_path)
    for end in range(0, len(WHOLE), 7):
        problem_of(WHOLE[:end], False, tmp_path)


def test_random_signs_anywhere(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    signs = list('()";/*\\{},=.-+eé\0\x85 \n\t#\ud7ff\u2028') + ["/*", "*/", '""']
    for _ in range(600):
        text = WHOLE
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(text)))
            text = text[:at] + signs[rng.integers(len(signs))] + text[at + int(rng.integers(0, 3)) :]
        problem_of(text, False, tmp_path)


def test_words_in_any_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    words = [token.written for token in tokenise(WHOLE)[:-1]]
    for _ in range(300):
        problem_of(" ".join(rng.choice(words, size=rng.integers(1, 40))), False, tmp_path)
        opener = rng.choice(["constraint", "object a", "world", "force", "skin"])
        problem_of(f"{opener} {' '.join(rng.choice(words, size=8))} end", False, tmp_path)


OBJECTS = "object a sphere 1; end object b sphere 1; end\n"
WRONG = [
    ("constraint object1 a; object2 b; hinge 0 0 0 0 0; end", 49, "'hinge' needs 6 numbers (P1 in object1, then P2 in object2), got 5, then ';'"),
    ("constraint object1 a; object2 b; hinge 0 0 0 0 0 0 0; end", 52, "expected ';' after 'hinge' and its values, got '0'"),
    ("constraint object1 a; object2 b; angle 1 0 0 1 0 0; max .1; end", 53, "'max' belongs before the ';' of axial, planar, sphere, angle or twist"),
    ("constraint object1 a; object2 b; angle 1 0 0 1 0 0 mx .1; end", 52, "unknown statement 'mx' in the constraint"),
    ("constraint object1 a; object2 b; hing 0 0 0 0 0 0; end", 34, "unknown statement 'hing' in the constraint, did you mean 'hinge'?"),
    ("constraint object1 a; object1 b; end", 23, "'object1' is given twice (first in line 2)"),
    ("constraint object1 a; object2 b; hinge 0 0 0 0 0 0;", 52, "expected a statement such as object1, object2, hinge, axial, planar, angle, twist, or 'end', got the end of the file"),
    ("constraint object1 a; object2 b; hinge 0 0 0 0 0 0; constraint", 53, "expected a statement or 'end' of the constraint that line 2 begins, got 'constraint'"),
    ("constraint object1 a; object2 c; hinge 0 0 0 0 0 0; end", 23, "constraint 'a.c', object2: there is no body 'c' (known: a, b)"),
    ("constraint object1 a; object2; end", 30, "expected the name of an object after 'object2', got ';'"),
    ("constraint object1 a; object2 end", 31, "expected the name of an object after 'object2', got 'end', which is a word of the language; a name like it stands in quotes"),
    ("constraint object1 a; object2 world; end", 31, "expected the name of an object after 'object2', got 'world', which is a word of the language; a name like it stands in quotes"),
    ("constraint object1 a; hinge 0 0 0 0 0 0; end", 1, "constraint 'joint', object2: this field is needed, but missing"),
    ("constraint object1 a; object2 b; end", 1, "constraint 'a.b': constrains nothing; give places, a domain, angle, twist or fixed_rotation"),
    ("constraint object1 a; object2 a; hinge 0 0 0 0 0 0; end", 23, "constraint 'a.a', object2: joins 'a' with itself"),
    ("constraint object2 b; axial 0 0 1 {min 2}; end", 35, "braces in the paper's grammar mark what may be left out, leave them out; ( ) hold rows and records"),
    ("constraint object2 b; axial 0, 0, 1; end", 30, "values are set apart by blanks, not by commas"),
    ("constraint object2 b; axial 0 0 1 min inf; end", 39, "expected a finite number after 'min', got 'inf'"),
    ("constraint object2 b; axial 0 0 1 min 3 max 2; end", 41, "constraint 'world.b', axial max: min 3 is above max 2"),
    ("constraint object2 b; axial 0 0 0; end", 29, "constraint 'world.b', axial axis: a direction must not be zero"),
    ("constraint object2 b; angle 1 0 0 1 0 0 min -1; end", 41, "constraint 'world.b', angle min: expected a number of at least 0, got -1"),
    ("constraint object2 b; axial 0 0 1; planar 0 0 1; end", 36, "constraint 'world.b', planar: give one domain, not axial and planar together"),
    ("constraint object2 b; angle 1 0 0 1 0 0; twist 1 0 0 0 1 0; end", 48, "constraint 'world.b', twist b1: must be perpendicular to its axis"),
    ("constraint axis 0 0 1; object2 b; end", 12, "'axis' is said of type revolute, prismatic, cylindrical, planar, ...; begin the constraint with 'type revolute;'"),
    ("constraint object2 b; type ball; end", 23, "'type' is said once, and before all else in the constraint"),
    ("constraint type bal; object2 b; end", 17, "expected a type of constraint, got 'bal', did you mean 'ball'? (known: "),
    ("constraint object2 b; # comment", 23, "comments are written /* ... */"),
    ("constraint object2 b; /* comment", 23, "this comment is never closed; end it with '*/'"),
    ('constraint object2 "b; end', 20, "this quote is not closed on its line; end it with '\"'"),
    ('constraint object2 "\\q"; end', 20, 'a quoted text knows \\" \\\\ \\n \\t and \\uXXXX, and no other \\'),
    ("object1 a; object2 b;", 1, "expected 'constraint', 'object', 'force', 'skin' or 'world', got 'object1', which stands in a constraint"),
    ("constrain object2 b; end", 1, "expected 'constraint', 'object', 'force', 'skin' or 'world', got 'constrain', did you mean 'constraint'?"),
    ("object c sphere; end", 16, "expected a number after 'sphere', got ';'"),
    ("object c sphere 1 2; end", 19, "expected ';' after 'sphere' and its values, got '2'"),
    ("object c sphere 0; end", 10, "object 'c', sphere: expected a number greater than 0, got 0"),
    ("object a sphere 1; end", 8, "object 'a', name: 'a' is already the name of bodies[0]"),
    ("object c mass 1; end", 1, "object 'c': give exactly one of box, or sphere, or cylinder, or capsule, or mesh, or vertices + triangles, or parts"),
    ('object c mesh "no.obj"; end', 10, "object 'c', mesh: there is no file "),
    ("object c cylinder 1; end", 20, "'cylinder' needs 2 numbers (radius and length), got 1, then ';'"),
    ("object c position 1 2; sphere 1; end", 22, "'position' needs 3 numbers, got 2, then ';'"),
    ("object end sphere 1; end", 8, "expected the name of the object, got 'end', which is a word of the language; a name like it stands in quotes"),
    ("object c part (sphere 1; end", 24, "or ')', got ';'"),
    ("world dt 1; end world end", 17, "there is already a 'world' in this file"),
    ("world bodies 1; end", 7, "unknown statement 'bodies' in the world"),
    ("world integrator verlte; end", 7, "world, integrator: expected explicit_euler, "),
    ("force push x 0 0; end", 12, "expected numbers or texts in quotes after 'push', got 'x'"),
    ('force push "sin(" 0 0; end', 7, "force, push: expression 'sin(', column 4: cannot be read ('(' was never closed)"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "column", "message"), WRONG, ids=[line[:50] for line, _, _ in WRONG])
def test_one_sentence_at_the_right_place(line: str, column: int, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        parse_description(OBJECTS + line, tmp_path, "f.gascuel")
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"f.gascuel:2:{column}: ")
    assert "\n" not in str(caught.value)


def test_each_wrong_line_of_a_file_is_told(tmp_path: Path) -> None:
    """What is well-formed but wrong is told all at once, in the order of the lines."""
    text = (
        "object a sphere -1; end\nobject b sphere 1; mass -1; end\nconstraint object2 b; angle 0 0 0 1 0 0 max -1; end"
    )
    with pytest.raises(InputError) as caught:
        parse_description(text, tmp_path, "f")
    assert [line.split(" ")[0] for line in str(caught.value).splitlines()] == ["f:1:10:", "f:2:20:", "f:3:41:"]


def test_files_that_are_no_texts(tmp_path: Path) -> None:
    file = tmp_path / "x.gascuel"
    for data, message in (
        (b"constraint\n\xff", "x.gascuel:2: not a text file in UTF-8"),
        (b"", "x.gascuel:1:1: the file describes nothing"),
        (b"/* nothing */", "x.gascuel:1:1: the file describes nothing"),
        (b"\xef\xbb\xbfobject a mass 1; end", "x.gascuel:1:1: object 'a': give exactly one of"),  # a byte order mark
    ):
        file.write_bytes(data)
        with pytest.raises(InputError, match=re.escape(message)):
            Scene.load(file)
    with pytest.raises(InputError, match="there is no such file"):
        Scene.load(tmp_path / "none.gascuel")


def test_deep_and_long_texts_end_soon(tmp_path: Path) -> None:
    for text, message in (
        ("object a mesh; inertia " + "(" * 100_000, "expected"),
        ("object a inertia " + "(" * 100_000, "nested more than 10 deep"),
        ("object a part " + "(" * 100_000, "expected"),
        ("constraint " * 50_000, "expected a statement"),
        ("object a sphere " + "1" * 100_000, "expected a number"),
        ("/*" * 100_000, "never closed"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            parse_description(text, tmp_path)
        assert len(str(caught.value)) < 400
