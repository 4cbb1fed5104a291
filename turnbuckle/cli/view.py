"""`turnbuckle view`: a scene that runs, or a recording, in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from turnbuckle.cli.export import RECORDINGS
from turnbuckle.cli.report_errors import report_errors


@report_errors
def view(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENE|RECORDING", help="A scene file, a ready scene, or a recording (.npz, .vtkhdf, USD)."
        ),
    ],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a field or a parameter of a scene.")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Start running at once.")] = False,
    open_: Annotated[
        bool | None, typer.Option("--open/--no-open", help="Open a browser; by default where it can.")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to serve on; wider than this machine a token is needed.")
    ] = "127.0.0.1",
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port; the first free one from 8080 on.")] = None,
    token: Annotated[str | None, typer.Option(help="Token that the address must carry; made up where needed.")] = None,
    device: Annotated[str, typer.Option(help="Where to compute: cpu, cuda:0, ...")] = "cpu",
) -> None:
    """Look at SCENE as it runs, take hold of it, switch its constraints; or play RECORDING. Ends with Ctrl-C."""
    recording = Path(what).suffix.lower() in RECORDINGS

    from turnbuckle.data.errors import InputError

    if recording and set_:
        raise InputError("--set changes a scene; a recording is as it is")

    from turnbuckle.cli.scene_argument import load_scene
    from turnbuckle.io import read_recording

    loaded = read_recording(what) if recording else load_scene(what, set_ or [])

    from turnbuckle.live.show import advice
    from turnbuckle.live.show import view as show

    shown = show(loaded, host=host, port=port, token=token, device=device, open_browser=open_, run=run)
    try:
        for line in advice(shown):
            typer.echo(line)
        shown.wait()
    except KeyboardInterrupt:
        typer.echo("")
    finally:
        shown.close()
