"""`turnbuckle bench`: how fast this machine is, beside the paper and other libraries."""

from typing import Annotated

import typer

from turnbuckle import benchmarks
from turnbuckle.cli.report_errors import report_errors

NAMES = ", ".join(benchmarks.REGISTRY)


@report_errors
def bench(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help=f"One of {NAMES}; all but the long ones when left out.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[OPTIONS]",
            help="Of the benchmark, such as --seconds 0.5; `python -m turnbuckle.benchmarks.NAME --help` lists them.",
        ),
    ] = None,
) -> None:
    """Run the benchmarks; each prints a table and writes it with a plot."""
    from turnbuckle.data.errors import InputError
    from turnbuckle.scene.suggestion import did_you_mean

    known = benchmarks.REGISTRY
    if name is not None and name not in known:
        raise InputError(f"there is no benchmark {name!r}{did_you_mean(name, known)}")
    given = {}
    if name is not None and options:
        from importlib import import_module

        from turnbuckle.benchmarks.contact_options import options as read

        given = read(import_module(f"turnbuckle.benchmarks.{name}").measure, options, f"turnbuckle bench {name}")
    for key in [name] if name is not None else [k for k in known if k not in benchmarks.LONG]:
        known[key](**given)
