"""Every scene with contact at three step sizes over a window: all steps ok, nothing intersects, halvings and last resorts rare."""

import numpy as np
import pytest

pytest.importorskip("ipctk")
from turnbuckle.benchmarks.contact_windows import WINDOWS, faults, run

CASES = [pytest.param(name, size, id=f"{name}-{size}") for name in WINDOWS for size in range(3)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), CASES)
def test_a_window_of_each_scene(name: str, size: int) -> None:
    if name == "letters":
        pytest.importorskip("manifold3d")
    done = run(name, WINDOWS[name].steps[size])
    assert done.judged > 5 and max(done.contacts) > 0
    assert faults(done) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", WINDOWS)
def test_no_window_ever_intersects_fails_or_needs_the_last_resort(name: str) -> None:
    """What holds whatever the solver leaves: states are finite and free of intersections."""
    if name == "letters":
        pytest.importorskip("manifold3d")
    done = run(name, WINDOWS[name].steps[1], every=1)
    assert "failed" not in done.status
    assert done.crossing == 0 and done.judged == len(done.status)
    assert not any(done.last_resorts) and np.isfinite(done.went)


def test_what_a_window_lacks_is_told() -> None:
    """The judge itself: a window in which nothing has met or moved does not pass."""
    still = run("local_global", 0.01, seconds=0.02)
    assert faults(still) == []
    still.status[0], still.went = "degraded", 0.0
    still.halvings[1], still.crossing = 1, 2
    told = " ".join(faults(still))
    assert all(word in told for word in ("degraded", "halvings", "intersect", "moved"))
