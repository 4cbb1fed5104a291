"""The tab "Pose": assembly and posing by hand, and saving the scene."""

from concurrent.futures import Future
from pathlib import Path
from typing import Any

from turnbuckle.live.frame import Frame
from turnbuckle.live.panel_export import name_of
from turnbuckle.live.posing import Poser
from turnbuckle.live.session import Session

HELP = "Posing works on the start of the scene: dragging a body moves it there, and all joints stay closed."


class PosePanel:
    """A switch for posing, buttons to close the joints and to save."""

    def __init__(self, gui: Any, session: Session, folder: Path) -> None:
        self.poser = Poser(session)
        self._folder, self._session = folder, session
        gui.add_markdown(HELP)
        self.posing = gui.add_checkbox("Drag to pose", False, hint="Goes to the start of the scene and pauses")
        self.assemble = gui.add_button("Close all joints", icon="puzzle", hint="Assembles the mechanism")
        self.name = gui.add_text("File", f"{name_of(session.scene.name)}_posed.yaml")
        self.save = gui.add_button("Save scene", icon="device-floppy", color="gray", hint=f"Into {folder.absolute()}")
        self.told = gui.add_markdown("")
        self.posing.on_update(self._switch)
        self.assemble.on_click(lambda _: self.poser.assemble().add_done_callback(self._say))
        self.save.on_click(lambda _: self.poser.save(self.name.value, folder).add_done_callback(self._say))

    def _switch(self, event: Any) -> None:
        if self.posing.value:
            self.poser.begin()

    def _say(self, done: "Future[Any]") -> None:
        """What came of it."""
        if done.cancelled():
            return
        error = done.exception()
        notes = self._session.notes
        self.told.content = f"{error}" if error is not None else (notes[-1] if notes else "")

    def update(self, frame: Frame) -> None:
        """A run ends posing."""
        if frame.running and self.posing.value:
            self.posing.value = False
