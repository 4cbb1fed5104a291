"""Timing steps, and the straight line through times."""

import statistics
import time
from collections.abc import Callable

import numpy as np


def median_ms(call: Callable[[], object], warm_up: int = 5, seconds: float = 2.0, least: int = 5) -> float:
    """Median wall time of a call [ms], from as many calls as fit into `seconds`, `least` at least."""
    for _ in range(warm_up):
        call()
    times: list[float] = []
    start = time.perf_counter()
    while len(times) < least or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - before))
    return statistics.median(times)


def line_fit(n: np.ndarray, t: np.ndarray) -> tuple[float, float, np.ndarray]:
    """The line a + b n through the times t, each trusted to the same percentage.

    Sizes span decades, so it is the relative misfit whose squares are summed: otherwise the largest size alone would
    choose the line. Returns a, b and the relative misfit t / (a + b n) - 1 of each size.
    """
    n, t = np.asarray(n, dtype=float), np.asarray(t, dtype=float)
    (a, b), *_ = np.linalg.lstsq(np.stack([1.0 / t, n / t], axis=1), np.ones(len(t)), rcond=None)
    return float(a), float(b), t / (a + b * n) - 1.0
