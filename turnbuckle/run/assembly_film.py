"""The way of an assembly, recorded as a film: as many frames as there is motion to see."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnbuckle.data.model import Model
from turnbuckle.geometry.quaternions import conjugate, exponential, logarithm, multiply, norm
from turnbuckle.run.assembly_bodies import Clumps
from turnbuckle.run.outputs import Outputs
from turnbuckle.scene.scene import Scene
from turnbuckle.solvers.displacement.conditions import Poses

SEEN = 0.005  # motion that a picture shows, of the size of the scene or [rad]; less waits for more
STRIDE = 0.05  # motion from a frame to the next
MOST = 6  # frames an iteration
HELD = 0.25  # seconds that the last picture stays


@dataclass
class _Picture:
    """What a recorder asks of a state."""

    time: float
    x: np.ndarray

    def positions(self) -> np.ndarray:
        return self.x

    def velocities(self) -> np.ndarray:
        return np.zeros_like(self.x)


class Film:
    """Recordings of an assembly; nothing where no path is given. Times are those of the film, speeds are 0."""

    def __init__(self, paths: Sequence[Path], model: Model, made: Clumps, scene: Scene) -> None:
        self._made, self._last = made, made.poses
        self._size = max(model.size, 1e-300)
        self._rate = scene.definition.frames_per_second
        self._count = 0
        self._outputs = Outputs(paths, model, self._rate, {"scene": scene.name, "what": "assembly"}) if paths else None
        self._write(made.poses)

    @property
    def notes(self) -> list[str]:
        """What recorders have to say."""
        return [] if self._outputs is None else self._outputs.notes

    @property
    def paths(self) -> list[Path]:
        """Files written."""
        return [] if self._outputs is None else self._outputs.paths

    def frame(self, poses: Poses) -> None:
        """The next iteration."""
        if self._outputs is None:
            return
        turn = logarithm(multiply(poses.q, conjugate(self._last.q)))
        shift = norm(poses.x - self._last.x).max(initial=0.0) / self._size
        motion = max(float(shift), float(norm(turn).max(initial=0.0)))
        if motion < SEEN:
            return
        count = int(np.clip(np.ceil(motion / STRIDE), 1, MOST))
        for part in np.arange(1, count + 1) / count:
            x = self._last.x + part * (poses.x - self._last.x)
            self._write(Poses(x, multiply(exponential(part * turn), self._last.q)))
        self._last = poses

    def end(self, poses: Poses) -> None:
        """The last picture, held."""
        if self._outputs is None:
            return
        self.frame(poses)
        for _ in range(int(HELD * self._rate)):
            self._write(poses)

    def _write(self, poses: Poses) -> None:
        if self._outputs is not None:
            self._outputs.write(_Picture(self._count / self._rate, self._made.positions(poses)))  # type: ignore[arg-type]
            self._count += 1

    def close(self) -> list[str]:
        """Finish the files; what went wrong, a sentence each."""
        return [] if self._outputs is None else self._outputs.close()
