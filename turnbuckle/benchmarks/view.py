"""How many frames a second the page shows: what our server alone, the socket, and the browser that draws reach.

`turnbuckle bench view`, or `python -m turnbuckle.benchmarks.view --cells 30`. The browser is Debian's Chromium without a
window, driven by playwright; without them their rows are left out. It draws as it does for people on the same machine: with
a graphics card, or, where there is none, WebGL on the processor (SwiftShader).
"""

import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from turnbuckle.benchmarks.contact_options import run_as_command
from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.live import View, view
from turnbuckle.live.frame import Frame
from turnbuckle.scene.scene import Scene

AIM = 30.0  # frames a second at 10,000 vertices
CHROMIUM = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
PUSHED = 60.0  # frames a second offered where no simulation runs
# A frame counts when the page has drawn with vertices that it had not drawn before.
COUNTER = """() => {
  const proto = WebGL2RenderingContext.prototype, upload = proto.bufferSubData;
  window.counted = { drawn: 0, fresh: 0, dirty: false, before: 0 };
  proto.bufferSubData = function (...all) { window.counted.dirty = true; return upload.apply(this, all); };
  const info = window.__viserTestpoints.rendererInfo.render, c = window.counted;
  c.before = info.frame;
  const look = () => {
    if (info.frame > c.before) { c.drawn += info.frame - c.before; c.fresh += c.dirty; c.dirty = false; c.before = info.frame; }
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""


def flag(cells: int) -> Scene:
    """A cloth of ``(cells + 1)**2`` vertices that hangs and sways, soft enough for explicit steps."""
    count = (cells + 1) ** 2
    mass = 0.3 / count
    stiffness = 10.0
    scene = Scene("flag", dt=0.25 * float(np.sqrt(mass / stiffness)))
    scene.add_cloth(
        "cloth", size=[1, 1], cells=[cells, cells], position=[0, 0, 1], rotation=[np.pi / 2, 0, 0], density=0.3,
        structural_stiffness=stiffness, shear_stiffness=0.3 * stiffness, bend_stiffness=0.0, damping=3.0 / count,
    )  # fmt: skip
    scene.add_constraint("nail", "top", points={"body": "cloth", "where": f"z > {2 - 0.5 / cells}"})
    return scene


def measure(
    console: Console | None = None,
    folder: Path | None = None,
    *,
    cells: int = 99,
    seconds: float = 5.0,
    width: int = 1000,
    height: int = 640,
    browser: bool = True,
) -> list[Table]:
    """Measure, print, write the table. ``seconds`` of each measurement; ``width`` and ``height`` of the window [pixels]."""
    console, busy = console or Console(), load()
    if find_spec("viser") is None:
        console.print("The page was left out: it needs viser (pip install 'turnbuckle[view]').", markup=False)
        return []
    scene = flag(cells)
    console.print(f"Showing {(cells + 1) ** 2} vertices, {seconds:g} s a row ...")
    table = Table("Frames of the page", ["what", "frames/s", "drawn/s", "ms a frame", "simulation steps/s"])
    with view(scene, open_browser=False) as shown:
        shown.page.close()  # frames come from here at first
        x = np.array(shown.source.frame.x)
        table.add("server alone", *_alone(shown, x, seconds))
        listener = _Listener(shown, least=x.nbytes // 4)  # vertices go as float32, and once each here
        table.add("server and socket", *_alone(shown, x, seconds, listener))
        listener.close()
        if not browser:
            table.add("browser: left out", None, None, None, None)
    if browser:
        _browser(scene, table, seconds, (width, height))
    table.notes.append(
        "frames/s: with new vertices; drawn/s: all drawings. viser sends 60 times a second at most. Pushed: frames offered without a simulation. Running: the "
        "simulation takes the processors that the browser leaves."
    )
    reached = [row[1] for row in table.rows if row[0].startswith("browser") and row[1] is not None]
    if reached and cells >= 99:
        table.notes.append(f"Aim: {AIM:g} frames a second: {'met' if min(reached) >= AIM else 'missed'}.")
    publish("view", [table], console, folder, busy)
    return [table]


def _alone(shown: View, x: np.ndarray, seconds: float, listener: "_Listener | None" = None) -> tuple[float | None, ...]:
    """Frames a second that the stage makes; with a ``listener``, that arrive there before the next is made."""
    server, frames = shown.served.viser, 0
    before = listener.count() if listener is not None else 0
    began = time.perf_counter()
    while time.perf_counter() - began < seconds:
        frames += 1
        with server.atomic():
            shown.page.stage.show(Frame(x + 1e-3 * np.sin(frames)))
        server.flush()
        if listener is not None:
            listener.wait_for(before + frames)
    took = time.perf_counter() - began
    return frames / took, None, 1e3 * took / frames, None


class _Listener:
    """A connection that reads what a browser would and draws nothing."""

    def __init__(self, shown: View, least: int) -> None:
        """``least``: what is smaller is no frame [bytes]."""
        import viser
        from websockets.sync import client

        port = shown.served.port
        self._messages, self._arrived, self._least = 0, threading.Condition(), least
        self._socket = client.connect(
            f"ws://localhost:{port}", origin=f"http://localhost:{port}", max_size=None, compression=None,
            subprotocols=[f"viser-v{viser.__version__}"],
        )  # fmt: skip
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        time.sleep(1.5)  # all that was there before

    def _read(self) -> None:
        for message in self._socket:
            if len(message) > self._least:  # small ones are numbers and lists
                with self._arrived:
                    self._messages += 1
                    self._arrived.notify_all()

    def count(self) -> int:
        """Frames that have arrived."""
        return self._messages

    def wait_for(self, count: int) -> None:
        """Until that many have arrived."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._messages >= count, timeout=1.0)

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


