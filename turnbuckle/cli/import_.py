"""`turnbuckle import`: a scene from the file of another program."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import report_errors


@report_errors
def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .urdf, an MJCF .xml, or USD (.usd, .usda, .usdc).")],
    out: Annotated[Path, typer.Argument(metavar="SCENE", help="The scene to write, .yaml or .gascuel.")],
    shapes: Annotated[str, typer.Option(help="URDF: take collision or visual shapes.")] = "collision",
    contact: Annotated[
        bool, typer.Option("--contact", help="Turn contact on, but not between bodies that overlap at the start.")
    ] = False,
) -> None:
    """Read bodies, joints and couplings of FILE, write them as a scene, and name all that has no counterpart."""
    from turnbuckle.data.errors import InputError
    from turnbuckle.io.importing import import_scene

    if out.suffix.lower() not in (".yaml", ".yml", ".gascuel"):
        raise InputError(f"{out}: name the scene to write .yaml or .gascuel")
    if not out.absolute().parent.is_dir():
        raise InputError(f"{out}: there is no folder {str(out.parent)!r}")
    found = import_scene(file, shapes, contact)
    found.scene.save(out)
    for text in found.left_out:
        typer.echo(f"left out: {text}")
    definition = found.scene.definition
    typer.echo(f"{out}: {len(definition.bodies)} bodies, {len(definition.constraints)} constraints")
