"""What a save of a USD crate writes over, kept beside it while it saves, so that a kill in the middle costs no frame.

A crate (.usdc) holds values, then its structure: the sections that its table of contents lists. Saving again writes new
values from the beginning of the old structure on, a new structure behind them, and last the place of its table into the
head. A kill in between leaves a file that USD cannot open, with all old values in it. The old structure is small: it is
copied to ``NAME.undo`` before each save, and put back where a file is found broken.
"""

import os
import struct
import time
from pathlib import Path

HEAD = 88  # bytes: "PXR-USDC", version (8), place of the table (int64), reserved
SECTION = struct.Struct("<16sqq")  # name, start, size
START = struct.Struct("<q")


def _undo(path: Path) -> Path:
    return path.with_name(path.name + ".undo")


def keep(path: Path) -> None:
    """Copy the head and the structure of a crate. What a save that failed has left stays: the file is broken since."""
    if _undo(path).exists():
        return
    with path.open("rb") as file:
        head = file.read(HEAD)
        if len(head) < HEAD or head[:8] != b"PXR-USDC":
            return  # nothing was saved yet
        file.seek(START.unpack_from(head, 16)[0])
        (count,) = struct.unpack("<Q", file.read(8))
        starts = [SECTION.unpack(file.read(SECTION.size))[1] for _ in range(count)]
        start = min(starts, default=HEAD)
        file.seek(start)
        structure = file.read()
    fresh = path.with_name(path.name + ".undo.new")
    fresh.write_bytes(START.pack(start) + head + structure)
    os.replace(fresh, _undo(path))


def forget(path: Path) -> None:
    """The file is whole."""
    for name in (_undo(path), path.with_name(path.name + ".undo.new")):
        name.unlink(missing_ok=True)


def put_back(path: Path, patience: float) -> bool:
    """Make a crate that cannot be opened what it was before the save that was cut off.

    False where nothing is kept of it, or where something is written within ``patience`` [s]: a run is saving it right now.
    """
    before = _seen(path)
    if before is None:
        return False
    time.sleep(patience)
    if _seen(path) != before:
        return False
    kept = _undo(path).read_bytes()
    (start,) = START.unpack_from(kept)
    with path.open("r+b") as file:
        file.write(kept[START.size : START.size + HEAD])
        file.seek(start)
        file.write(kept[START.size + HEAD :])
        file.truncate()
    forget(path)
    return True


def _seen(path: Path) -> tuple | None:
    """How a file and its way back look from outside; None where there is no way back."""
    try:
        return tuple((s.st_size, s.st_mtime_ns) for s in (path.stat(), _undo(path).stat()))
    except OSError:
        return None
