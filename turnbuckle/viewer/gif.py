"""An animated GIF written frame by frame.

Pillow wants all frames at once, so each is encoded by Pillow as a picture of its own (with its own best 256 colours),
and its image block is put into the film. A GIF that lost its end plays up to there.
"""

import io
from typing import BinaryIO

import numpy as np
from PIL import Image


class GifWriter:
    """Appends frames to a file."""

    def __init__(self, file: BinaryIO, size: tuple[int, int], frames_per_second: float) -> None:
        self._file = file
        self._rate = frames_per_second
        self._frames = 0
        self._elapsed = 0  # [1/100 s], the unit of the format
        width, height = (s.to_bytes(2, "little") for s in size)
        file.write(b"GIF89a" + width + height + b"\x00\x00\x00")  # no common colours
        file.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # for ever

    def write(self, picture: np.ndarray) -> None:
        """Add a picture (height, width, 3) uint8."""
        colors = Image.fromarray(picture).quantize(256, method=Image.Quantize.MEDIANCUT)
        encoded = io.BytesIO()
        colors.save(encoded, "GIF", interlace=False)
        single = encoded.getvalue()
        flags = single[10]
        table_size = 3 << ((flags & 7) + 1) if flags & 0x80 else 0
        table, at = single[13 : 13 + table_size], 13 + table_size
        while single[at] == 0x21:  # extensions: skip their blocks
            at = _after_blocks(single, at + 2)
        descriptor = single[at : at + 9]
        # the rounded time of the frame's end, so that delays in hundredths add up to the true length
        self._frames += 1
        end = max(round(100 * self._frames / self._rate), self._elapsed + 2)  # players ignore less than 2
        delay = min(end - self._elapsed, 65535)
        self._elapsed += delay
        self._file.write(b"\x21\xf9\x04\x04" + delay.to_bytes(2, "little") + b"\x00\x00")
        own_table = 0x80 | (flags & 7)
        self._file.write(descriptor + bytes([own_table]) + table + single[at + 10 : _after_blocks(single, at + 11)])

    def finish(self) -> None:
        """The end mark."""
        self._file.write(b"\x3b")


def _after_blocks(data: bytes, at: int) -> int:
    """Behind a chain of blocks, each with its length ahead, that an empty one ends."""
    while data[at]:
        at += 1 + data[at]
    return at + 1
