"""What can be said of the options of `turnbuckle run` before anything is loaded."""

import math
from collections.abc import Sequence
from pathlib import Path

from turnbuckle.data.errors import InputError

SUFFIXES = (".npz", ".vtkhdf", ".usdc", ".usda", ".usd", ".png", ".gif", ".mp4")  # of io and viewer, not loaded here


def check_options(
    duration: float | None,
    dt: float | None,
    out: Sequence[Path],
    report: Path | None,
    checkpoint: Path | None,
    every: int | None,
    resume: Path | None,
) -> None:
    """Raise `InputError` for numbers out of range, unknown suffixes, folders that are not there."""
    if dt is not None and not (math.isfinite(dt) and dt > 0):
        raise InputError(f"--dt {dt}: expected a number greater than 0 [s]")
    if duration is not None and not (math.isfinite(duration) and duration >= 0):
        raise InputError(f"--duration {duration}: expected a number of at least 0 [s]")
    if every is not None and every < 1:
        raise InputError(f"--every {every}: expected at least 1 step")
    if every is not None and checkpoint is None:
        raise InputError("--every N goes with --checkpoint FILE")
    for path in out:
        if path.suffix.lower() not in SUFFIXES:
            raise InputError(f"--out {path}: expected a file that ends in {', '.join(SUFFIXES)}")
    if len({path.absolute() for path in out}) < len(out):
        raise InputError("--out: the same file is named twice")
    written = [("--out", path) for path in out] + [("--report", report), ("--checkpoint", checkpoint)]
    for option, path in written:
        if path is None:
            continue
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"{option} {path}: is a device or the like, not a file")
        if path.is_dir():
            raise InputError(f"{option} {path}: is a folder, expected a file")
        if not path.absolute().parent.is_dir():
            raise InputError(f"{option} {path}: there is no folder {str(path.parent)!r}")
    if resume is not None and not resume.is_file():
        raise InputError(f"--resume {resume}: there is no such file")
