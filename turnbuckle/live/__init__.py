"""Looking at a running simulation or a recording in the browser, and taking hold of it.

`view(scene or recording)` opens a page. `Session` (a simulation in a thread of its own) and `Player` (a recording) work
without a page, too.
"""

from turnbuckle.live.player import Player
from turnbuckle.live.session import Session
from turnbuckle.live.show import View, view

__all__ = ["Player", "Session", "View", "view"]
