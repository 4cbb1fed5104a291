"""The choice of a recorder by the suffix of the file."""

from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io.npz import NpzRecorder
from turnbuckle.io.recorder import Recorder, check_target, reason
from turnbuckle.io.usd import UsdRecorder
from turnbuckle.io.vtkhdf import VtkHdfRecorder

SUFFIXES = (".npz", ".vtkhdf", ".usdc", ".usda", ".usd")


def open_recorder(
    path: str | Path,
    shapes: list[Shape],
    *,
    up_axis: str,
    frames_per_second: float,
    info: dict[str, Any] | None = None,
) -> Recorder:
    """Start a recording of the bodies ``shapes``; the suffix of ``path`` (one of `SUFFIXES`) chooses the format.

    ``up_axis`` is "Y" or "Z", ``frames_per_second`` [1/s] how fast frames are meant to be shown, ``info`` anything that
    JSON can hold. A file already there is replaced. Raises InputError, before anything has run, for an unknown suffix,
    a folder that does not exist or a place that cannot be written to.
    """
    path = check_target(path, SUFFIXES)
    if up_axis not in ("Y", "Z"):
        raise InputError(f"recording {path}: up_axis is '{up_axis}'; use 'Y' or 'Z'")
    if not (np.isfinite(frames_per_second) and frames_per_second > 0):
        raise InputError(f"recording {path}: frames_per_second is {frames_per_second}; give a positive number")
    suffix = path.suffix.lower()
    facts = {**(info or {}), "up_axis": up_axis, "frames_per_second": float(frames_per_second)}
    try:
        if suffix == ".npz":
            return NpzRecorder(path, shapes, facts)
        if suffix == ".vtkhdf":
            return VtkHdfRecorder(path, shapes, facts)
        return UsdRecorder(path, shapes, facts)
    except OSError as error:
        raise InputError(f"recording {path}: cannot be written ({reason(error)}); choose another place") from None
