"""Text to tokens: words, numbers, quoted texts, and the marks `;` `(` `)`, each with its place. Comments are dropped."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

from turnbuckle.data.errors import InputError

MAX_CHARACTERS = 200_000_000
MAX_DIGITS = 400  # no number worth having is longer; conversion of digits is quadratic

NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
WORD = re.compile(r"[^\W\d][\w.\-]*")
_LINE_END = re.compile(r"\r\n|\r|\n")
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_PART = re.compile(
    r"(?P<line>\r\n|\r|\n)|(?P<blank>[^\S\r\n]+)|(?P<comment>/\*.*?(?:\*/|\Z))|(?P<mark>[;()])"
    r'|(?P<text>"(?:[^"\\\r\n]|\\[^\r\n])*"?)|(?P<run>(?:[^\s;()"/]|/(?!\*))+)',
    re.DOTALL,
)
_BRACES = "braces in the paper's grammar mark what may be left out, leave them out; ( ) hold rows and records"
_ADVICE = {
    "{": _BRACES,
    "}": _BRACES,
    "[": "rows of numbers are written in ( ), not in [ ]",
    "]": "rows of numbers are written in ( ), not in [ ]",
    ",": "values are set apart by blanks, not by commas",
    "=": "a value follows its word without '='",
    "'": "texts are quoted by \" and not by '",
}


@dataclass(frozen=True)
class Position:
    """A place in a text, both counted from 1."""

    line: int
    column: int


class LanguageError(InputError):
    """The text is not what the language allows at `position`."""

    def __init__(self, position: Position, message: str) -> None:
        super().__init__(message)
        self.position = position


@dataclass(frozen=True)
class Token:
    """`kind`: "number", "word", "text" (quoted), "odd" (letters and signs that are neither), "mark", or "end of file".

    `value`: the number, the text between the quotes, or what is written; `written`: as it stands in the file.
    """

    kind: str
    value: int | float | str
    written: str
    position: Position

    def shown(self) -> str:
        """The token for an error message."""
        if self.kind == "end of file":
            return "the end of the file"
        short = self.written if len(self.written) <= 40 else self.written[:37] + "..."
        return short if self.kind == "text" else f"'{short}'"


def tokenise(text: str) -> list[Token]:
    """All tokens of a text, the last of kind "end of file". Raises `LanguageError`."""
    if len(text) > MAX_CHARACTERS:
        raise LanguageError(Position(1, 1), f"longer than {MAX_CHARACTERS} characters; keep large arrays in .npz files")
    tokens = []
    line, begin, at = 1, 0, 0  # `begin`: where the line begins
    while at < len(text):
        match = _PART.match(text, at)
        position = Position(line, at - begin + 1)
        if match is None:  # only characters that cannot stand anywhere are left
            raise LanguageError(position, f"the character U+{ord(text[at]):04X} does not belong here")
        kind, written = match.lastgroup, match.group()
        if kind in ("run", "text", "mark"):
            tokens.append(_token(str(kind), written, position))
        elif kind == "line":
            line, begin = line + 1, match.end()
        elif kind == "comment":
            if len(written) < 4 or not written.endswith("*/"):
                raise LanguageError(position, "this comment is never closed; end it with '*/'")
            for end in _LINE_END.finditer(written):
                line, begin = line + 1, at + end.end()
        at = match.end()
    tokens.append(Token("end of file", "", "", Position(line, at - begin + 1)))
    return tokens


def _token(kind: str, written: str, position: Position) -> Token:
    strange = _UNPRINTABLE.search(written)
    if strange:
        place = Position(position.line, position.column + strange.start())
        raise LanguageError(place, f"the character U+{ord(strange.group()):04X} does not belong in a text file")
    if kind == "mark":
        return Token("mark", written, written, position)
    if kind == "text":
        if len(written) < 2 or not written.endswith('"'):
            raise LanguageError(position, "this quote is not closed on its line; end it with '\"'")
        try:
            return Token("text", json.loads(written), written, position)
        except ValueError:
            raise LanguageError(position, 'a quoted text knows \\" \\\\ \\n \\t and \\uXXXX, and no other \\') from None
    if NUMBER.fullmatch(written) and len(written) <= MAX_DIGITS:
        return Token("number", number(written), written, position)
    if WORD.fullmatch(written):
        return Token("word", written, written, position)
    if written.startswith(("//", "#", "%")):
        raise LanguageError(position, "comments are written /* ... */")
    for sign, advice in _ADVICE.items():
        if sign in written:
            raise LanguageError(Position(position.line, position.column + written.index(sign)), advice)
    return Token("odd", written, written, position)


def number(written: str) -> int | float:
    """The number written: whole where it is written so."""
    return float(written) if any(c in written for c in ".eE") else int(written)
