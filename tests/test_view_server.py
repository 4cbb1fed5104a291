"""Who may open the page, what is served, playing of recordings, exports; without a browser."""

import http.client
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import turnbuckle
from turnbuckle.io import read_recording
from turnbuckle.live.gate import Gate
from turnbuckle.live.player import Player

WAIT = 30.0
ROPE = {"start": [0, 0, 1], "end": [1, 0, 1], "segments": 10, "stretch_stiffness": 200.0}


def scene() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("hanging", dt=1e-3, duration=0.1, frames_per_second=100.0)
    scene.add_rope("rope", **ROPE)
    scene.add_constraint("nail", "left", points={"body": "rope", "index": 0})
    return scene


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "fall.npz"
    turnbuckle.run_scene(scene(), out=[path])
    return path


# The gate -------------------------------------------------------------------------------------------------------------

HERE = {"Host": "localhost:8080"}
SOCKET = {**HERE, "Upgrade": "websocket", "Origin": "http://localhost:8080"}


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1:9000", "[::1]:8080", "LOCALHOST"])
def test_this_machine_may_open_the_page(host: str) -> None:
    assert Gate(True, None).judge("/", {"Host": host}) is None
    assert Gate(True, None).judge("/", {"Host": host, "Upgrade": "websocket", "Origin": f"http://{host}"}) is None


@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "evil.example:8080", "localhost.evil.example", "[", "127.evil.example:1", "127.0.0.1.evil"],
)
def test_names_of_others_that_point_here_are_refused(host: str) -> None:
    assert Gate(True, None).judge("/", {"Host": host}) is not None


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "null",
        "http://localhost:8081",
        "http://localhost",
        "https://localhost:8080.evil.example",
        "",
    ],
)
def test_other_pages_are_refused(origin: str) -> None:
    reason = Gate(True, None).judge("/", {**SOCKET, "Origin": origin})
    assert reason is not None and "another page" in reason
    assert Gate(True, None).judge("/", {**HERE, "Origin": origin}) is not None


def test_what_does_not_say_where_it_comes_from_gets_no_data() -> None:
    assert "which page" in str(Gate(True, None).judge("/", {k: v for k, v in SOCKET.items() if k != "Origin"}))


def test_wider_than_this_machine_every_request_needs_the_token() -> None:
    with pytest.raises(ValueError, match="token"):
        Gate(False, None)
    gate = Gate(False, "secret-1")
    far = {"Host": "pc.example:8080"}
    upgrade = {**far, "Upgrade": "websocket", "Origin": "http://pc.example:8080"}
    for path in ("/", "/?token=", "/?token=secret", "/?token=secret-12", "/?other=secret-1", "/secret-1"):
        assert "token" in str(gate.judge(path, far))
        assert gate.greeting(path) is None
    assert gate.judge("/?token=secret-1", far) is None
    cookie = str(gate.greeting("/?token=secret-1"))
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
    assert "token" in str(gate.judge("/", upgrade))
    assert gate.judge("/", {**upgrade, "Cookie": f"a=b; {cookie.split(';')[0]}"}) is None
    assert "token" in str(gate.judge("/", {**upgrade, "Cookie": f"{gate.cookie}=secret-2"}))
    assert "another page" in str(gate.judge("/", {**upgrade, "Cookie": cookie, "Origin": "http://evil.example"}))


# The server -----------------------------------------------------------------------------------------------------------


def ask(port: int, path: str = "/", **headers: str) -> tuple[int, bytes, dict[str, str]]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", path, headers={"Accept-Encoding": "identity", **headers})
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body, dict(answer.getheaders())


def upgrade(port: int, **more: str) -> int:
    headers = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", **more,
    }  # fmt: skip
    with socket.create_connection(("127.0.0.1", port), timeout=10) as s:
        lines = ["GET / HTTP/1.1", f"Host: localhost:{port}", *(f"{k}: {v}" for k, v in headers.items())]
        s.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return int(s.recv(100).split()[1])


