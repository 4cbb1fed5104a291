"""The progress bar of an assembly: how far gaps have come down, on a logarithmic scale."""

import math
import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

INTERVAL = 0.05  # seconds between two updates of the bar
DECADES = 12  # from a gap of 1 m to one of 1e-12 m


class AssemblyProgress:
    """A context; `update` is the callback of `assemble`. Writes to the error stream, a bar only on a terminal."""

    def __init__(self, name: str) -> None:
        self.console = Console(file=sys.stderr)
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[gap]}"),
            TimeElapsedColumn(),
            console=self.console,
        )
        self.task = self.bar.add_task(f"Assembling {name}", total=DECADES, gap="")
        self.drawn = 0.0

    def __enter__(self) -> "AssemblyProgress":
        if self.console.is_terminal:
            self.bar.start()
        return self

    def update(self, iterations: int, largest: float) -> None:
        """Called after iterations: how many, and the largest gap before the last [m or rad]."""
        now = time.perf_counter()
        if now - self.drawn < INTERVAL:
            return
        self.drawn = now
        done = min(max(-math.log10(max(largest, 1e-300)), 0.0), DECADES)
        self.bar.update(self.task, completed=done, gap=f"{iterations} iterations, largest gap {largest:.1e}")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.console.is_terminal:
            self.bar.update(self.task, completed=DECADES)
            self.bar.stop()
