"""The command with all its verbs. Importing this must stay fast: `turnbuckle --help` answers in 0.2 s."""

import typer

from turnbuckle.cli.bench import bench
from turnbuckle.cli.check import check
from turnbuckle.cli.run import run
from turnbuckle.cli.scenes import scenes
from turnbuckle.cli.schema import schema

app = typer.Typer(
    name="turnbuckle",
    help="Exact constrained dynamics of ropes, nets, cloth and deformable solids.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for verb in (run, check, scenes, schema, bench):
    app.command()(verb)


def main() -> None:
    """Entry point. Exit code 0: done; 1: the simulation failed; 2: the input is wrong; 130: stopped by Ctrl-C."""
    app(prog_name="turnbuckle")
