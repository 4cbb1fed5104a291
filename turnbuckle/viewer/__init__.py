"""Pictures and films of a run, drawn without a display.

``open_picture(path, shapes, ...)`` chooses by the suffix (`SUFFIXES`); `Renderer` draws single frames.
"""

from turnbuckle.viewer.pictures import SUFFIXES, PictureRecorder, open_picture
from turnbuckle.viewer.render import Renderer

__all__ = ["SUFFIXES", "PictureRecorder", "Renderer", "open_picture"]
