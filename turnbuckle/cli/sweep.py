"""`turnbuckle sweep`: many runs of one scene with other values."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import FAILED, report_errors


@report_errors
def sweep(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a ready scene.")],
    vary: Annotated[
        list[str],
        typer.Option(metavar="PATH=VALUES", help="first:last:count, first:last:count:log, or a,b,c; may be repeated."),
    ],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="A field or parameter that all runs share.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Where to; sweep_SCENE when left out.")] = None,
    together: Annotated[
        bool, typer.Option("--together", help="The first values of all, then the second ones; not all combinations.")
    ] = False,
    record: Annotated[
        list[str] | None, typer.Option(metavar="SUFFIX", help="Record each run: npz, vtkhdf, usdc, png, gif, mp4.")
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH", help="A further column, such as energies.kinetic or bodies.cloth.lowest.2."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Try runs again that failed before.")] = False,
    processes: Annotated[int | None, typer.Option(metavar="N", help="Processes of this machine, one a core.")] = None,
    cluster: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, such as tcp://127.0.0.1:8786.")
    ] = None,
    device: Annotated[str, typer.Option(help="Where to compute: cpu, cuda:0, ...")] = "cpu",
) -> None:
    """Run SCENE once for each combination of values, a folder each; ends with a table and a plot.

    Runs that are done are not run again, so the same command goes on after a break. Exit code 1 when a run failed.
    """
    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.cli.sweep_progress import SweepProgress
    from turnbuckle.data.errors import InputError
    from turnbuckle.scene.scene import Scene
    from turnbuckle.sweeps.source import with_fields
    from turnbuckle.sweeps.values import Values, parse_vary, text_of

    lists = {}
    for asked in vary:
        path, values = parse_vary(asked)
        if path in lists:
            raise InputError(f"--vary {asked}: {path} is varied twice; give all its values at once")
        lists[path] = values
    shared = list(set_ or [])
    for assignment in shared:
        if assignment.partition("=")[0].strip() in lists:
            raise InputError(f"--set {assignment}: is varied too; leave out one of the two")

    from turnbuckle.sweeps.sweep import sweep_made

    loaded = load_scene(scene, shared) if _is_file(scene) else None  # a file is read once, and wrong input told once

    def make(values: Values) -> Scene:
        if loaded is not None:
            return with_fields(loaded, values)
        return load_scene(scene, [*shared, *(f"{path}={text_of(value)}" for path, value in values.items())])

    name = loaded.name if loaded is not None else scene
    with SweepProgress(name) as bar:
        result = sweep_made(
            name,
            make,
            lists,
            out=out,
            together=together,
            record=record or [],
            measure=measure or [],
            retry=retry,
            processes=processes,
            cluster=cluster,
            device=device,
            progress=bar.update,
        )
    typer.echo(result.table())
    failed = len(result.failed)
    typer.echo(f"{len(result.runs)} runs, {failed} failed{' (--retry tries them again)' if failed else ''}")
    for note in result.notes:
        typer.echo(note)
    if failed:
        raise typer.Exit(FAILED)


def _is_file(scene: str) -> bool:
    from turnbuckle.scenes import REGISTRY

    return scene not in REGISTRY
