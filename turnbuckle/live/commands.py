"""Commands for a thread that owns something: put from any thread, carried out in order by that one."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any


@dataclass
class _Command:
    action: Callable[[], Any]
    key: str | None
    future: "Future[Any]"


class Commands:
    """A queue that never blocks who puts. Of commands with one key only the newest waits."""

    def __init__(self) -> None:
        self._waiting: deque[_Command] = deque()
        self._changed = threading.Condition()

    def put(self, action: Callable[[], Any], key: str | None = None) -> "Future[Any]":
        """Add a command; its future holds what it returns or raises. One of the same ``key`` that waits is dropped."""
        command = _Command(action, key, Future())
        with self._changed:
            if key is not None:
                for old in [c for c in self._waiting if c.key == key]:
                    self._waiting.remove(old)
                    old.future.cancel()
            self._waiting.append(command)
            self._changed.notify()
        return command.future

    def carry_out(self, timeout: float = 0.0) -> int:
        """Carry out all that waits, after up to ``timeout`` [s] of waiting for the first; how many."""
        done = 0
        with self._changed:
            if not self._waiting and timeout > 0.0:
                self._changed.wait(timeout)
        while True:
            with self._changed:
                if not self._waiting:
                    return done
                command = self._waiting.popleft()
            if command.future.set_running_or_notify_cancel():
                try:
                    command.future.set_result(command.action())
                except Exception as error:  # whoever put it decides what to do
                    command.future.set_exception(error)
            done += 1
