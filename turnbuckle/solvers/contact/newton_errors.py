"""What an iterate of the Newton solver misses by."""

from dataclasses import dataclass

LOST = 1e299  # [m/s] errors of velocities that are no numbers


@dataclass
class Errors:
    """All in m/s."""

    gradient: float
    primal: float
    shift: float

    @property
    def multipliers(self) -> float:
        """What an update of multipliers and shifts would change."""
        return max(self.primal, self.shift)

    @property
    def worst(self) -> float:
        """The largest of all."""
        return max(self.gradient, self.primal, self.shift)
