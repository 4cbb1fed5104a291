"""The tab "Run": run, pause, single steps, reset, speed, what the mouse does, and how it goes."""

import html
from typing import Any

from turnbuckle.live.frame import Frame
from turnbuckle.live.paint import css, number
from turnbuckle.live.session import Session
from turnbuckle.live.stage import Stage

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
STATUS = {"ok": (34, 150, 92), "degraded": (200, 150, 20), "failed": (208, 52, 44), "": (120, 126, 136)}
HELP = (
    "**Drag** a body: it follows the mouse on a spring; with *Shift*, exactly. **Click**: pin and unpin. "
    "Drag beside the bodies to turn the view, right button to move it, wheel to come nearer."
)
ON_SPRING, EXACTLY, POSING = "on a spring", "exactly", "posing"


class RunPanel:
    """Buttons and the state of the run."""

    def __init__(self, gui: Any, session: Session, stage: Stage) -> None:
        self._session, self._stage = session, stage
        self.status = gui.add_html("")
        self.run = gui.add_button("Run", icon="player-play", color="green", hint="Run or pause")
        self.step = gui.add_button("Step", icon="player-skip-forward", color="gray", hint="One step, then pause")
        self.reset = gui.add_button("Reset", icon="player-track-prev", color="gray", hint="Back to the start")
        options = [f"{s:g}x" for s in SPEEDS]
        self.speed = gui.add_dropdown("Speed", options, initial_value="1x", hint="Simulated seconds a second, at most")
        self.drag = gui.add_dropdown(
            "Drag", [ON_SPRING, EXACTLY], initial_value=ON_SPRING, hint="How a body that is dragged follows the mouse"
        )
        self.pins = gui.add_checkbox("Click to pin", True, hint="A click on a body pins it there; on a pin, unpins it")
        self.unpin = gui.add_button("Unpin all", icon="pin-filled", color="gray", visible=False)
        self.marks = gui.add_checkbox("Show constraints", True)
        self.contacts = gui.add_checkbox("Show contact forces", True, visible=session.contact)
        self.glass = gui.add_checkbox("See through", False, hint="Bodies as glass: joints and pins inside are seen")
        self.fine = gui.add_checkbox(
            "Fine light", False, hint="Shadows and light from all around: needs a graphics card"
        )
        gui.add_markdown(HELP)
        self._label = "Run"
        self._text = ""
        self.run.on_click(lambda _: session.pause() if session.running else session.run())
        self.step.on_click(lambda _: session.step())
        self.reset.on_click(lambda _: session.reset())
        self.unpin.on_click(lambda _: session.unpin_all())
        self.speed.on_update(self._set_speed)
        self.marks.on_update(lambda _: self._show())
        self.contacts.on_update(lambda _: self._show())
        self.glass.on_update(lambda _: stage.see_through(self.glass.value))
        self.fine.on_update(lambda _: stage.light(self.fine.value))

    @property
    def exact(self) -> bool:
        """Whether bodies follow the mouse exactly."""
        return bool(self.drag.value == EXACTLY)

    def _set_speed(self, event: Any) -> None:
        if event.client is not None:
            self._session.set_speed(float(self.speed.value.rstrip("x")))

    def _show(self) -> None:
        self._stage.show_marks, self._stage.show_contacts = self.marks.value, self.contacts.value
        self._session.do(lambda _: None)  # a frame is published after it

    def update(self, frame: Frame) -> None:
        """Show a frame."""
        label = "Pause" if frame.running else "Run"
        if label != self._label:
            self._label = label
            self.run.label = label
            self.run.color = "orange" if frame.running else "green"
            self.run.icon = "player-pause" if frame.running else "player-play"
        if self.unpin.visible != bool(len(frame.pins)):
            self.unpin.visible = bool(len(frame.pins))
        text = status_html(frame)
        if text != self._text:
            self._text = text
            self.status.content = text


def status_html(frame: Frame) -> str:
    """Time, steps, how the last step went, and what there is to say."""
    word = frame.status or "ready"
    rate = f" · {frame.rate:.2g}x" if frame.running else ""
    touching = f" · {frame.touching} contacts" if frame.touching else ""
    lines = [
        f'<div style="font-size:1.35em;font-variant-numeric:tabular-nums">{frame.time:.3f} s'
        f'<span style="float:right;font-size:0.7em;color:white;background:{css(STATUS.get(word, STATUS[""]))};'
        f'border-radius:0.6em;padding:0.15em 0.7em;margin-top:0.2em">{word}</span></div>',
        f'<div style="opacity:0.65">step {frame.steps} · dt {number(frame.dt, "s")} · {number(1e-3 * frame.ms, "s")} a step{rate}'
        f"{touching}</div>",
    ]
    lines += [f'<div style="color:{css(STATUS["failed"])}">{html.escape(m)}</div>' for m in frame.messages[:2]]
    lines += [f'<div style="opacity:0.65"><i>{html.escape(n)}</i></div>' for n in frame.notes[-1:]]
    return f'<div style="padding:0 0.9em 0.4em;font-size:0.85em;line-height:1.5">{"".join(lines)}</div>'
