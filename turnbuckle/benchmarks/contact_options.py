"""A benchmark's options from the command line: the keyword-only parameters of its `measure`."""

import argparse
import inspect
from collections.abc import Callable, Sequence
from typing import Any


def options(
    measure: Callable[..., Any], words: Sequence[str] | None = None, program: str | None = None
) -> dict[str, Any]:
    """Values for the keyword-only parameters of ``measure`` from words such as `--seconds 0.5 --no-peers --counts 4 8`.

    ``program`` is the name that help shows. A parameter is a number, a text, a bool (`--name`, `--no-name`) or a tuple of
    numbers, as its default is. Exits with argparse's message where a word is not understood.
    """
    parser = argparse.ArgumentParser(
        prog=program, description=inspect.getdoc(measure), formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    for name, parameter in inspect.signature(measure).parameters.items():
        if parameter.kind is not inspect.Parameter.KEYWORD_ONLY:
            continue
        flag, default = "--" + name.replace("_", "-"), parameter.default
        if isinstance(default, bool):
            parser.add_argument(flag, action=argparse.BooleanOptionalAction, default=default, help=" ")
        elif isinstance(default, tuple):
            parser.add_argument(flag, type=type(default[0]), nargs="+", default=default, help=" ")
        else:
            parser.add_argument(flag, type=type(default), default=default, help=" ")
    return vars(parser.parse_args(words))


def run_as_command(measure: Callable[..., Any]) -> None:
    """Measure with the options of the command line."""
    measure(**options(measure))