def _browser(scene: Scene, table: Table, seconds: float, window: tuple[int, int]) -> None:
    path = next((p for p in CHROMIUM if Path(p).exists()), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        path = None
    if path is None:
        table.notes.append("The browser was left out: it needs Chromium and playwright (pip install playwright).")
        return
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        for what, run in (("pushed", _pushed), ("running", _running)):
            with view(scene, open_browser=False) as shown:
                page = chromium.new_page(viewport={"width": window[0], "height": window[1]})
                page.goto(shown.url)
                page.get_by_role("tab", name="Export").wait_for(timeout=60e3)
                page.wait_for_function("window.__viserTestpoints?.rendererInfo.render.triangles > 0", timeout=60e3)
                page.evaluate(COUNTER)
                table.add(f"browser, {what}", *run(shown, page, seconds))
                size = page.evaluate("(c => [c.width, c.height])(document.querySelector('canvas[data-engine]'))")
                software = page.evaluate("window.turnbuckleSoftware?.renderer ?? ''")
                table.notes.append(f"browser, {what}: {size[0]} x {size[1]} pixels, {software or 'a graphics card'}")
                page.close()
        chromium.close()


def _pushed(shown: View, page: Any, seconds: float) -> tuple[float | None, ...]:
    """Frames offered without a simulation."""
    shown.page.close()
    x, ended = np.array(shown.source.frame.x), threading.Event()

    def push() -> None:
        count = 0
        while not ended.is_set():
            began = time.perf_counter()
            count += 1
            with shown.served.viser.atomic():
                shown.page.stage.show(Frame(x + 1e-2 * np.sin(0.3 * count)))
            shown.served.viser.flush()
            ended.wait(max(1.0 / PUSHED - (time.perf_counter() - began), 0.0))

    thread = threading.Thread(target=push)
    thread.start()
    try:
        fresh, drawn = _count(page, seconds, lambda: None)
    finally:
        ended.set()
        thread.join()
    return fresh, drawn, 1e3 / max(drawn, 1e-9), None


def _running(shown: View, page: Any, seconds: float) -> tuple[float | None, ...]:
    """The simulation runs."""
    shown.source.run().result()
    steps: list[tuple[float, int]] = []
    fresh, drawn = _count(page, seconds, lambda: steps.append((time.perf_counter(), shown.source.frame.steps)))
    (t0, n0), (t1, n1) = steps
    return fresh, drawn, 1e3 / max(drawn, 1e-9), (n1 - n0) / (t1 - t0)


def _count(page: Any, seconds: float, mark: Callable[[], None]) -> tuple[float, float]:
    """Frames a second with new vertices, and all; ``mark`` is called at both ends."""
    page.wait_for_timeout(3e3)  # the page finds its resolution
    began, mark_at = page.evaluate("[window.counted.fresh, window.counted.drawn]"), time.perf_counter()
    mark()
    page.wait_for_timeout(1e3 * seconds)
    ended = page.evaluate("[window.counted.fresh, window.counted.drawn]")
    mark()
    took = time.perf_counter() - mark_at
    return (ended[0] - began[0]) / took, (ended[1] - began[1]) / took


if __name__ == "__main__":
    run_as_command(measure)
