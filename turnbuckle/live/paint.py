"""Colours of the page: how well a constraint is kept, what is off, what pushes and pulls."""

from collections.abc import Sequence

import numpy as np

from turnbuckle.live.frame import Reading

OFF = (150, 156, 166)
PUSH = (214, 64, 69)  # contact forces
PULL = (245, 158, 11)  # the hand and pins
_STOPS = np.array([(34, 150, 92), (34, 150, 92), (222, 178, 40), (208, 52, 44)], dtype=np.float64)
_AT = np.array([-16.0, -10.0, -6.0, -3.0])  # log10 of the residual over the scene's size


def residual_color(reading: Reading, size: float) -> tuple[int, int, int]:
    """Green: kept to rounding; yellow: a millionth of the scene's size; red: a thousandth, or broken; grey: off."""
    if reading.broken:
        return (208, 52, 44)
    if not reading.acting:
        return OFF
    level = np.log10(max(reading.residual / max(size, 1e-300), 1e-16)) if np.isfinite(reading.residual) else 0.0
    rgb = [round(float(np.interp(level, _AT, _STOPS[:, k]))) for k in range(3)]
    return rgb[0], rgb[1], rgb[2]


def residual_colors(readings: Sequence[Reading], size: float) -> np.ndarray:
    """Of each reading (n, 3) uint8."""
    return np.array([residual_color(r, size) for r in readings], dtype=np.uint8).reshape(-1, 3)


_FAINT, _STRONG = np.array((214, 226, 240.0)), np.array((94, 24, 148.0))
FORCES = 3.0  # powers of ten from the faintest colour of a force to the strongest


def force_color(reading: Reading, largest: float) -> tuple[int, int, int]:
    """From pale blue to violet: the force over the ``largest`` one that acts [N], a thousandth and less is pale."""
    if not reading.acting or reading.broken:
        return OFF
    part = reading.force / largest if largest > 0.0 and np.isfinite(reading.force) else 0.0
    level = 1.0 + np.log10(max(part, 1e-300)) / FORCES
    rgb = _FAINT + min(max(level, 0.0), 1.0) * (_STRONG - _FAINT)
    return round(rgb[0]), round(rgb[1]), round(rgb[2])


def largest_force(readings: Sequence[Reading]) -> float:
    """Of all constraints that act [N]."""
    return max((r.force for r in readings if r.acting and np.isfinite(r.force)), default=0.0)


def force_colors(readings: Sequence[Reading]) -> np.ndarray:
    """Of each reading (n, 3) uint8."""
    largest = largest_force(readings)
    return np.array([force_color(r, largest) for r in readings], dtype=np.uint8).reshape(-1, 3)


def css(color: tuple[int, int, int]) -> str:
    """As text of a style sheet."""
    return f"rgb({color[0]},{color[1]},{color[2]})"


def number(value: float, unit: str) -> str:
    """Three digits and a prefix: "34.5 mN"."""
    if not np.isfinite(value):
        return f"{value} {unit}"
    if value == 0.0:
        return f"0 {unit}"
    power = int(np.floor(np.log10(abs(value)) / 3.0))
    prefixes = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
    if power not in prefixes:
        return f"{value:.1e} {unit}"
    return f"{value / 1000.0**power:.3g} {prefixes[power]}{unit}"
