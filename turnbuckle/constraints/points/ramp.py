"""Gradual activation (Local, 4.5).

The paper applies ``j/n`` of the force that would land, in the steps j = 1..n. Since that force is meant to land in *one*
step, the point arrives after about ``2 n^(1/3)`` steps and overshoots by half; it is here as ``mode="paper"``. The
default closes ``1/(n-j+1)`` of the gap that was there at the start of the step, so the gap falls linearly to zero, with a
velocity that goes with it, and never faster than ``max_speed``.
"""

import warp as wp

from turnbuckle.math.types import real

wp.set_module_options({"enable_backward": False})


@wp.func
def kept_fraction(n: int, j: int, paper: wp.uint8, speed: real, gap: real, h: real):
    """The fraction of the gap that step ``j`` of ``n`` leaves open; 0 from the step in which the constraint is met."""
    if paper != wp.uint8(0):
        return real(1.0) - real(wp.min(j, n)) / real(n)
    left = wp.max(n - j + 1, 1)
    kept = real(1.0) - real(1.0) / real(left)
    if gap > real(0.0):
        kept = wp.max(kept, real(1.0) - speed * h / gap)
    return kept


@wp.func
def advance(c: int, kept: real, phase: wp.array(dtype=wp.int32), step: wp.array(dtype=wp.int32)):
    """Count the step; a constraint that keeps nothing of its gap is fully active from here on."""
    if kept == real(0.0):
        phase[c] = 0
    else:
        step[c] = step[c] + 1
