"""Tokens to nested dicts and lists as in a scene file, with the place in the text of everything.

    file      = { block }
    block     = ("world" | "object" NAME | "force" | "constraint" | "skin") { statement [";"] } "end" [";"]
    statement = WORD values { OPTION values }

Which words there are, and which values follow them, is read off the definitions (`words.py`, `forms.py`).
A `;` may be left out, for it is always known how many values a word takes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

from turnbuckle.scene.base_definition import Definition
from turnbuckle.scene.definitions import JointDef, SceneDef
from turnbuckle.scene.language.forms import Form, form_of, types_in
from turnbuckle.scene.language.tokens import LanguageError, Position, Token, tokenise
from turnbuckle.scene.language.values import MAX_DEPTH, Place, Values
from turnbuckle.scene.language.words import (
    BLOCKS,
    FLAGS,
    LISTS,
    MEANING,
    POSITIONAL,
    all_words,
    normal,
    pairs_of,
    short_of,
    word_of,
    words_of,
)
from turnbuckle.scene.suggestion import did_you_mean

PAPER = ("object1", "object2", "hinge", "axial", "planar", "angle", "twist")
WITHIN = ("min", "max", "stiffness", "damping")  # of a statement, not by themselves
NAMING = ("object1", "object2", "on", "of")
DEFAULT_TYPES = {"object": "rigid", "constraint": "joint"}


@dataclass
class Description:
    """What a text says. `data`: nested dicts and lists of the fields of `SceneDef`; `places`: where each is written."""

    data: dict[str, Any] = field(default_factory=lambda: {name: [] for name in LISTS.values()})
    places: dict[Place, Position] = field(default_factory=lambda: {(): Position(1, 1)})
    has_world: bool = False


def parse(text: str) -> Description:
    """What a text says, not yet validated. Raises `LanguageError` at the first token that does not fit."""
    return _Parser(tokenise(text)).file()


@cache
def classes_of(kind: str) -> dict[str, type[Definition]]:
    """The definitions that a block may become, by type."""
    if kind in DEFAULT_TYPES:
        return types_in(SceneDef, LISTS[kind])
    return {kind: form_of(SceneDef, LISTS[kind]).records[0]} if kind in LISTS else {kind: SceneDef}


class _Parser(Values):
    def __init__(self, tokens: list[Token]) -> None:
        self.result = Description()
        super().__init__(tokens, self.result.places)

    # blocks

    def file(self) -> Description:
        while self.token.kind != "end of file":
            if self.skip(";"):
                continue
            if self.token.kind != "word" or self.token.written not in BLOCKS:
                near = did_you_mean(self.token.written, BLOCKS) if self.token.kind == "word" else ""
                near = near if near.startswith(", did") else ""
                if normal(self.token.written) in all_words(JointDef):
                    near = ", which stands in a constraint"
                raise self.expected("'constraint', 'object', 'force', 'skin' or 'world'", near)
            self.block()
        return self.result

    def block(self) -> None:
        opener = self.take()
        kind = opener.written
        place: Place = ()
        item = self.result.data
        if kind in LISTS:
            items = self.result.data[LISTS[kind]]
            place, item = (LISTS[kind], len(items)), {}
            items.append(item)
            self.places[place] = opener.position
        elif self.result.has_world:
            raise LanguageError(opener.position, "there is already a 'world' in this file")
        else:
            self.result.has_world = True
        if kind == "object":
            self.places[*place, "name"] = self.token.position
            item["name"] = self.text("the name of the object")
        block = _Block(kind, opener, place, item, classes_of(kind))
        if kind in DEFAULT_TYPES:
            item["type"] = self.type_of(block)
            block.kind_of = block.classes[item["type"]]
        while not (self.token.kind == "word" and self.token.written == "end"):
            if not self.skip(";"):
                self.statement(block)
        self.take()

    def type_of(self, block: _Block) -> str:
        while self.skip(";"):
            pass
        if not (self.token.kind == "word" and self.token.written == "type"):
            return DEFAULT_TYPES[block.name]
        self.take()
        self.places[*block.place, "type"] = self.token.position
        known = list(block.classes)
        if self.token.kind not in ("word", "text") or self.token.value not in known:
            near = did_you_mean(self.token.value, known)
            listed = "" if not near.startswith(", did") else f" (known: {', '.join(known)})"
            raise self.expected(f"a type of {block.name}", near + listed)
        name = str(self.take().value)
        self.after("type")
        return name

    def statement(self, block: _Block) -> None:
        if self.token.kind != "word":
            words = [w for w in all_words(block.kind_of) if w not in ("type", "name")]
            some = ", ".join([w for w in PAPER if w in words] or words[:6])
            raise self.expected(f"a statement such as {some}, or 'end'")
        token = self.token
        word = normal(token.written)
        kind = block.kind_of
        if word in pairs_of(kind):
            self.take()
            self.pair(word, kind, block.place, block.item, token)
        elif word in short_of(kind):
            self.take()
            name, value = short_of(kind)[word]
            self.once(block.item, name, block.place, token)
            block.item[name] = value
        elif word == "type" and block.name in DEFAULT_TYPES:
            raise LanguageError(token.position, f"'type' is said once, and before all else in the {block.name}")
        elif word in words_of(kind) and not (block.name == "world" and words_of(kind)[word] in LISTS.values()):
            self.take()
            self.field(kind, words_of(kind)[word], block.place, block.item, token)
        else:
            raise self.unknown(block)
        self.after(word)

    def after(self, word: str) -> None:
        """A statement is followed by `;`, or by a word that begins the next."""
        if self.skip(";") or self.token.kind == "word":
            return
        if self.token.kind == "end of file":
            raise self.expected("';' and 'end'")
        raise self.expected(f"';' after {word!r} and its values")

    def unknown(self, block: _Block) -> LanguageError:
        token, word, what = self.token, normal(self.token.written), block.name
        if token.written in BLOCKS:
            line = block.opener.position.line
            return self.expected(f"a statement or 'end' of the {what} that line {line} begins")
        others = [name for name, kind in block.classes.items() if word in all_words(kind)]
        if word in WITHIN and block.kind_of is JointDef:
            text = f"'{word}' belongs before the ';' of axial, planar, sphere, angle or twist"
        elif others and others != ["world"]:
            said = ", ".join(others[:4]) + (", ..." if len(others) > 4 else "")
            text = f"'{word}' is said of type {said}; begin the {what} with 'type {others[0]};'"
        else:
            known = [w for w in all_words(block.kind_of) if w != "type"] + ["end"]
            near = did_you_mean(word, known)
            text = f"unknown statement '{word[:40]}' in the {what}{near}"
        return LanguageError(token.position, text)

    # fields

    def once(self, item: dict[str, Any], name: str, place: Place, token: Token) -> None:
        here = (*place, name)
        if name in item:
            line = self.places[here].line
            raise LanguageError(token.position, f"'{normal(token.written)}' is given twice (first in line {line})")
        self.places[here] = token.position

    def pair(self, word: str, kind: type[Definition], place: Place, item: dict[str, Any], token: Token) -> None:
        """Two vectors, one after the other."""
        for name in pairs_of(kind)[word]:
            self.once(item, name, place, token)
        self.row_of_rows(word, list(pairs_of(kind)[word]), [3, 3], place, item)

    def field(self, kind: type[Definition], name: str, place: Place, item: dict[str, Any], token: Token) -> None:
        """The values of a field, put into `item`."""
        form = form_of(kind, name)
        here = (*place, name)
        if form.records or form.groups:
            entries = item.setdefault(name, [])
            self.places.setdefault(here, token.position)
            inner = (*here, len(entries))
            self.places[inner] = token.position
            if form.records:
                entries.append(self.record(form.records, inner, token.written))
            else:
                entries.append(self.group(form, inner))
            return
        self.once(item, name, place, token)
        item[name] = self.value(form, name, here, token.written)

    def value(self, form: Form, name: str, here: Place, word: str) -> Any:
        token = self.token
        if form.record and not (form.array and (token.kind in ("number", "text") or self.is_rows())):
            return self.record(form.record, here, word)
        if form.array:
            return self.array(form, here, word)
        if form.texts:
            return self.texts(word)
        if form.flag:
            if token.kind == "word" and token.written in FLAGS:
                return FLAGS[self.take().written]
            return True
        if form.number and not (form.text and token.kind != "number"):
            return self.number(name, form, word)
        if word == "object1" and token.kind == "word" and token.written == "world":
            self.take()
            return None
        if token.kind == "word" and token.written in form.options:
            return self.take().written
        what = "one of " + ", ".join(form.options) if form.options else f"a word after '{word}'"
        return self.text(f"the name of an object after '{word}'" if word in NAMING else what)

    # records

    def group(self, form: Form, here: Place) -> list[Any]:
        """Records in parentheses, one after the other."""
        found: list[Any] = []
        while self.is_mark("("):
            self.places[*here, len(found)] = self.token.position
            found.append(self.record(form.groups, (*here, len(found)), "("))
        if not found:
            raise self.expected("'(' before each of the points")
        return found

    def record(self, kinds: tuple[type[Definition], ...], here: Place, word: str) -> dict[str, Any]:
        """The fields of a definition in a statement: first those without a word, then the others by their words."""
        if sum(isinstance(part, str) for part in here) > MAX_DEPTH:
            raise LanguageError(self.token.position, f"parentheses nested more than {MAX_DEPTH} deep")
        given = POSITIONAL.get(kinds[0], ())
        rows = bool(given) and any(len(shape) > 1 for shape in form_of(kinds[0], given[0]).shapes)
        opened = not (rows and self.is_rows(1)) and self.skip("(")
        first = normal(self.token.written)
        kind = next((k for k in kinds if first in all_words(k)), kinds[0])
        item: dict[str, Any] = {}
        given = POSITIONAL.get(kind, ())
        self.positional(kind, given, here, item, normal(word))
        options = [w for w in all_words(kind) if words_of(kind).get(w) not in given]
        while self.token.kind == "word" and normal(self.token.written) in options:
            token = self.take()
            option = normal(token.written)
            if option in pairs_of(kind):
                self.pair(option, kind, here, item, token)
            else:
                self.field(kind, words_of(kind)[option], here, item, token)
        if opened and not self.skip(")"):
            raise self.expected(f"{', '.join(options[:6]) or 'nothing more'} or ')'")
        if not opened and self.token.kind not in ("word", "mark", "end of file"):
            more = [w for w in options if words_of(kind).get(w) not in item]
            raise self.expected(f"{', '.join(more[:6])} or ';'" if more else "';'")
        return item

    def positional(
        self, kind: type[Definition], given: tuple[str, ...], here: Place, item: dict[str, Any], word: str
    ) -> None:
        forms = [form_of(kind, name) for name in given]
        plain = [form.number or (form.array and form.lengths == {3}) for form in forms]
        if given and all(plain):
            self.row_of_rows(word, list(given), [0 if form.number else 3 for form in forms], here, item)
            return
        for name, form in zip(given, forms, strict=True):
            self.places[*here, name] = self.token.position
            if form.text and self.token.kind not in ("word", "text"):
                raise self.expected(f"{MEANING.get(word, word_of(kind, name))}")
            item[name] = self.value(form, name, (*here, name), word)


@dataclass
class _Block:
    """A block that is being read."""

    name: str
    opener: Token
    place: Place
    item: dict[str, Any]
    classes: dict[str, type[Definition]]

    def __post_init__(self) -> None:
        self.kind_of = next(iter(self.classes.values()))
