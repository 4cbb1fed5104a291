"""Expressions of scene files, such as `-2 * x + where(t < 1, 5, 0)`: parsed safely into a NumPy closure.

Python's own grammar is used to parse, but nothing is ever evaluated by Python: the tree is walked, every node is
checked against a short list, and each becomes a closure over NumPy ufuncs. All values are float64 (a comparison gives
1.0 or 0.0), so no operation can grow: `9**9**9` is infinity, not a number of a million digits. Length, depth and
number of nodes are bounded, so no text can hang or exhaust the machine.
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.suggestion import did_you_mean

MAX_LENGTH = 1000  # characters
MAX_DEPTH = 150  # nested operations; a sum of n terms is n deep
MAX_NODES = 500  # operations, numbers and names together

Values = Mapping[str, Any]
Term = Callable[[Values], Any]

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.true_divide,
    ast.Pow: np.power,
}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
_HINTS: dict[type[ast.AST], str] = {
    ast.BitXor: "write ** for a power",
    ast.FloorDiv: "write floor(a / b)",
    ast.Mod: "write a - b * floor(a / b)",
    ast.BitAnd: "write 'and'",
    ast.BitOr: "write 'or'",
    ast.Invert: "write 'not'",
    ast.IfExp: "write where(condition, a, b)",
    ast.Attribute: "a name has no parts here",
    ast.Subscript: "there is nothing to index",
    ast.Lambda: "functions cannot be defined",
}


def _reduce(ufunc: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    def apply(*values: Any) -> Any:
        result = values[0]
        for value in values[1:]:
            result = ufunc(result, value)
        return result

    return apply


# name -> (function, fewest arguments, most arguments)
FUNCTIONS: dict[str, tuple[Callable[..., Any], int, int]] = {
    "sin": (np.sin, 1, 1),
    "cos": (np.cos, 1, 1),
    "tan": (np.tan, 1, 1),
    "exp": (np.exp, 1, 1),
    "log": (np.log, 1, 1),
    "sqrt": (np.sqrt, 1, 1),
    "abs": (np.abs, 1, 1),
    "floor": (np.floor, 1, 1),
    "min": (_reduce(np.minimum), 2, 20),
    "max": (_reduce(np.maximum), 2, 20),
    "clip": (lambda value, low, high: np.minimum(np.maximum(value, low), high), 3, 3),
    "where": (lambda condition, a, b: np.where(np.not_equal(condition, 0.0), a, b), 3, 3),
}
CONSTANTS = {"pi": np.float64(np.pi)}


@dataclass(frozen=True)
class Expression:
    """A compiled expression. `expression(x=..., t=...)` evaluates it on float64 arrays or numbers that broadcast."""

    text: str
    variables: tuple[str, ...]
    _term: Term = field(repr=False, compare=False)

    def __call__(self, **values: Any) -> np.ndarray:
        """Value, float64, of the broadcast shape of the variables it uses; may be NaN or infinite (log(-1), 1/0)."""
        with np.errstate(all="ignore"):
            return np.asarray(self._term(values), dtype=np.float64)


def compile_expression(text: str, variables: Sequence[str]) -> Expression:
    """Compile `text`, which may use `variables`, pi and `FUNCTIONS`.

    Raises `InputError`, with the column, for anything that is not such an expression.
    """
    return Expression(text, tuple(variables), _Compiler(text, tuple(variables)).compile())


class _Compiler:
    def __init__(self, text: str, variables: tuple[str, ...]) -> None:
        self.text = text
        self.variables = variables
        self.nodes = 0
        self.source = text.strip()
        self.shift = len(text) - len(text.lstrip())

    def fail(self, message: str, column: int | None = None) -> InputError:
        shown = self.text if len(self.text) <= 60 else self.text[:57] + "..."
        where = "" if column is None else f", column {column + 1}"
        return InputError(f"expression {shown!r}{where}: {message}")

    def fail_at(self, node: ast.AST, message: str) -> InputError:
        offset = getattr(node, "col_offset", 0)  # in bytes of UTF-8
        return self.fail(message, self.shift + len(self.source.encode()[:offset].decode(errors="ignore")))

    def compile(self) -> Term:
        if not self.source:
            raise self.fail("it is empty")
        if len(self.text) > MAX_LENGTH:
            raise self.fail(f"it is longer than {MAX_LENGTH} characters")
        try:
            self.source.encode()
            # A line break inside an expression is a blank, as in YAML's folded texts.
            source = self.source.replace("\r", " ").replace("\n", " ")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                tree = ast.parse(source, mode="eval")
        except SyntaxError as error:
            # At an unexpected end Python gives no column, or 0.
            column = self.shift + (error.offset - 1 if error.offset else len(self.source))
            raise self.fail(f"cannot be read ({error.msg.split('. Perhaps')[0]})", column) from None
        except (ValueError, RecursionError, MemoryError, OverflowError):
            raise self.fail("cannot be read (nested too deeply, or strange characters)") from None
        return self.term(tree.body, 0)

    def term(self, node: ast.expr, depth: int) -> Term:
        self.nodes += 1
        if depth > MAX_DEPTH or self.nodes > MAX_NODES:
            raise self.fail_at(node, "it is nested too deeply or too long")
        if isinstance(node, ast.Constant):
            return self.constant(node)
        if isinstance(node, ast.Name):
            return self.name(node)
        if isinstance(node, ast.BinOp):
            return self.binary(node, depth)
        if isinstance(node, ast.UnaryOp):
            return self.unary(node, depth)
        if isinstance(node, ast.BoolOp):
            return self.logic(node, depth)
        if isinstance(node, ast.Compare):
            return self.compare(node, depth)
        if isinstance(node, ast.Call):
            return self.call(node, depth)
        raise self.refuse(node, node)

    def refuse(self, node: ast.AST, kind: ast.AST) -> InputError:
        hint = _HINTS.get(type(kind), "use numbers, names, + - * / **, comparisons, and or not, and functions")
        return self.fail_at(node, f"this is not allowed: {hint}")

    def constant(self, node: ast.Constant) -> Term:
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            raise self.fail_at(node, f"expected a number, got {str(node.value)[:20]!r}")
        try:
            value = np.float64(node.value)
        except OverflowError:
            value = np.float64(np.inf)
        if not np.isfinite(value):
            raise self.fail_at(node, "the number is too large")
        return lambda values: value

    def name(self, node: ast.Name) -> Term:
        key = node.id
        if key in self.variables:
            return lambda values: np.asarray(values[key], dtype=np.float64)
        if key in CONSTANTS:
            constant = CONSTANTS[key]
            return lambda values: constant
        if key in FUNCTIONS:
            raise self.fail_at(node, f"{key!r} is a function, write {key}(...)")
        known = [*self.variables, *CONSTANTS]
        raise self.fail_at(node, f"unknown name {key[:40]!r}{did_you_mean(key, known)}")

    def binary(self, node: ast.BinOp, depth: int) -> Term:
        ufunc = _BINARY.get(type(node.op))
        if ufunc is None:
            # The tree does not say where the operator is: it comes after the left side, blanks and brackets.
            end = node.left.end_col_offset or 0
            rest = self.source.encode()[end:].decode(errors="ignore")
            node.col_offset = end + len(rest) - len(rest.lstrip(" )"))
            raise self.refuse(node, node.op)
        left, right = self.term(node.left, depth + 1), self.term(node.right, depth + 1)
        return lambda values: ufunc(left(values), right(values))

    def unary(self, node: ast.UnaryOp, depth: int) -> Term:
        if isinstance(node.op, ast.Invert):
            raise self.refuse(node, node.op)
        operand = self.term(node.operand, depth + 1)
        if isinstance(node.op, ast.USub):
            return lambda values: np.negative(operand(values))
        if isinstance(node.op, ast.Not):
            return lambda values: np.equal(operand(values), 0.0).astype(np.float64)
        return operand

    def logic(self, node: ast.BoolOp, depth: int) -> Term:
        terms = [self.term(value, depth + 1) for value in node.values]
        join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or

        def apply(values: Values) -> Any:
            result = np.not_equal(terms[0](values), 0.0)
            for term in terms[1:]:
                result = join(result, np.not_equal(term(values), 0.0))
            return result.astype(np.float64)

        return apply

    def compare(self, node: ast.Compare, depth: int) -> Term:
        """A chain `a < b < c` means a < b and b < c."""
        terms = [self.term(value, depth + 1) for value in (node.left, *node.comparators)]
        for op in node.ops:
            if type(op) not in _COMPARE:
                raise self.refuse(node, op)
        ufuncs = [_COMPARE[type(op)] for op in node.ops]

        def apply(values: Values) -> Any:
            sides = [term(values) for term in terms]
            result = ufuncs[0](sides[0], sides[1])
            for i in range(1, len(ufuncs)):
                result = np.logical_and(result, ufuncs[i](sides[i], sides[i + 1]))
            return result.astype(np.float64)

        return apply

    def call(self, node: ast.Call, depth: int) -> Term:
        if not isinstance(node.func, ast.Name):
            raise self.fail_at(node, "only the functions " + ", ".join(FUNCTIONS) + " can be called")
        key = node.func.id
        if key not in FUNCTIONS:
            raise self.fail_at(node, f"unknown function {key[:40]!r}{did_you_mean(key, FUNCTIONS)}")
        function, fewest, most = FUNCTIONS[key]
        if node.keywords or any(isinstance(value, ast.Starred) for value in node.args):
            raise self.fail_at(node, f"{key} takes plain arguments only")
        if not fewest <= len(node.args) <= most:
            wanted = str(fewest) if fewest == most else f"{fewest} to {most}"
            raise self.fail_at(node, f"{key} takes {wanted} arguments, got {len(node.args)}")
        terms = [self.term(value, depth + 1) for value in node.args]
        return lambda values: function(*[term(values) for term in terms])