def test_the_page_is_served_on_this_machine_alone_and_to_its_own_page_alone() -> None:
    pytest.importorskip("viser")
    from turnbuckle.live import view

    with view(scene(), open_browser=False) as shown:
        port = shown.served.port
        assert shown.url == f"http://localhost:{port}/"
        status, body, headers = ask(port)
        assert status == 200 and b"<html" in body.lower() and "frame-ancestors" in headers["Content-Security-Policy"]
        status, body, _ = ask(port, Host="evil.example")
        assert status == 403 and b"this machine alone" in body
        assert ask(port, Origin="http://evil.example")[0] == 403
        assert upgrade(port, Origin=f"http://localhost:{port}") == 101
        assert upgrade(port, Origin="http://evil.example") == 403
        assert upgrade(port) == 403
        machine = socket.gethostbyname(socket.gethostname())
        if not machine.startswith("127."):
            with pytest.raises(OSError):
                socket.create_connection((machine, port), timeout=2).close()
        assert f'src="{shown.url}"' in shown._repr_html_()
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=2).close()
    shown.close()


def test_the_page_carries_our_script_and_is_whole() -> None:
    pytest.importorskip("viser")
    import gzip

    from turnbuckle.live import view

    with view(scene(), open_browser=False) as shown:
        status, plain, headers = ask(shown.served.port)
        assert status == 200 and plain.index(b"turnbuckleSoftware") < plain.index(b'id="root"')
        assert int(headers["Content-Length"]) == len(plain) and plain.rstrip().endswith(b"</html>")
        packed = ask(shown.served.port, **{"Accept-Encoding": "gzip"})
        assert packed[2]["Content-Encoding"] == "gzip" and gzip.decompress(packed[1]) == plain


def test_opened_wider_it_asks_for_the_token() -> None:
    pytest.importorskip("viser")
    from turnbuckle.live import view

    with view(scene(), host="0.0.0.0", open_browser=False) as shown:
        token = shown.served.gate.token
        assert token and len(token) >= 24 and shown.url.endswith(f"?token={token}")
        port = shown.served.port
        assert ask(port)[0] == 403 and ask(port, "/?token=wrong")[0] == 403
        status, _, headers = ask(port, f"/?token={token}")
        assert status == 200
        assert upgrade(port, Origin=f"http://localhost:{port}") == 403
        cookie = headers["Set-Cookie"].split(";")[0]
        assert upgrade(port, Origin=f"http://localhost:{port}", Cookie=cookie) == 101


def test_a_port_that_is_taken_and_a_host_that_is_not_ours_are_told() -> None:
    pytest.importorskip("viser")
    from turnbuckle.live.server import serve

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(turnbuckle.InputError, match="cannot serve on 127.0.0.1:"):
            serve(port=taken.getsockname()[1])
    with pytest.raises(turnbuckle.InputError, match="cannot serve on 192.0.2.1"):
        serve(host="192.0.2.1")


def test_a_token_that_no_address_can_hold_is_told() -> None:
    pytest.importorskip("viser")
    from turnbuckle.live.server import serve

    with pytest.raises(turnbuckle.InputError, match="token"):
        serve(token="a b\nSet-Cookie: x")


def test_only_scenes_and_recordings_can_be_viewed() -> None:
    from turnbuckle.live import view

    with pytest.raises(turnbuckle.InputError, match="expected a Scene or a Recording, got str"):
        view("scene")  # type: ignore[arg-type]


# Recordings -----------------------------------------------------------------------------------------------------------


