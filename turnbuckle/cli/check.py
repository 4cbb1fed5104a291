"""`turnbuckle check`: validate a scene, count what is in it, warn of what will not go well."""

from typing import Annotated

import typer

from turnbuckle.cli.report_errors import report_errors


@report_errors
def check(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a ready scene.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a field or a parameter.")
    ] = None,
) -> None:
    """Validate SCENE, count points, springs, tetrahedra and constraints, and warn. Simulates nothing."""
    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.scene.check import inspect_scene

    result = inspect_scene(load_scene(scene, set_ or []))
    for label, value in result.counts:
        typer.echo(f"{label:<28} {value}")
    for warning in result.warnings:
        typer.echo(f"warning: {warning}")
    typer.echo(f"{len(result.warnings)} warning{'s' * (len(result.warnings) != 1)}")
