"""A viser server behind a gate. viser itself serves on all addresses and asks nobody who he is; see `gate.py`."""

import contextlib
import re
import socket
import threading
from collections.abc import Iterator
from typing import Any

import rich

from turnbuckle.data.errors import InputError, TurnbuckleError
from turnbuckle.live.gate import Gate, is_loopback, new_token, refusal
from turnbuckle.live.served_page import with_script

PORT = 8080
TRIES = 100  # ports tried from `PORT` on where none was asked for
MISSING = "the page in the browser needs viser; run: pip install 'turnbuckle[view]'"
FRAMES = "frame-ancestors 'self' http://localhost:* http://127.0.0.1:* vscode-webview:"  # notebooks on this machine
PLAIN = re.compile(r"[A-Za-z0-9._~-]+")  # a token
_starting = threading.Lock()


class Served:
    """A server that runs, and where to find it."""

    def __init__(self, viser_server: Any, gate: Gate, host: str) -> None:
        self.viser, self.gate, self.host = viser_server, gate, host
        self.port = int(viser_server.get_port())

    @property
    def url(self) -> str:
        """The address to open in a browser, with the token where there is one."""
        name = self.host
        if name in ("0.0.0.0", "::", ""):
            name = socket.gethostname()
        elif is_loopback(name):
            name = "localhost" if name == "127.0.0.1" else name
        if ":" in name:
            name = f"[{name}]"
        return f"http://{name}:{self.port}/" + (f"?token={self.gate.token}" if self.gate.token else "")

    def stop(self) -> None:
        """Stop serving; may be called again."""
        if self.viser is not None:
            with _quiet():
                self.viser.stop()
            self.viser = None


def serve(host: str = "127.0.0.1", port: int | None = None, token: str | None = None, label: str = "") -> Served:
    """Start serving. ``port`` None: the first free one from `PORT` on. ``token``: one is made up where it is needed.

    Raises `InputError` where viser is missing, or where the address cannot be served on.
    """
    try:
        import viser
    except ImportError:
        raise InputError(MISSING) from None
    if token and not PLAIN.fullmatch(token):
        raise InputError("--token: letters, digits, '-', '_', '.' and '~' alone; it is part of the address")
    port = free_port(host, port)
    if not is_loopback(host) and not token:
        token = new_token()
    gate = Gate(is_loopback(host), token)
    with _starting, _quiet(), _guarded(gate) as guarded:
        server = viser.ViserServer(host=host, port=port, label=label or None, verbose=False)
    if not guarded:  # a newer viser that starts in another way must not serve unguarded
        server.stop()
        raise TurnbuckleError(f"this version of viser ({viser.__version__}) cannot be guarded; install viser 1.1")
    server.request_share_url = lambda *_, **__: None  # nothing leaves this machine by way of a public relay
    return Served(server, gate, host)


def free_port(host: str, port: int | None) -> int:
    """A port that can be served on. Raises `InputError` for an address that is not ours or a port that is taken."""
    wanted = range(PORT, PORT + TRIES) if port is None else [port]
    reason: OSError | None = None
    for number in wanted:
        try:
            family, kind, _, _, address = socket.getaddrinfo(host, number, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
                return int(probe.getsockname()[1])
        except (OSError, OverflowError) as error:
            reason = error if isinstance(error, OSError) else OSError(str(error))
    what = f"{host}:{port}" if port is not None else host
    raise InputError(
        f"cannot serve on {what} ({reason and reason.strerror or reason}); choose another --host or --port"
    )


@contextlib.contextmanager
def _guarded(gate: Gate) -> Iterator[list[bool]]:
    """While a server starts, its answers to requests go through the gate; a list that is filled when they do."""
    import viser.infra._infra as infra

    websocket_server = infra.websockets.asyncio.server
    start = websocket_server.serve
    used: list[bool] = []

    def guarded(*args: Any, process_request: Any = None, **more: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            reason = gate.judge(request.path, request.headers)
            if reason is not None:
                status, text = refusal(reason)
                body = text.encode()
                headers = infra.Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
                return infra.Response(status.value, status.phrase, headers, body)
            response = process_request(connection, request) if process_request is not None else None
            cookie = gate.greeting(request.path)
            if response is not None:
                _add_script(response)
                response.headers["Content-Security-Policy"] = FRAMES
                response.headers["Referrer-Policy"] = "no-referrer"
                if cookie is not None:
                    response.headers["Set-Cookie"] = cookie
            return response

        used.append(True)
        return start(*args, process_request=answer, **more)

    websocket_server.serve = guarded
    try:
        yield used
    finally:
        websocket_server.serve = start


def _add_script(response: Any) -> None:
    """To an answer that is the page (and to no other) our script."""
    if not response.headers.get("Content-Type", "").startswith("text/html"):
        return
    response.body = with_script(response.body, response.headers.get("Content-Encoding") == "gzip")
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """viser prints a box with its address, which would lack the token; the command prints its own line."""
    say = rich.print
    rich.print = lambda *_, **__: None
    try:
        yield
    finally:
        rich.print = say
