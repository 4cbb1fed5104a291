"""`turnbuckle bench`: how fast this machine is, beside the paper and other libraries."""

from typing import Annotated

import typer

from turnbuckle import benchmarks
from turnbuckle.cli.report_errors import report_errors

NAMES = ", ".join(benchmarks.REGISTRY)


@report_errors
def bench(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help=f"One of {NAMES}; all when left out.")] = None,
) -> None:
    """Run the benchmarks; each prints a table and writes it with a plot."""
    from turnbuckle.data.errors import InputError
    from turnbuckle.scene.suggestion import did_you_mean

    known = benchmarks.REGISTRY
    if name is not None and name not in known:
        raise InputError(f"there is no benchmark {name!r}{did_you_mean(name, known)}")
    for key in [name] if name is not None else list(known):
        known[key]()
