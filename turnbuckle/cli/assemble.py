"""`turnbuckle assemble`: bring the bodies of a scene to where all its joints hold."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import FAILED, report_errors


@report_errors
def assemble(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a ready scene.")],
    out: Annotated[Path, typer.Option(metavar="SCENE", help="Write the assembled scene (.yaml or .gascuel).")],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="PATH=VALUE", help="Change a field or a parameter, such as bodies.rope.density=3."
        ),
    ] = None,
    watch: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record the way as .npz, .vtkhdf, .usdc, .gif, .mp4 or .png.")
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Largest gap of a closed joint [m and rad].")] = 1e-10,
    max_iterations: Annotated[
        int | None, typer.Option(metavar="N", help="Iterations in displacements at most; as many as it takes.")
    ] = None,
    max_rotation: Annotated[float, typer.Option(help="Largest rotation of a body in an iteration [rad].")] = 0.3,
    device: Annotated[str, typer.Option(help="Where to build the scene: cpu, cuda:0, ...")] = "cpu",
) -> None:
    """Move the bodies of SCENE so that all joints and point constraints hold, and write the scene. Speeds stay.

    Exit code 1 when a joint cannot close (the scene is written all the same), 2 when the input is wrong.
    """
    from turnbuckle.cli.assembly_progress import AssemblyProgress
    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.data.errors import InputError

    if out.suffix.lower() not in (".yaml", ".yml", ".gascuel"):
        raise InputError(f"--out {out}: expected a file that ends in .yaml or .gascuel")
    if not out.absolute().parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {str(out.parent)!r}")
    if max_iterations is not None and max_iterations < 0:
        raise InputError(f"--max-iterations {max_iterations}: expected at least 0")
    loaded = load_scene(scene, set_ or [])

    from turnbuckle.run.assemble import assemble as assemble_scene

    with AssemblyProgress(loaded.name) as progress:
        result, report = assemble_scene(
            loaded,
            tolerance=tolerance,
            max_iterations=max_iterations,
            max_rotation=max_rotation,
            watch=watch,
            progress=progress.update,
            device=device,
        )
    result.save(out)
    typer.echo(report.text())
    typer.echo(f"wrote {out}")
    if not report.closed:
        raise typer.Exit(FAILED)
