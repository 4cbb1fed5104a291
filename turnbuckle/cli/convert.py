"""`turnbuckle convert`: a scene from YAML to the description language and back, or a ready scene to either."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import report_errors


@report_errors
def convert(
    scene: Annotated[str, typer.Argument(metavar="IN", help="A scene file, or the name of a ready scene.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write, .yaml or .gascuel.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a field or a parameter.")
    ] = None,
) -> None:
    """Write the scene IN as OUT, without loss. Long arrays go into a file beside OUT."""
    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.data.errors import InputError

    if out.suffix.lower() not in (".yaml", ".yml", ".gascuel"):
        raise InputError(f"{out}: name the file to write .yaml or .gascuel")
    loaded = load_scene(scene, set_ or [])
    loaded.save(out)
    typer.echo(f"{out}: {len(loaded.definition.bodies)} bodies, {len(loaded.definition.constraints)} constraints")
