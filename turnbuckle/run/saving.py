"""When checkpoints are written."""

import time
from pathlib import Path

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.io.checkpoint import save
from turnbuckle.run.outputs import RecordingError

INTERVAL = 30.0  # seconds of wall time between two checkpoints where no number of steps is given
PART = 0.03  # of the wall time that saving may take then


class Saver:
    """Writes the checkpoint file of a run, over and over."""

    def __init__(self, path: Path | None, every: int | None) -> None:
        """``every``: steps between two. Raises InputError."""
        if every is not None and path is None:
            raise InputError("every is given without a checkpoint; name the file to write")
        if every is not None and every < 1:
            raise InputError(f"every is {every}; give at least 1 step")
        self.path, self.every = path, every
        self.saved = False
        self._wait = INTERVAL
        self._last = time.perf_counter()

    def due(self, steps: int) -> bool:
        """Whether a checkpoint is to be written now, after ``steps`` steps."""
        if self.path is None:
            return False
        if self.every is not None:
            return steps % self.every == 0
        return time.perf_counter() - self._last > self._wait

    def save(self, model: Model, state: State) -> None:
        """Write it. Raises `RecordingError`, a `StepError`; the one before then stays."""
        if self.path is None:
            return
        began = time.perf_counter()
        try:
            save(self.path, model, state)
        except (OSError, InputError) as error:
            raise RecordingError(f"checkpoint {self.path}: cannot be written ({error})") from None
        self.saved = True
        self._last = time.perf_counter()
        self._wait = max(INTERVAL, (self._last - began) / PART)
