"""The progress bar of a run: simulated time, steps per second, worst residual."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

INTERVAL = 0.1  # seconds between two updates of the bar


class RunProgress:
    """A context; `update` is the callback of the run. Writes to the error stream, a bar only on a terminal."""

    def __init__(self, name: str) -> None:
        self.console = Console(file=sys.stderr)
        self.status = self.console.status(f"Building {name} (kernels are compiled when first used) ...")
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:.3f} / {task.total:.3f} s"),
            TextColumn("{task.fields[rate]}"),
            TextColumn("{task.fields[residual]}"),
            TimeRemainingColumn(),
            console=self.console,
        )
        self.name = name
        self.task = self.bar.add_task(name, total=0.0, start=False, rate="", residual="")
        self.building = True
        self.begun = self.drawn = 0.0
        self.first_step = 0

    def __enter__(self) -> "RunProgress":
        if self.console.is_terminal:
            self.status.start()
        else:
            self.console.print(f"Building {self.name} (kernels are compiled when first used) ...", highlight=False)
        return self

    def update(self, done_seconds: float, total_seconds: float, steps: int, worst_residual: float) -> None:
        """Called after steps: simulated time done and in all [s], steps done, worst residual so far [m]."""
        now = time.perf_counter()
        if self.building:
            self.building = False
            self.begun, self.first_step = now, steps
            if self.console.is_terminal:
                self.status.stop()
                self.bar.start()
                self.bar.start_task(self.task)
        if now - self.drawn < INTERVAL and done_seconds < total_seconds:
            return
        self.drawn = now
        rate = (steps - self.first_step) / (now - self.begun) if now > self.begun else 0.0
        self.bar.update(
            self.task,
            total=total_seconds,
            completed=done_seconds,
            rate=f"{rate:.0f} steps/s" if rate else "",
            residual=f"worst residual {worst_residual:.1e}",
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.status.stop()
        if not self.building and self.console.is_terminal:
            self.bar.stop()
