"""The tab "Play" of a recording: run, pause, frame by frame, the time slider, speed."""

from typing import Any

from turnbuckle.live.frame import Frame
from turnbuckle.live.player import Player

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


class PlayPanel:
    """Buttons and the slider."""

    def __init__(self, gui: Any, player: Player) -> None:
        self._player = player
        self.status = gui.add_html("")
        self.slider = gui.add_slider(
            "Frame",
            min=0,
            max=max(len(player) - 1, 1),
            step=1,
            initial_value=0,
            hint="Drag to a moment of the recording",
        )
        self.run = gui.add_button("Play", icon="player-play", color="green")
        self.back = gui.add_button("Back", icon="player-skip-back", color="gray", hint="One frame back")
        self.forth = gui.add_button("Forth", icon="player-skip-forward", color="gray", hint="One frame on")
        self.speed = gui.add_dropdown("Speed", [f"{s:g}x" for s in SPEEDS], initial_value="1x")
        self.loop = gui.add_checkbox("Again and again", True)
        self._label, self._text = "Play", ""
        self.slider.on_update(lambda e: player.seek(int(self.slider.value)) if e.client is not None else None)
        self.run.on_click(lambda _: player.pause() if player.running else player.run())
        self.back.on_click(lambda _: player.step(-1))
        self.forth.on_click(lambda _: player.step(1))
        self.speed.on_update(lambda e: player.set_speed(float(self.speed.value.rstrip("x"))))
        self.loop.on_update(lambda e: setattr(player, "loop", bool(self.loop.value)))

    def update(self, frame: Frame) -> None:
        """Show a frame."""
        label = "Pause" if frame.running else "Play"
        if label != self._label:
            self._label = label
            self.run.label = label
            self.run.color = "orange" if frame.running else "green"
            self.run.icon = "player-pause" if frame.running else "player-play"
        if frame.running and self.slider.value != frame.steps:
            self.slider.value = frame.steps
        text = (
            '<div style="padding:0 0.9em 0.4em;font-size:1.1em;font-variant-numeric:tabular-nums">'
            f'{frame.time:.3f} s <span style="float:right;opacity:0.6">{frame.steps + 1} / {len(self._player)}</span></div>'
        )
        if text != self._text:
            self._text = text
            self.status.content = text
