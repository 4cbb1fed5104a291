"""Tokens to values: texts, numbers, rows of numbers, each with its place in the text."""

from __future__ import annotations

from typing import Any

from turnbuckle.scene.language.forms import Form
from turnbuckle.scene.language.tokens import LanguageError, Position, Token
from turnbuckle.scene.language.words import INFINITE, MEANING, RESERVED, STRUCTURE, normal

Place = tuple[str | int, ...]
MAX_DEPTH = 10  # parentheses in parentheses
LIMITS = {"min": -1.0, "lower_limit": -1.0, "max": 1.0, "upper_limit": 1.0}  # and the sign of "unlimited"


class Values:
    """Reads values off a list of tokens. `places`: where the text says what, by the place in the data."""

    def __init__(self, tokens: list[Token], places: dict[Place, Position]) -> None:
        self.tokens = tokens
        self.at = 0
        self.places = places

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def take(self) -> Token:
        token = self.token
        self.at += token.kind != "end of file"
        return token

    def is_mark(self, mark: str) -> bool:
        return self.token.kind == "mark" and self.token.written == mark

    def skip(self, mark: str) -> bool:
        found = self.is_mark(mark)
        self.at += found
        return found

    def expected(self, what: str, extra: str = "") -> LanguageError:
        return LanguageError(self.token.position, f"expected {what}, got {self.token.shown()}{extra}")

    def is_rows(self, depth: int = MAX_DEPTH) -> bool:
        """Whether rows of numbers follow, nested at most `depth` deep, and not a record in parentheses."""
        at = self.at
        while self.tokens[at].kind == "mark" and self.tokens[at].written == "(":
            at += 1
        return 0 < at - self.at <= depth and self.tokens[at].kind == "number"

    def text(self, what: str) -> str:
        token = self.token
        if token.kind == "text":
            return str(self.take().value)
        if token.kind in ("mark", "end of file"):
            raise self.expected(what)
        if token.kind == "number":
            raise self.expected(what, "; a name of digits stands in quotes")
        after = self.tokens[self.at + 1]
        if token.written in RESERVED and (token.written in STRUCTURE or after.kind != "mark" or after.written != ";"):
            raise self.expected(what, ", which is a word of the language; a name like it stands in quotes")
        return self.take().written

    def number(self, name: str, form: Form, word: str) -> int | float | None:
        token = self.token
        if token.written in INFINITE and token.kind != "text":
            if not form.optional or LIMITS.get(name) != INFINITE[token.written]:
                raise self.expected(f"a finite number after '{normal(word)}'")
            self.take()
            return None
        if token.kind != "number":
            raise self.expected(f"a number after '{normal(word)}'")
        return self.take().value  # type: ignore[return-value]

    def texts(self, word: str) -> list[Any]:
        found: list[Any] = []
        if self.skip("("):
            while not self.skip(")"):
                if self.token.kind in ("mark", "end of file"):
                    raise self.expected("a name or ')'")
                found.append(self.take().value)
            return found
        while self.token.kind in ("number", "text"):
            found.append(self.take().value)
        if not found:
            raise self.expected(f"numbers or texts in quotes after '{normal(word)}'")
        return found

    # numbers

    def array(self, form: Form, here: Place, word: str) -> Any:
        """A row of numbers, rows in parentheses, or the name of a file."""
        if self.token.kind == "text":
            return self.take().value
        if self.is_mark("("):
            rows: list[Any] = []
            while self.is_mark("("):
                self.places[*here, len(rows)] = self.token.position
                rows.append(self.rows(0))
            return rows
        lengths = form.lengths
        if lengths:
            item: dict[str, Any] = {}
            self.row_of_rows(word, [str(here[-1])], [max(lengths)], here[:-1], item)
            return item[str(here[-1])]
        row: list[Any] = []
        while self.token.kind == "number":
            self.places[*here, len(row)] = self.token.position
            row.append(self.take().value)
        if not row:
            raise self.expected(f"numbers after '{normal(word)}'")
        return row

    def rows(self, depth: int) -> list[Any]:
        if depth == MAX_DEPTH:
            raise LanguageError(self.token.position, f"parentheses nested more than {MAX_DEPTH} deep")
        self.take()
        found: list[Any] = []
        while not self.skip(")"):
            if self.is_mark("("):
                found.append(self.rows(depth + 1))
            elif self.token.kind == "number":
                found.append(self.take().value)
            else:
                raise self.expected("a number or ')'")
        return found

    def row_of_rows(self, word: str, names: list[str], counts: list[int], place: Place, item: dict[str, Any]) -> None:
        """The numbers of several fields, one after the other; a count of 0 is a plain number and not a row."""
        need, got = sum(max(count, 1) for count in counts), 0
        for name, count in zip(names, counts, strict=True):
            here = (*place, name)
            self.places.setdefault(here, self.token.position)
            if count and self.token.kind == "text":  # the name of a file with the numbers
                item[name] = self.take().value
                got += count
                continue
            row: list[Any] = []
            for k in range(max(count, 1)):
                if self.token.kind != "number":
                    meaning = f" ({MEANING[word]})" if word in MEANING else ""
                    text = f"{need} numbers{meaning}, got {got}, then" if need > 1 else f"a number{meaning}, got"
                    raise LanguageError(self.token.position, f"'{normal(word)}' needs {text} {self.token.shown()}")
                if count:
                    self.places[*here, k] = self.token.position
                row.append(self.take().value)
                got += 1
            item[name] = row if count else row[0]
