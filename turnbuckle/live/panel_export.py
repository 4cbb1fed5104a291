"""The tab "Export": what is seen as picture, film, recording and web page, given to the browser as a download."""

import re
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from turnbuckle.data.errors import TurnbuckleError
from turnbuckle.live.export import Look, Take, film, picture, recording, web_page
from turnbuckle.live.frame import Frame
from turnbuckle.live.player import Player
from turnbuckle.live.session import Session

WIDE = 1280  # pixels
FILMS = ("gif", "mp4")


def name_of(title: str) -> str:
    """A title as the name of a file."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", title).strip("._") or "scene"


class ExportPanel:
    """Buttons; long work runs in threads of its own."""

    def __init__(self, gui: Any, source: Session | Player, title: str) -> None:
        self._source, self._name = source, name_of(title)
        self._kept: list[Any] = []
        live = isinstance(source, Session)
        self.picture = gui.add_button("Picture", icon="camera", hint="A PNG from where you look")
        if live:
            self.record = gui.add_button("Record", icon="player-record", color="red", hint="Keep frames for a film")
            self.record.on_click(self._toggle)
        self.count = gui.add_markdown("" if live else f"{len(source)} frames")
        self.format = gui.add_dropdown("Film", FILMS, initial_value="gif", hint="mp4 needs turnbuckle[film]")
        self.film = gui.add_button("Film", icon="movie", color="gray")
        self.page = gui.add_button("Web page", icon="world", color="gray", hint="One HTML file that needs no server")
        self.data = gui.add_button("Recording (.npz)", icon="database-export", color="gray", visible=live)
        self._text = ""
        self.picture.on_click(lambda e: self._give(e, ".png", lambda t, k, _: picture(t, 0, k), now=True))
        self.film.on_click(self._film)
        self.page.on_click(lambda e: self._give(e, ".html", lambda t, k, p: web_page(t, k, p).encode()))
        self.data.on_click(lambda e: self._give(e, ".npz", lambda t, _, __: recording(t)))

    def _film(self, event: Any) -> None:
        suffix = f".{self.format.value}"
        self._give(event, suffix, lambda t, k, p: film(t, suffix, k, p))

    def _toggle(self, event: Any) -> None:
        assert isinstance(self._source, Session)
        on = self._source.recording is None
        done = self._source.record(on)
        if not on:
            done.add_done_callback(lambda f: setattr(self, "_kept", f.result()))

    def take(self, now: bool = False) -> Take:
        """The frames to export; ``now``: the one that is shown, alone."""
        source, frame = self._source, self._source.frame
        if isinstance(source, Player):
            info = {"scene": self._name}
            rate = float(source.recording.info.get("frames_per_second", 30.0))
            if not now:
                r = source.recording
                return Take(source.shapes, source.up_axis, source.size, rate, r.times, r.x, r.v, info)
        else:
            d = source.scene.definition
            rate, info = d.frames_per_second, {"scene": source.scene.name, "integrator": d.integrator, "dt": d.dt}
            kept = self._kept or list(source.recording or [])
            if kept and not now:
                times = [row[0] for row in kept]
                return Take(
                    source.shapes, source.up_axis, source.size, rate, times, lambda k: kept[k][1], lambda k: kept[k][2],
                    info,
                )  # fmt: skip
        still = frame.x
        return Take(
            source.shapes, source.up_axis, source.size, rate, [frame.time], lambda _: still, lambda _: np.zeros_like(still), info
        )  # fmt: skip

    def _give(
        self, event: Any, suffix: str, make: Callable[[Take, Look, Callable[[float], None]], bytes], now: bool = False
    ) -> None:
        """Make a file in a thread, and offer it to who asked."""
        client = event.client
        if client is None:
            return
        take, look = self.take(now), look_of(client)
        note = client.add_notification(f"{self._name}{suffix}", "at work", loading=True, with_close_button=False)

        def work() -> None:
            try:
                told = [0]

                def progress(part: float) -> None:
                    if int(20 * part) > told[0]:
                        told[0] = int(20 * part)
                        note.body = f"{100 * part:.0f} %"

                content = make(take, look, progress)
                client.send_file_download(f"{self._name}{suffix}", content, save_immediately=True)
                note.body, note.loading = f"{len(content) / 1e6:.2g} MB", False
                note.auto_close_seconds = 5.0
            except (TurnbuckleError, OSError) as error:
                note.body, note.loading, note.color = str(error), False, "red"
            note.with_close_button = True

        threading.Thread(target=work, name="turnbuckle export", daemon=True).start()

    def update(self, frame: Frame) -> None:
        """Show how many frames there are."""
        if not isinstance(self._source, Session):
            return
        running = self._source.recording
        text = f"{len(running)} frames, recording" if running is not None else f"{len(self._kept)} frames recorded"
        if text != self._text:
            self._text = text
            self.count.content = text
            self.record.label = "Stop recording" if running is not None else "Record"


def look_of(client: Any) -> Look:
    """Where a browser looks from."""
    camera = client.camera
    wide, high = max(int(camera.image_width), 1), max(int(camera.image_height), 1)
    size = (WIDE, 2 * int(np.clip(round(0.5 * WIDE * high / wide), 100, 2000)))
    return Look(np.array(camera.position), np.array(camera.look_at), size)
