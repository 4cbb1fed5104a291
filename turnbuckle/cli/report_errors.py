"""From the errors of the library to a line on the terminal and an exit code. No traceback for what is expected."""

import functools
import os
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import typer

from turnbuckle.data.errors import InputError, StepError, TurnbuckleError

F = TypeVar("F", bound=Callable[..., Any])

FAILED, WRONG_INPUT, STOPPED = 1, 2, 130
LONGEST = 2000  # characters of a message


def report_errors(verb: F) -> F:
    """Decorate a verb: 2 for wrong input, 1 for a failed simulation, 130 after Ctrl-C, each with its sentence."""

    @functools.wraps(verb)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return verb(*args, **kwargs)
        except InputError as error:
            _say(error, "wrong input")
            raise typer.Exit(WRONG_INPUT) from None
        except TurnbuckleError as error:
            _say(error, "failed")
            raise typer.Exit(FAILED) from None
        except MemoryError as error:
            _say(
                InputError(f"asks for more memory than there is ({error or 'no more is known'}); make it smaller"),
                "wrong input",
            )
            raise typer.Exit(WRONG_INPUT) from None
        except KeyboardInterrupt:
            typer.echo("stopped; what was written so far is whole", err=True)
            raise typer.Exit(STOPPED) from None
        except BrokenPipeError:
            # The reader of our output has gone (`turnbuckle schema | head`): not an error of ours.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except OSError as error:  # a disk that is full, a folder that refuses: told by its name
            place = f"{error.filename}: " if error.filename else ""
            _say(StepError(f"{place}cannot be read or written ({error.strerror or error})"), "failed")
            raise typer.Exit(FAILED) from None

    return wrapped  # type: ignore[return-value]


def _say(error: Exception, kind: str) -> None:
    text = str(error)
    if len(text) > LONGEST:  # a name of thousands of letters, quoted
        error = TurnbuckleError(f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}")
    typer.echo(f"turnbuckle: {kind}: {error}" if "\n" not in str(error) else f"turnbuckle: {kind}:\n{error}", err=True)
