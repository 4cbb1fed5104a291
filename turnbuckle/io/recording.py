"""Reading a recording back."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io.npz import read_npz
from turnbuckle.io.usd_recording import read_usd_recording
from turnbuckle.io.vtkhdf import read_vtkhdf

READ = (".npz", ".vtkhdf", ".usdc", ".usda", ".usd", ".usdz")  # suffixes that can be read back


@dataclass(frozen=True)
class Recording:
    """A run as it was recorded; frames are fetched from the file when asked for."""

    times: np.ndarray  # [s], (frames,) float64
    shapes: list[Shape]
    x: Callable[[int], np.ndarray]  # frame -> positions [m], (points, 3) float64
    v: Callable[[int], np.ndarray]  # frame -> velocities [m/s], (points, 3) float64
    info: dict[str, Any]  # with up_axis, frames_per_second, schema_version

    def view(self, **options: Any) -> Any:
        """Play the recording in the browser, or in a notebook: `turnbuckle.live.view` with its options."""
        return import_module("turnbuckle.live.show").view(self, **options)  # above this layer: loaded when asked for

    def __len__(self) -> int:
        return len(self.times)


def read_recording(path: str | Path) -> Recording:
    """Open a .npz (or the .npz.part of a killed run) or a .vtkhdf of Turnbuckle, or USD. Raises InputError for all else."""
    path = Path(path)
    suffix = path.with_suffix("").suffix.lower() if path.suffix == ".part" else path.suffix.lower()
    if suffix == ".npz":
        shapes, info, times, x, v = read_npz(path)
        return Recording(times, shapes, lambda frame: np.array(x[frame]), lambda frame: np.array(v[frame]), info)
    if suffix in READ[1:]:
        shapes, info, times, fetch = read_vtkhdf(path) if suffix == ".vtkhdf" else read_usd_recording(path)
        return Recording(times, shapes, lambda frame: fetch("x", frame), lambda frame: fetch("v", frame), info)
    raise InputError(f"recording {path}: only {', '.join(READ)} can be read back")
