"""Recording kernel launches once and replaying them every step."""

from turnbuckle.compute.host import host
from turnbuckle.compute.program import Program, default_threads
from turnbuckle.compute.start import start_warp

__all__ = ["Program", "default_threads", "host", "start_warp"]
