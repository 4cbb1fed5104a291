"""Recordings: what a run writes as it goes, and what reads it back. One file a format.

``open_recorder(path, shapes, ...)`` chooses by the suffix (`SUFFIXES`); ``read_recording(path)`` reads .npz and .vtkhdf.
"""

from turnbuckle.io.opening import SUFFIXES, open_recorder
from turnbuckle.io.recorder import Recorder
from turnbuckle.io.recording import Recording, read_recording

__all__ = ["SUFFIXES", "Recorder", "Recording", "open_recorder", "read_recording"]
