"""`turnbuckle export`: a recording, or a scene, for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.report_errors import report_errors

RECORDINGS = (".npz", ".vtkhdf", ".part", ".usdc", ".usda", ".usd", ".usdz")
FORMATS = ("usdc", "usda", "usd", "vtkhdf", "npz", "obj", "ply", "glb", "png", "gif", "mp4")
SCENES = ("usda", "usdc", "usd")


@report_errors
def export(
    source: Annotated[str, typer.Argument(metavar="RECORDING", help="A recording (.npz, .vtkhdf, USD), or a scene.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The file to write; beside RECORDING, if not.")
    ] = None,
    frame: Annotated[
        int | None, typer.Option(metavar="N", help="This frame alone, from 0, or -1 for the last.")
    ] = None,
    every: Annotated[int, typer.Option(metavar="N", help="Every N-th frame.")] = 1,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Scenes: change a field or a parameter.")
    ] = None,
) -> None:
    """Write RECORDING in another format. A scene becomes USD with UsdPhysics bodies, joints and attachments."""
    from turnbuckle.data.errors import InputError

    wanted = to.lower().lstrip(".")
    if wanted not in FORMATS:
        raise InputError(f"--to {to}: expected one of {', '.join(FORMATS)}")
    path = Path(source)
    is_recording = path.suffix.lower() in RECORDINGS
    target = out if out is not None else Path(f"{path.with_suffix('') if is_recording else path.stem}.{wanted}")
    if target.suffix.lower() != f".{wanted}":
        raise InputError(f"--out {target}: expected a file that ends in .{wanted}, as --to says")
    if is_recording:
        if set_:
            raise InputError("--set goes with scenes; a recording is what it is")
        from turnbuckle.run.export_recording import export_recording

        files = export_recording(path, target, frame=frame, every=every)
        shown = str(files[0]) if len(files) == 1 else f"{files[0]} to {files[-1].name} ({len(files)} files)"
        typer.echo(f"wrote {shown}")
        return
    if wanted not in SCENES:
        raise InputError(f"{source}: a scene can be exported to {', '.join(SCENES)}; run it and export the recording")
    if frame is not None or every != 1:
        raise InputError("--frame and --every go with recordings, not with scenes")
    from turnbuckle.cli.scene_argument import load_scene

    scene = load_scene(source, set_ or [])

    from turnbuckle.io.usd_export import export_scene

    for note in export_scene(scene, target):
        typer.echo(f"only for Turnbuckle: {note}")
    typer.echo(f"wrote {target}")
