"""The command `turnbuckle`. Every verb is a file of its own and imports what is heavy when it is called."""

from turnbuckle.cli.app import main

__all__ = ["main"]
