"""Options and result of the displacement solver."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from turnbuckle.solvers.displacement.conditions import Poses

WORST = 5  # joints named in a warning
STAGNATES = 0.9  # of the gap in the middle of the iterations: what is left is not going to close


@dataclass(frozen=True)
class DisplacementOptions:
    """As the user's `DisplacementDef`; anything with these attributes will do."""

    scheme: Literal[1, 2] = 2
    alpha: float | None = None  # factor on m1 m2 / (m1 + m2); None: the one that suits each gap, see `displace`
    weights: Literal["max", "sum"] = "max"
    tolerance: float = 1e-6  # [m or rad]
    stop: Literal["corrections", "gaps"] = "corrections"  # what has to be within it
    max_iterations: int = 200
    on_limit: Literal["continue", "stop"] = "continue"
    mobility: Literal["physical", "user_parameter"] = "physical"
    max_rotation: float = 0.5  # of a body in an iteration [rad]


@dataclass
class DisplacementResult:
    """Where the bodies went, and what is left open."""

    x: np.ndarray  # (n, 3) centres of mass [m]
    q: np.ndarray  # (n, 4) xyzw
    points: np.ndarray  # (m, 3) mass points [m]
    iterations: int
    converged: bool
    names: list[str]  # (k,) joints, then ties
    gap: np.ndarray  # (k,) [m], largest of each
    angle: np.ndarray  # (k,) [rad]
    history: list[float] = field(default_factory=list)  # largest gap before each iteration and at the end [m or rad]

    @property
    def poses(self) -> Poses:
        """Where the bodies are."""
        return Poses(self.x, self.q)

    def worst(self, count: int = WORST) -> list[tuple[str, float, float]]:
        """Name, gap [m] and angle [rad] of the joints that are furthest open, the worst first, none that is closed."""
        size = np.nan_to_num(np.maximum(self.gap, self.angle), nan=np.inf)
        found: dict[str, tuple[str, float, float]] = {}
        for i in np.argsort(-size, kind="stable"):
            if size[i] > 0.0 and len(found) < count:  # a point constraint has many rows: the worst stands for it
                found.setdefault(self.names[i], (self.names[i], float(self.gap[i]), float(self.angle[i])))
        return list(found.values())

    def warning(self) -> str:
        """What to tell the user when joints stay open, and what may help; empty when all joints closed."""
        if self.converged:
            return ""
        named = ", ".join(
            f"'{name}' by {gap:.3g} m" + (f" and {angle:.3g} rad" if angle > 0.0 else "")
            for name, gap, angle in self.worst()
        )
        return f"displacement: joints are still open after {self.iterations} iterations, the worst are {named}; {self._advice()}"

    def _advice(self) -> str:
        if not np.isfinite(self.history[-1] if self.history else 0.0):
            return "the corrections diverge: take a smaller dt or alpha"
        if self.stagnates:
            return "more iterations hardly help: look for joints that contradict each other, or start from assemble"
        return "allow more iterations (displacement.max_iterations)"

    @property
    def stagnates(self) -> bool:
        """Whether the largest gap has hardly become less over the second half of the iterations."""
        before = self.history[: len(self.history) // 2 + 1]
        return len(self.history) > 2 and not self.history[-1] < STAGNATES * min(before)
