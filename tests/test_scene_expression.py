"""Expressions of scene files: the right numbers, and no way out of the sandbox."""

import math
import time

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.scene.expression import MAX_LENGTH, compile_expression

NAMES = ("x", "y", "t")


def value(text: str, **variables: object) -> np.ndarray:
    return compile_expression(text, NAMES)(**variables)


@pytest.mark.parametrize(
    ("text", "python"),
    [
        ("1 + 2 * x - -y / 4", lambda x, y, t: 1 + 2 * x + y / 4),
        ("2 ** -x ** 2", lambda x, y, t: 2 ** -(x**2)),
        ("-x ** 2", lambda x, y, t: -(x**2)),
        ("sin(x) * cos(y) + tan(t)", lambda x, y, t: math.sin(x) * math.cos(y) + math.tan(t)),
        ("exp(-x) + log(t) + sqrt(abs(y))", lambda x, y, t: math.exp(-x) + math.log(t) + math.sqrt(abs(y))),
        ("min(x, y, t) + 10 * max(x, 1)", lambda x, y, t: min(x, y, t) + 10 * max(x, 1)),
        ("clip(x, -1, 1) + floor(10 * y)", lambda x, y, t: min(max(x, -1), 1) + math.floor(10 * y)),
        ("where(x < y, x, -1) + 2 * pi", lambda x, y, t: (x if x < y else -1) + 2 * math.pi),
        ("0 < x < 1 and not y > 0 or t == 3", lambda x, y, t: float((0 < x < 1 and not y > 0) or t == 3)),
        ("(x > 0) + (y > 0) * 5 - (t != 1)", lambda x, y, t: (x > 0) + (y > 0) * 5 - (t != 1)),
        ("  1e3*x \n + .5", lambda x, y, t: 1000 * x + 0.5),
    ],
)
def test_same_as_python_on_arrays(text: str, python: object) -> None:
    rng = np.random.default_rng(3)
    x, y = rng.standard_normal(50), rng.standard_normal(50)
    got = value(text, x=x, y=y, t=0.7)
    assert got.dtype == np.float64 and got.shape == (50,)
    want = [python(a, b, 0.7) for a, b in zip(x, y, strict=True)]
    np.testing.assert_allclose(got, want, rtol=1e-14, atol=1e-14)


def test_a_constant_is_a_number_and_bad_points_are_nan_not_errors() -> None:
    assert value("3") == 3.0 and value("3").shape == ()
    assert np.isnan(value("log(x)", x=-1.0)) and np.isinf(value("1 / x", x=0.0))
    assert np.isinf(value("9 ** 9 ** 9 ** 9"))


HOSTILE = [
    "", " ", "x +", "(x", "x)", "x y", "x; y", "x\0", "\ud800", "x = 3", "x := 3", "(x := 3)", "...", "# no",
    "__import__('os').system('true')", "().__class__.__bases__[0].__subclasses__()", "x.real", "x[0]", "[x]", "{x}",
    "{1: 2}", "'text'", "f'{x}'", "b'x'", "lambda: x", "x if y else t", "[x for x in y]", "(x for x in y)", "yield",
    "await x", "True", "None", "1j", "x @ y", "x % 2", "x // 2", "x ^ 2", "x & y", "x | y", "~x", "x << 2", "x in y",
    "x is y", "sin", "sin()", "sin(x, y)", "sin(*x)", "sin(x=1)", "sin(**x)", "min(x)", "where(x, y)", "eval('1')",
    "open('x')", "sin.__call__(x)", "(sin)(x)(y)", "print(x)", "1(x)", "z", "vx", "X", "pi()", "1e999", "9" * 900,
    "(" * 300 + "x" + ")" * 300, "-" * 900 + "x", "not " * 240 + "x", "+".join("x" * 499), "**".join("9" * 300),
    "x" * (MAX_LENGTH + 1), "min(" * 90 + "x, x" + ")" * 90, "0x", "1_", "0777", "é", "ｘ", "x\u200b", "import os",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text[:25]))
def test_hostile_expressions_are_input_errors_at_once(text: str) -> None:
    begin = time.perf_counter()
    if text == "ｘ":  # Python reads the fullwidth letter as x, and so do we
        assert value(text, x=2.0) == 2.0
        return
    with pytest.raises(InputError) as caught:
        compile_expression(text, NAMES)
    assert type(caught.value) is InputError and str(caught.value).startswith("expression ")
    assert "\n" not in str(caught.value)
    assert time.perf_counter() - begin < 0.2


def test_long_but_honest_expressions_work() -> None:
    text = " + ".join(f"{i} * x" for i in range(100))
    assert value(text, x=1.0) == sum(range(100))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("2 * xx", "column 5: unknown name 'xx', did you mean 'x'"),
        ("  sine(x)", "column 3: unknown function 'sine', did you mean 'sin'"),
        ("x + 3 ^ 2", r"column 7: .*\*\*"),
        ("1 + sqrt", r"column 5: 'sqrt' is a function, write sqrt\(...\)"),
        ("x if t else y", r"where\(condition, a, b\)"),
        ("x + ", "column 4|column 5"),
    ],
)
def test_errors_name_the_column_and_what_to_write(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        compile_expression(text, NAMES)
