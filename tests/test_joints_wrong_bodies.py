"""Bodies that joints cannot take, and forces that are none, are told with file and line."""

from pathlib import Path

import pytest

import turnbuckle

SCENE = """\
bodies:
  - {type: rigid, name: a, box: [1, 1, 1]}
  - {type: rigid, name: wall, box: [1, 1, 1], motion: immobile}
  - {type: rope, name: r, start: [0, 0, 0], end: [1, 0, 0], segments: 2}
forces:
  - {name: wind, expression: [1, 0, 0]}
constraints:
  - type: ball
    name: j
    anchor: [0, 0, 0]
    body0: wall
    body1: a
"""


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        ("body1: a", "body1: r", 12, "constraints[0].body1: 'r' is no rigid body"),
        ("body0: wall", "body0: r", 11, "constraints[0].body0: 'r' is no rigid body"),
        ("body0: wall\n    body1: a", "body1: wall", 11, "constraints[0].body1: neither of its bodies is dynamic"),
        ("body1: a", "body1: b", 12, "there is no body 'b'"),
        (", expression: [1, 0, 0]", "", 6, "forces[0]: gives no force; give an expression"),
    ],
)
def test_what_is_wrong_has_a_line(tmp_path: Path, old: str, new: str, line: int, what: str) -> None:
    assert old in SCENE
    path = tmp_path / "bad.yaml"
    path.write_text(SCENE.replace(old, new))
    with pytest.raises(turnbuckle.InputError) as error:
        turnbuckle.Scene.load(path)
    assert f"bad.yaml:{line}: " in str(error.value) and what in str(error.value)
