"""A recording that plays in a thread of its own, with the frames of a `Session` and the commands of a player."""

import threading
import time
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io import Recording
from turnbuckle.live.commands import Commands
from turnbuckle.live.frame import Frame

SHOWN = 1.0 / 60.0  # [s] of wall time between two frames at least
IDLE = 0.25  # [s] between two looks when nothing plays


class Player:
    """Plays a recording. Make it, then `start` it; `close` ends the thread."""

    def __init__(self, recording: Recording) -> None:
        """Raises `InputError` for a recording without a frame."""
        if len(recording) == 0:
            raise InputError("the recording holds no frame; nothing can be shown")
        self.recording = recording
        self.times = np.asarray(recording.times, dtype=np.float64)
        self.shapes: list[Shape] = recording.shapes
        self.up_axis = str(recording.info.get("up_axis", "Z"))
        x = recording.x(0)
        seen = x[np.isfinite(x).all(axis=1)]
        self.size = float(np.linalg.norm(np.ptp(seen, axis=0))) if len(seen) else 1.0
        self.at = 0  # the frame that is shown
        self.running = False
        self.speed = 1.0
        self.loop = True
        self._commands = Commands()
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._published = threading.Condition()
        self._anchor = (0.0, 0.0)
        self.frame = Frame(x)
        self._publish()

    def __len__(self) -> int:
        return len(self.times)

    def next_frame(self, after: int, timeout: float) -> Frame:
        """The newest frame, once its number is greater than ``after`` or the time [s] is over."""
        with self._published:
            self._published.wait_for(lambda: self.frame.number > after, timeout)
            return self.frame

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._live, name="turnbuckle player", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._commands.put(lambda: None)
        if self._thread is not None:
            self._thread.join(timeout=10.0)

    def run(self) -> "Future[Any]":
        """Play; from the start when the end is reached."""
        return self._commands.put(lambda: self._set_running(True))

    def pause(self) -> "Future[Any]":
        """Stand still."""
        return self._commands.put(lambda: self._set_running(False))

    def step(self, count: int = 1) -> "Future[Any]":
        """Stand still, some frames further on (or back)."""
        return self._commands.put(lambda: self._go(self.at + count))

    def reset(self) -> "Future[Any]":
        """The first frame."""
        return self._commands.put(lambda: self._go(0))

    def seek(self, frame: int) -> "Future[Any]":
        """Stand still at a frame; of several that wait, the last one counts."""
        return self._commands.put(lambda: self._go(frame), key="seek")

    def set_speed(self, speed: float) -> "Future[Any]":
        """Recorded seconds a second."""
        return self._commands.put(lambda: self._set_speed(speed))

    def _go(self, frame: int) -> None:
        self.running = False
        self.at = min(max(int(frame), 0), len(self) - 1)
        self._publish()

    def _set_running(self, on: bool) -> None:
        if on and self.at == len(self) - 1:
            self.at = 0
        self.running = on
        self._anchor = (time.perf_counter(), float(self.times[self.at]))

    def _set_speed(self, speed: float) -> None:
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"speed: expected a number greater than 0, got {speed}")
        self.speed = float(speed)
        self._set_running(self.running) if self.at < len(self) - 1 else None

    def _live(self) -> None:
        while not self._ended.is_set():
            done = self._commands.carry_out(SHOWN if self.running else IDLE)
            if self.running:
                self._play()
            elif done:
                self._publish()

    def _play(self) -> None:
        wanted = self._anchor[1] + (time.perf_counter() - self._anchor[0]) * self.speed
        at = int(np.searchsorted(self.times, wanted, side="right")) - 1
        if at >= len(self) - 1:
            self.at, self.running = len(self) - 1, False
            if self.loop and len(self) > 1:
                self.at = 0
                self._set_running(True)
            self._publish()
        elif at != self.at:
            self.at = max(at, 0)
            self._publish()

    def _publish(self) -> None:
        frame = Frame(x=self.recording.x(self.at), time=float(self.times[self.at]), steps=self.at, running=self.running)
        with self._published:
            self.frame = replace(frame, number=self.frame.number + 1)
            self._published.notify_all()
