"""The page of a session or a recording: puts panels and stage together, and feeds them frames from its own thread."""

import threading
import time
from pathlib import Path
from typing import Any

from turnbuckle.live.frame import Frame
from turnbuckle.live.panel_constraints import ConstraintPanel
from turnbuckle.live.panel_export import ExportPanel
from turnbuckle.live.panel_physics import PhysicsPanel
from turnbuckle.live.panel_play import PlayPanel
from turnbuckle.live.panel_plots import PlotPanel
from turnbuckle.live.panel_pose import PosePanel
from turnbuckle.live.panel_run import RunPanel
from turnbuckle.live.player import Player
from turnbuckle.live.server import Served
from turnbuckle.live.session import Session
from turnbuckle.live.stage import Stage
from turnbuckle.live.taking_hold import TakingHold

FRAMES = 60.0  # a second at most
LISTS = 6.0  # times a second that lists and numbers are written anew
BRAND = (46, 92, 138)


class Page:
    """Shows ``source`` on a server that runs. `close` stops feeding it."""

    def __init__(self, served: Served, source: Session | Player, title: str, folder: Path) -> None:
        """``folder``: where scenes are saved."""
        self.served, self.source, self._folder = served, source, folder
        server = served.viser
        server.gui.configure_theme(
            control_layout="floating", control_width="large", show_logo=False, show_share_button=False,
            brand_color=BRAND,
        )  # fmt: skip
        server.gui.set_panel_label(title)
        server.gui.main_panel.dock_right()
        frame = source.frame
        self.stage = Stage(server, source.shapes, frame.x, source.up_axis, source.size, len(frame.marks.points))
        tabs = server.gui.add_tab_group()
        self.panels: dict[str, Any] = {}
        if isinstance(source, Session):
            self._live(server, source, tabs)
        else:
            with tabs.add_tab("Play", icon="player-play"):
                self.panels["play"] = PlayPanel(server.gui, source)
        with tabs.add_tab("Export", icon="download"):
            self.panels["export"] = ExportPanel(server.gui, source, title)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._feed, name="turnbuckle page", daemon=True)
        self._thread.start()

    def _live(self, server: Any, session: Session, tabs: Any) -> None:
        with tabs.add_tab("Run", icon="player-play"):
            self.panels["run"] = RunPanel(server.gui, session, self.stage)
        with tabs.add_tab("Constraints", icon="link"):
            self.panels["constraints"] = ConstraintPanel(server.gui, session, self.stage)
        with tabs.add_tab("Physics", icon="adjustments"):
            self.panels["physics"] = PhysicsPanel(server.gui, session)
        with tabs.add_tab("Plots", icon="chart-line"):
            self.panels["plots"] = PlotPanel(server.gui, session)
        with tabs.add_tab("Pose", icon="hand-grab"):
            self.panels["pose"] = PosePanel(server.gui, session, self._folder)
        self.holding = TakingHold(session, self.stage, self.panels["run"], self.panels["pose"])

    def close(self) -> None:
        """Stop; the server goes on."""
        self._ended.set()
        self._thread.join(timeout=10.0)

    def _feed(self) -> None:
        """Draw frames as they come, as fast as browsers take them."""
        shown = -1
        lists = 0.0
        while not self._ended.is_set():
            frame = self.source.next_frame(shown, 0.3)
            if frame.number == shown:
                continue
            began = time.perf_counter()
            with self.served.viser.atomic():
                self.stage.show(frame)
                if began - lists >= 1.0 / LISTS or not frame.running:
                    lists = began
                    self._write(frame)
            self.served.viser.flush()
            shown = frame.number
            self._ended.wait(max(1.0 / FRAMES - (time.perf_counter() - began), 0.0))

    def _write(self, frame: Frame) -> None:
        for name, panel in self.panels.items():
            if name == "constraints":
                panel.update(frame, self.stage.size)
            else:
                panel.update(frame)
