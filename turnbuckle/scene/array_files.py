"""Arrays that live in files beside a scene: `points.npy`, `scene.npz#key`."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.suggestion import did_you_mean

MAX_BYTES = 8 * 2**30  # unpacked; a file that claims more is refused before memory is asked for


class ArrayFiles:
    """Reads arrays named in a scene file, relative to its folder. Nothing in them is executed (no pickles)."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def load(self, text: str) -> np.ndarray:
        """The array of `file.npz#key` or `file.npy`; `InputError` where it cannot be read."""
        name, mark, key = text.partition("#")
        suffix = Path(name).suffix.lower()
        if suffix not in (".npz", ".npy") or bool(mark) != (suffix == ".npz"):
            raise InputError(f"expected an array, 'file.npz#key' or 'file.npy', got the text {text[:60]!r}")
        path = self.folder / name
        if not path.is_file():
            raise InputError(f"there is no file {str(path)!r}")
        try:
            return self._npz(path, key) if suffix == ".npz" else self._npy(path)
        except InputError:
            raise
        except Exception as error:  # zipfile, zlib and NumPy each raise kinds of their own on damaged files
            raise InputError(f"{str(path)!r} cannot be read as an array ({str(error)[:100]})") from None

    @staticmethod
    def _npy(path: Path) -> np.ndarray:
        # A memory map checks the size that the header claims against the file before any memory is taken.
        return np.array(np.load(path, mmap_mode="r", allow_pickle=False))

    @staticmethod
    def _npz(path: Path, key: str) -> np.ndarray:
        with zipfile.ZipFile(path) as archive:
            names = [entry.removesuffix(".npy") for entry in archive.namelist()]
            if key not in names:
                raise InputError(f"{str(path)!r} has no array {key!r}{did_you_mean(key, names)}")
            size = archive.getinfo(f"{key}.npy").file_size
            if size > MAX_BYTES:
                raise InputError(f"the array {key!r} in {str(path)!r} takes {size / 2**30:.0f} GiB unpacked")
            with archive.open(f"{key}.npy") as file:
                version = np.lib.format.read_magic(file)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(file)
                claimed = int(np.prod([float(n) for n in shape])) * dtype.itemsize
                if dtype.hasobject or claimed > size:
                    raise InputError(f"the array {key!r} in {str(path)!r} is damaged or no array of numbers")
            with np.load(path, allow_pickle=False) as arrays:
                return np.array(arrays[key])
