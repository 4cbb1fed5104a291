"""The command with all its verbs. Importing this must stay fast: `turnbuckle --help` answers in 0.2 s."""

from typing import Annotated

import typer

from turnbuckle.cli.assemble import assemble
from turnbuckle.cli.bench import bench
from turnbuckle.cli.check import check
from turnbuckle.cli.convert import convert
from turnbuckle.cli.export import export
from turnbuckle.cli.import_ import import_
from turnbuckle.cli.run import run
from turnbuckle.cli.scenes import scenes
from turnbuckle.cli.schema import schema
from turnbuckle.cli.sweep import sweep
from turnbuckle.cli.view import view

app = typer.Typer(
    name="turnbuckle",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        try:
            typer.echo(f"turnbuckle {version('turnbuckle')}")
        except PackageNotFoundError:
            typer.echo("turnbuckle (not installed)")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Exact constrained dynamics of ropes, nets, cloth and deformable solids."""


for verb in (run, sweep, check, assemble, convert, import_, export, scenes, schema, view, bench):
    # what `bench` does not know belongs to the benchmark
    settings = {"ignore_unknown_options": True} if verb is bench else None
    app.command(name=verb.__name__.rstrip("_"), context_settings=settings)(verb)


def main() -> None:
    """Entry point. Exit code 0: done; 1: the simulation failed; 2: the input is wrong; 130: stopped by Ctrl-C."""
    app(prog_name="turnbuckle")
