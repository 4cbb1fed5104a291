"""Calling force fields, which may be functions of the user."""

import numpy as np

from turnbuckle.data.rigid import ForceField


def field_values(name: str, field: ForceField, x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
    """Values (n, 3) of a field at ``x``, ``v`` (n, 3); FloatingPointError, which fails the step, names a field that goes wrong."""
    try:
        value = np.asarray(field(x, v, t, mass), dtype=float)
    except Exception as error:  # whatever the user's function raises
        raise FloatingPointError(f"force '{name}' failed at t = {t:g} s ({type(error).__name__}: {error})") from None
    if value.shape != (len(x), 3):
        raise FloatingPointError(f"force '{name}' gave shape {value.shape}, expected ({len(x)}, 3)")
    return value
