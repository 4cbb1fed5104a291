"""Recording kernel launches once and replaying them every step."""

from turnbuckle.compute.program import Program, default_threads

__all__ = ["Program", "default_threads"]
