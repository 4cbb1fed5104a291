"""`view`: open the page of a scene or a recording."""

import os
import sys
import time
import webbrowser
from pathlib import Path
from typing import Any

from turnbuckle.data.errors import InputError
from turnbuckle.io import Recording
from turnbuckle.live.page import Page
from turnbuckle.live.player import Player
from turnbuckle.live.server import Served, serve
from turnbuckle.live.session import Session
from turnbuckle.scene.scene import Scene


class View:
    """A page that is open, and what it shows. In a notebook the page appears below the cell."""

    def __init__(self, served: Served, source: Session | Player, title: str) -> None:
        self.served, self.source = served, source
        self.page = Page(served, source, title, Path.cwd())

    @property
    def url(self) -> str:
        """The address of the page."""
        return self.served.url

    def close(self) -> None:
        """End the simulation and stop serving; may be called again."""
        self.source.close()
        self.page.close()
        self.served.stop()

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        while True:
            time.sleep(1.0)

    def __enter__(self) -> "View":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        style = "width:100%;height:600px;border:1px solid #ddd;border-radius:4px"
        return f'<iframe src="{self.url}" style="{style}"></iframe><div><a href="{self.url}">{self.url}</a></div>'


def view(
    what: Scene | Recording,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    token: str | None = None,
    device: str = "cpu",
    open_browser: bool | None = None,
    run: bool = False,
) -> View:
    """Open a page of a scene, which runs live, or of a recording; returns at once.

    Served on this machine alone unless ``host`` says otherwise (then a token is needed, and made up if none is given).
    ``port``: the first free one from 8080 on when left out. ``open_browser``: whether to open one, by default where there
    is one to open and no notebook. ``run``: start running at once. Raises `InputError`.
    """
    source: Session | Player
    if isinstance(what, Scene):
        title, source = what.name, Session(what, device)
    elif isinstance(what, Recording):
        title, source = str(what.info.get("scene", "recording")), Player(what)
    else:
        raise InputError(f"view: expected a Scene or a Recording, got {type(what).__name__}")
    served = serve(host, port, token, title)
    shown = View(served, source, title)
    source.start()
    if run:
        source.run()
    if open_browser if open_browser is not None else has_browser():
        webbrowser.open(shown.url)
    return shown


def has_browser() -> bool:
    """Whether there is a browser that the user would see: not over ssh, not without a display, not in a notebook."""
    if any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY", "CI")) or "ipykernel" in sys.modules:
        return False
    if sys.platform.startswith("linux") and not any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY")):
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True


def advice(shown: View) -> list[str]:
    """Lines for a terminal: the address, and how to reach it from elsewhere."""
    lines = [f"view: {shown.url}"]
    port: Any = shown.served.port
    if "SSH_CONNECTION" in os.environ and shown.served.gate.loopback_only:
        lines.append(f"over ssh, on your own machine: ssh -N -L {port}:localhost:{port} HOST, then open that address")
    if not shown.served.gate.loopback_only:
        lines.append(
            "whoever has this address can change the simulation; it is not encrypted, use ssh outside of a safe net"
        )
    return lines
