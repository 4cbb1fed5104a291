"""The progress bar of a sweep: runs that ended, and how many of them failed."""

import sys
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


class SweepProgress:
    """A context; `update` is the callback of `sweep`. Writes to the error stream, a bar only on a terminal."""

    def __init__(self, name: str) -> None:
        self.console = Console(file=sys.stderr)
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[told]}"),
            TimeRemainingColumn(),
            console=self.console,
        )
        self.task = self.bar.add_task(f"Sweeping {name}", total=None, told="writing scenes")

    def __enter__(self) -> "SweepProgress":
        if self.console.is_terminal:
            self.bar.start()
        return self

    def update(self, ended: int, total: int, failed: int) -> None:
        """Called as runs end: how many have, of how many, and how many of them failed."""
        told = f"{ended} of {total} runs" + (f", {failed} failed" if failed else "")
        self.bar.update(self.task, completed=ended, total=total, told=told)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.console.is_terminal:
            self.bar.stop()
