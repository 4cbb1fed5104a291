"""The tab "Constraints": a switch each, residual and force as colour and number. A fixed number of rows is reused."""

import html
from concurrent.futures import Future
from typing import Any

from turnbuckle.live.frame import Frame, Reading
from turnbuckle.live.paint import css, force_color, largest_force, number, residual_color
from turnbuckle.live.session import Session
from turnbuckle.live.stage import Stage

ROWS = 12  # shown at once
BY_RESIDUAL, BY_FORCE = "by residual", "by force"


class ConstraintPanel:
    """Pages of rows, filtered by a text."""

    def __init__(self, gui: Any, session: Session, stage: Stage) -> None:
        self._session, self._stage = session, stage
        self.summary = gui.add_html("")
        self.color = gui.add_dropdown(
            "Colour", (BY_RESIDUAL, BY_FORCE), initial_value=BY_RESIDUAL, hint="Of the points and joints in the scene"
        )
        self.filter = gui.add_text("Filter", "", hint="Shows those whose name or kind holds this text")
        self.page = gui.add_slider("Page", min=1, max=2, step=1, initial_value=1, visible=False)
        self.all_on = gui.add_button("All on", color="gray", icon="toggle-right", visible=False)
        self.all_off = gui.add_button("All off", color="gray", icon="toggle-left", visible=False)
        self.rows = [_Row(gui, session) for _ in range(ROWS)]
        self._pages = 1
        self._text = ""
        self.filter.on_update(lambda _: session.do(lambda _: None))
        self.page.on_update(lambda _: session.do(lambda _: None))
        self.color.on_update(lambda _: self._recolor())
        self.all_on.on_click(lambda _: self._switch_all(True))
        self.all_off.on_click(lambda _: self._switch_all(False))

    def _recolor(self) -> None:
        self._stage.color_by_force = self.color.value == BY_FORCE
        self._session.do(lambda _: None)  # a frame is published after it

    def _switch_all(self, on: bool) -> None:
        for reading in self._chosen(self._session.frame.readings):
            self._session.switch(reading.name, on)

    def _chosen(self, readings: tuple[Reading, ...]) -> list[Reading]:
        word = self.filter.value.strip().lower()
        return [r for r in readings if word in r.name.lower() or word in r.kind]

    def update(self, frame: Frame, size: float) -> None:
        """Show a frame; ``size`` of the scene [m]."""
        chosen = self._chosen(frame.readings)
        pages = max(-(-len(chosen) // ROWS), 1)
        if pages != self._pages:
            self._pages = pages
            self.page.max = max(pages, 2)
            self.page.visible = pages > 1
        for button in (self.all_on, self.all_off):
            if button.visible != (len(chosen) > 1):
                button.visible = len(chosen) > 1
        largest = largest_force(frame.readings)
        first = ROWS * (min(self.page.value, pages) - 1)
        for row, reading in zip(self.rows, [*chosen[first : first + ROWS], *[None] * ROWS], strict=False):
            row.update(reading, size, largest)
        acting = sum(r.acting for r in frame.readings)
        worst = max((r.residual for r in frame.readings), default=0.0)
        text = (
            f'<div style="padding:0 0.9em 0.2em;font-size:0.85em;opacity:0.75">{acting} of {len(frame.readings)} act, '
            f"the worst residual is {number(worst, 'm')}</div>"
        )
        if text != self._text:
            self._text = text
            self.summary.content = text


class _Row:
    """A switch and a line."""

    def __init__(self, gui: Any, session: Session) -> None:
        self._session = session
        self.switch = gui.add_checkbox("", True, visible=False)
        self.line = gui.add_html("", visible=False)
        self.name = ""
        self._text = ""
        self._wanted: bool | None = None  # what the user has clicked and the simulation has not yet confirmed
        self.switch.on_update(self._clicked)

    def _clicked(self, event: Any) -> None:
        if event.client is None or not self.name:
            return
        self._wanted = bool(self.switch.value)
        done = self._session.switch(self.name, self._wanted)
        done.add_done_callback(self._done)

    def _done(self, done: "Future[None]") -> None:
        """What was refused is no longer wanted; what was carried out is, until a reading says so."""
        if done.cancelled() or done.exception() is not None:
            self._wanted = None

    def update(self, reading: Reading | None, size: float, largest: float) -> None:
        """Show a reading, or nothing; ``largest`` force of all that act [N]."""
        there = reading is not None
        if self.switch.visible != there:
            self.switch.visible = there
            self.line.visible = there
        if reading is None:
            self.name = ""
            return
        if reading.name != self.name:
            self.name = reading.name
            self.switch.label = reading.name
            self._wanted = None
        if self._wanted == reading.on:
            self._wanted = None
        if self._wanted is None and self.switch.value != reading.on:
            self.switch.value = reading.on
        text = row_html(reading, size, largest)
        if text != self._text:
            self._text = text
            self.line.content = text


def row_html(reading: Reading, size: float, largest: float) -> str:
    """Kind, residual in its colour, force in its colour."""
    unit = "m/s" if reading.kind == "velocity" else "m"
    count = f" x {reading.rows}" if reading.rows > 1 else ""
    if reading.broken:
        told = f"{reading.broken} broken"
    elif not reading.acting:
        told = "off" if not reading.on else "waits"
    else:
        told = number(reading.residual, unit)
    force = ""
    if reading.acting:
        force = number(reading.force, "N") + (f" · {number(reading.torque, 'N m')}" if reading.torque else "")
    return (
        '<div style="display:flex;gap:0.6em;align-items:center;margin:-0.55em 0.9em 0.15em 0.9em;font-size:0.78em;'
        'font-variant-numeric:tabular-nums">'
        f'{_dot(residual_color(reading, size), 0.5)}<span style="opacity:0.6;flex:1">{html.escape(reading.kind)}{count}</span>'
        f"<span>{told}</span>{_dot(force_color(reading, largest), 0.2) if force else ''}<span>{force}</span></div>"
    )


def _dot(color: tuple[int, int, int], roundness: float) -> str:
    """A disc (``roundness`` 0.5) or a tile in a colour."""
    return (
        f'<span style="width:0.8em;height:0.8em;border-radius:{100 * roundness:.0f}%;flex:none;background:{css(color)}">'
        "</span>"
    )
