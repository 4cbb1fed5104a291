"""`turnbuckle check`: validate a scene, count what is in it, warn of what will not go well, draw its graph."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from turnbuckle.cli.report_errors import report_errors

if TYPE_CHECKING:
    from turnbuckle.scene.language.reader import ConstraintsOnly


@report_errors
def check(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a ready scene.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a field or a parameter.")
    ] = None,
    graph: Annotated[
        Path | None, typer.Option(metavar="FILE.svg", help="Draw the graph of constrained objects.")
    ] = None,
) -> None:
    """Validate SCENE, count points, springs, tetrahedra and constraints, and warn. Simulates nothing.

    A .gascuel file of constraints alone is checked for itself, and says which objects it needs.
    """
    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.data.errors import InputError
    from turnbuckle.scene.graph.edges import constraint_graph
    from turnbuckle.scene.graph.svg import write_graph
    from turnbuckle.scene.language.reader import is_description, read_constraints_only

    alone = read_constraints_only(scene) if is_description(scene) else None
    if alone is not None:
        if set_:
            raise InputError("--set needs a whole scene; this file describes constraints only")
        if graph is not None:
            write_graph(constraint_graph(alone.definition), graph, Path(scene).stem)
        _tell([*_counts_alone(scene, alone)], alone.warnings)
        return
    from turnbuckle.scene.check import inspect_scene

    loaded = load_scene(scene, set_ or [])
    if graph is not None:
        write_graph(constraint_graph(loaded.definition), graph, loaded.name)
    result = inspect_scene(loaded)
    _tell(result.counts, result.warnings)


def _counts_alone(scene: str, alone: "ConstraintsOnly") -> list[tuple[str, str]]:
    from turnbuckle.scene.graph.edges import KINDS, constraint_graph

    graph = constraint_graph(alone.definition)
    rows = [("description", f"{scene}, constraints only")]
    rows += [(f"constraints: {kind}", str(graph.count(kind))) for kind in KINDS if graph.count(kind)]
    if alone.definition.forces:
        rows.append(("forces", str(len(alone.definition.forces))))
    return [*rows, ("needs the objects", ", ".join(alone.needed) or "none")]


def _tell(counts: list[tuple[str, str]], warnings: list[str]) -> None:
    for label, value in counts:
        typer.echo(f"{label:<28} {value}")
    for warning in warnings:
        typer.echo(f"warning: {warning}")
    typer.echo(f"{len(warnings)} warning{'s' * (len(warnings) != 1)}")
