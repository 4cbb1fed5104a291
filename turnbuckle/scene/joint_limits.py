"""Limits of joints that limit nothing: Appendix A of Displacement itself has an angle of at most 9 rad."""

from __future__ import annotations

import math
from collections.abc import Iterator

from turnbuckle.scene.definitions import JointDef, SceneDef

ROUNDING = 1e-9  # [rad]; pi itself, written with a few digits, is no mistake


def idle_limits(definition: SceneDef) -> Iterator[tuple[int, str, str]]:
    """Limits above pi: number of the constraint, "angle" or "twist", and a sentence about it."""
    for i, joint in enumerate(definition.constraints):
        if not isinstance(joint, JointDef):
            continue
        for what in ("angle", "twist"):
            limits = getattr(joint, what)
            if limits is None or limits.max is None or limits.max <= math.pi + ROUNDING:
                continue
            low = limits.min is not None and limits.min > (0.0 if what == "angle" else -math.pi)
            nothing = f"only its min of {limits.min:g} does" if low else f"the {what} is free"
            yield (
                i,
                what,
                f"joint {joint.name!r}: {what} max {limits.max:g} rad is above pi and limits nothing; {nothing}",
            )


def idle_limit_warnings(definition: SceneDef) -> Iterator[str]:
    """The sentences alone."""
    return (text for _, _, text in idle_limits(definition))
