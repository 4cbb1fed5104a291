"""`import_scene`: a scene from the file of another program, by its suffix. Exported as `turnbuckle.import_scene`."""

import os
from pathlib import Path

from turnbuckle.data.errors import InputError
from turnbuckle.io.import_contact import with_contact
from turnbuckle.io.imported import Imported
from turnbuckle.io.mjcf import read_mjcf
from turnbuckle.io.urdf import read_urdf
from turnbuckle.io.usd_import import read_usd

SUFFIXES = (".urdf", ".xml", ".mjcf", ".usd", ".usda", ".usdc", ".usdz")


def import_scene(path: str | os.PathLike[str], shapes: str = "collision", contact: bool = False) -> Imported:
    """The scene in a URDF, MJCF or USD file, and what of it has no counterpart.

    An .xml is URDF where it begins with <robot>, else MJCF. ``shapes``: of URDF, "collision" or "visual". ``contact``: turn
    contact on, but not between bodies that overlap at the start.
    Raises `InputError`.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: only {', '.join(SUFFIXES)} can be imported; convert it to one of these first")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, name the file in it")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if suffix.startswith(".usd"):
        found = read_usd(path)
    elif suffix == ".urdf" or _is_robot(path):
        found = read_urdf(path, shapes)
    else:
        found = read_mjcf(path)
    return with_contact(found) if contact else found


def _is_robot(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return b"<robot" in file.read(4096)
    except OSError:
        return False