def test_a_recording_plays_and_goes_to_any_frame(recording: Path) -> None:
    read = read_recording(recording)
    player = Player(read)
    player.start()
    try:
        player.seek(7).result(timeout=WAIT)
        assert player.frame.steps == 7 and np.array_equal(player.frame.x, read.x(7))
        player.step(-2).result(timeout=WAIT)
        assert player.frame.steps == 5 and player.frame.time == read.times[5]
        player.seek(10**6).result(timeout=WAIT)
        assert player.frame.steps == len(read) - 1
        player.loop = False
        player.set_speed(0.5).result(timeout=WAIT)
        begin = time.monotonic()
        player.run().result(timeout=WAIT)
        while player.running and time.monotonic() - begin < WAIT:
            time.sleep(0.005)
        took = time.monotonic() - begin
        assert player.frame.steps == len(read) - 1 and took >= 0.9 * (read.times[-1] - read.times[0]) / 0.5
    finally:
        player.close()


def test_a_recording_without_frames_is_told(tmp_path: Path) -> None:
    from turnbuckle.io import open_recorder

    empty = tmp_path / "empty.npz"
    open_recorder(empty, list(scene().build()[0].shapes), up_axis="Z", frames_per_second=30).close()
    with pytest.raises(turnbuckle.InputError, match="no frame"):
        Player(read_recording(empty))


def take_of(read):
    from turnbuckle.live.export import Take

    return Take(read.shapes, "Z", 1.0, 100.0, read.times, read.x, read.v, {"scene": "hanging"})


def test_exports_are_whole(recording: Path, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    from PIL import Image

    from turnbuckle.live.export import Look, film, picture, web_page
    from turnbuckle.live.export import recording as recording_of

    take, look = (
        take_of(read_recording(recording)),
        Look(np.array([0.5, -3.0, 0.8]), np.array([0.5, 0, 0.5]), (320, 200)),
    )
    (tmp_path / "p.png").write_bytes(picture(take, 5, look))
    near = Image.open(tmp_path / "p.png")
    assert near.size == (320, 200)
    far = Look(np.array([0.5, -30.0, 0.8]), look.target, look.size)
    (tmp_path / "f.png").write_bytes(picture(take, 5, far))
    background = np.asarray(Image.open(tmp_path / "f.png"), dtype=int)
    assert np.abs(np.asarray(near, dtype=int) - background).max() > 50, "from further away it must look smaller"
    (tmp_path / "p.gif").write_bytes(film(take, ".gif", look))
    with Image.open(tmp_path / "p.gif") as shown:
        assert shown.n_frames == len(take)
    (tmp_path / "again.npz").write_bytes(recording_of(take))
    assert np.array_equal(read_recording(tmp_path / "again.npz").x(4), take.x(4))
    parts: list[float] = []
    page = web_page(take, look, parts.append)
    assert "__VISER_EMBED_DATA__" in page and len(parts) == len(take) and parts[-1] == 1.0
    assert "http://localhost" not in page.split("__VISER_EMBED_DATA__")[1][:2000]


def test_the_command_names_what_is_wrong(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from turnbuckle.cli.app import app

    (tmp_path / "bad.npz").write_bytes(b"nonsense")
    for words, told in (
        (["view", "nothing.yaml"], "nothing.yaml"),
        (["view", str(tmp_path / "bad.npz")], "no recording"),
        (["view", str(tmp_path / "bad.npz"), "--set", "dt=1"], "a recording is as it is"),
        (["view", "curtain", "--set", "m=x"], "whole number"),
    ):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 2 and told in result.output + str(result.stderr), (words, result.output)


def test_the_command_serves_until_it_is_stopped(tmp_path: Path) -> None:
    pytest.importorskip("viser")
    scene().save(tmp_path / "scene.yaml")
    start = [
        sys.executable,
        "-c",
        "from turnbuckle.cli import main; main()",
        "view",
        "scene.yaml",
        "--no-open",
        "--run",
    ]
    with subprocess.Popen(start, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        line = process.stdout.readline()
        assert line.startswith("view: http://localhost:"), line
        assert ask(int(line.split(":")[-1].strip(" /\n")))[0] == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=WAIT) == 0
        assert "Traceback" not in process.stderr.read()
