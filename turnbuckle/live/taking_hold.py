"""From mouse events of the page to commands: drags and clicks on bodies. Runs in viser's event loop and never waits."""

from concurrent.futures import Future
from typing import Any

import numpy as np

from turnbuckle.live.drawing import Body
from turnbuckle.live.panel_pose import PosePanel
from turnbuckle.live.panel_run import RunPanel
from turnbuckle.live.picking import nearest, pick_ray
from turnbuckle.live.session import Session
from turnbuckle.live.stage import Stage


class TakingHold:
    """Listens on the bodies of a stage. Callbacks are coroutines: viser keeps their order."""

    def __init__(self, session: Session, stage: Stage, panel: RunPanel, posing: PosePanel) -> None:
        self._session, self._panel, self._posing = session, panel, posing
        self.last: Future[Any] | None = None  # the newest command, for tests
        for body in stage.bodies:
            if not body.shape.still:
                self._listen(body)

    def _listen(self, body: Body) -> None:
        async def dragged(event: Any) -> None:
            self._drag(body, event, self._panel.exact)

        async def dragged_exactly(event: Any) -> None:
            self._drag(body, event, True)

        async def clicked(event: Any) -> None:
            self._click(body, event)

        body.node.on_drag("left")(dragged)
        body.node.on_drag("left", modifier="shift")(dragged_exactly)
        body.node.on_click(clicked)

    def _drag(self, body: Body, event: Any, exact: bool) -> None:
        session = self._session
        hand: Any = self._posing.poser if self._posing.posing.value else session
        if event.phase == "start":
            pick = nearest(session.shapes, body.number, session.frame.x, np.array(event.start_position))
            self.last = hand.grab(pick) if hand is not session else session.grab(pick, exact)
        if event.phase == "end":
            self.last = hand.let_go()
        else:
            hand.drag(np.array(event.end_position))

    def _click(self, body: Body, event: Any) -> None:
        if not self._panel.pins.value or self._posing.posing.value:
            return
        session = self._session
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        shapes, x = session.shapes, session.frame.x
        pick = pick_ray([shapes[body.number]], x, origin, direction)
        if pick is not None:
            self.last = session.toggle_pin(nearest(shapes, body.number, x, pick.place))
