"""A force field written as expressions. It keeps its text, by which a checkpoint knows it again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from turnbuckle.scene.expression import Expression, compile_expression

VARIABLES = ("x", "y", "z", "vx", "vy", "vz", "t", "m")


@dataclass(frozen=True)
class ExpressionForce:
    """``force(x (n, 3) [m], v (n, 3) [m/s], t [s], mass (n,) [kg]) -> (n, 3)``, a `ForceField` (or torque field)."""

    texts: tuple[str, ...]  # along x, y, z
    parts: tuple[Expression, ...] = field(repr=False)

    @classmethod
    def of(cls, texts: Sequence[str]) -> ExpressionForce:
        """Compile three expressions in `VARIABLES`. Raises `InputError`."""
        return cls(tuple(texts), tuple(compile_expression(text, VARIABLES) for text in texts))

    def __call__(self, x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
        """Values (n, 3)."""
        given = dict(zip(VARIABLES, (*x.T, *v.T, t, mass), strict=True))
        return np.stack([np.broadcast_to(part(**given), len(mass)) for part in self.parts], axis=1)
