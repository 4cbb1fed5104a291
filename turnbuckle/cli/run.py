"""`turnbuckle run`: simulate a scene and write what is asked for."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import FAILED, report_errors


@report_errors
def run(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a ready scene.")],
    duration: Annotated[float | None, typer.Option(help="Simulated time [s].")] = None,
    dt: Annotated[float | None, typer.Option(help="Time step [s].")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="PATH=VALUE", help="Change a field or a parameter, such as bodies.rope.density=3."
        ),
    ] = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .npz, .vtkhdf, .usdc, .png, .gif or .mp4; may be repeated."),
    ] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the report as JSON.")] = None,
    checkpoint: Annotated[Path | None, typer.Option(metavar="FILE", help="Save the state as the run goes.")] = None,
    every: Annotated[int | None, typer.Option(metavar="N", help="Steps between two checkpoints.")] = None,
    resume: Annotated[Path | None, typer.Option(metavar="FILE", help="Go on from a checkpoint.")] = None,
    device: Annotated[str, typer.Option(help="Where to compute: cpu, cuda:0, ...")] = "cpu",
) -> None:
    """Simulate SCENE. Ends with a certificate; exit code 1 when the simulation failed, 2 when the input is wrong."""
    from turnbuckle.cli.progress import RunProgress
    from turnbuckle.cli.run_options import check_options
    from turnbuckle.cli.scene_argument import load_scene

    check_options(duration, dt, out or [], report, checkpoint, every, resume)
    loaded = load_scene(scene, set_ or [])

    from turnbuckle.run.run import run as run_scene  # after the scene: wrong input is told before kernels are loaded

    with RunProgress(loaded.name) as progress:
        result = run_scene(
            loaded,
            duration=duration,
            dt=dt,
            out=list(out or []),
            report=report,
            checkpoint=checkpoint,
            every=every,
            resume=resume,
            device=device,
            progress=progress.update,
        )
    typer.echo(result.certificate())
    if result.status != "done":
        raise typer.Exit(FAILED)
