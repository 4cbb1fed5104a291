"""The errors a user may meet. Each message is one sentence: what, where, and what to do."""


class TurnbuckleError(Exception):
    """Base of all errors that Turnbuckle raises on purpose."""


class InputError(TurnbuckleError, ValueError):
    """The input is wrong (exit code 2 of the command). Nothing has run."""


class ConflictError(InputError):
    """Two constraints share a mass point, which a local pass cannot solve (Local, section 1)."""


class StepError(TurnbuckleError, RuntimeError):
    """A step failed (exit code 1 of the command). The last good state stands."""
