"""The nearest known name, for error messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """`, did you mean 'x'?` for the known name nearest to `name`, or the few known names, or nothing.

    The comparison is bounded: only the first 60 characters of `name` and the first 500 known names count.
    """
    names = list(known)[:500]
    if not names:
        return ""
    near = difflib.get_close_matches(str(name)[:60], names, n=1, cutoff=0.6)
    if not near:
        lower = {n.lower(): n for n in names}
        near = [lower[m] for m in difflib.get_close_matches(str(name)[:60].lower(), list(lower), n=1, cutoff=0.6)]
    if near:
        return f", did you mean {near[0]!r}?"
    if len(names) <= 12:
        return f" (known: {', '.join(names)})"
    return ""
