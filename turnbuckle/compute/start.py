"""Starting Warp without noise."""

import ctypes
import os
import sys

import warp as wp


def start_warp() -> None:
    """Start Warp without its banner, and without the native warning where there is no CUDA driver: that is no news."""
    if wp.config.log_level != wp.LOG_INFO:  # the user has asked for more or less
        wp.init()
        return
    wp.config.log_level = wp.LOG_WARNING
    try:
        ctypes.CDLL("nvcuda.dll" if os.name == "nt" else "libcuda.so.1")
    except OSError:
        sys.stderr.flush()
        kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)
        return
    wp.init()
