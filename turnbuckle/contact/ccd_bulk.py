"""Times of impact of many moving pairs at once, from arrays alone.

A query is eight positions (8, 3): four corners at the start of the step, then the same four at its end; corners move
along straight lines. The order is that of the public query sets of Wang et al. 2021, "A Large-Scale Benchmark and an
Inclusion-Based Algorithm for Continuous Collision Detection": vertex, then the face's three; or ea0, ea1, eb0, eb1.
"""

import numpy as np
import warp as wp

from turnbuckle.contact.ccd_additive import HIT, NOT_FINITE, walk_queries
from turnbuckle.contact.ccd_cubic import cubic_queries
from turnbuckle.contact.ccd_threads import launch_over_threads, on_device
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE
from turnbuckle.data.errors import InputError

KINDS = {"vertex_face": VERTEX_FACE, "edge_edge": EDGE_EDGE}
METHODS = ("additive", "cubic")
TIGHTNESS = 0.01
LIMIT = 256  # intervals of the walk


def time_of_impact(
    queries: np.ndarray,
    kind: str | int | np.ndarray,
    min_separation: float | np.ndarray = 0.0,
    *,
    method: str = "additive",
    tightness: float = TIGHTNESS,
    max_iterations: int = LIMIT,
    device: str = "cpu",
    threads: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Whether and when pairs come nearer than ``min_separation`` during a step.

    ``queries`` (n, 8, 3) [m]: rows 0 to 3 at the start, 4 to 7 at the end; vertex, face's three, or ea0 ea1 eb0 eb1.
    ``kind``: "vertex_face" (0), "edge_edge" (1), or (n,) numbers. ``min_separation`` [m]: one, or (n,).

    Returns ``hit`` (n,) bool and ``time`` (n,), the part of the step in [0, 1]; 1 without a hit.

    Method "additive" (Li, Kaufman, Jiang 2021; `turnbuckle.contact.ccd_core`) never misses: where the distance gets down
    to ``min_separation`` there is a hit, at or before that time. A pair as near as that at the start (or touching)
    hits at time 0. The time is when at most ``tightness`` of the starting gap (above ``min_separation``) is left, or
    earlier when ``max_iterations`` were not enough; so a pair that only comes as near as that may be a false alarm.
    Method "cubic" (Provot 1997, the paper's) is for comparison: it misses impacts, and knows no separation.

    Raises `InputError` for wrong shapes, coordinates that are not finite (or beyond 1e150), unknown names.
    """
    queries = np.ascontiguousarray(queries, dtype=np.float64)
    if queries.ndim != 3 or queries.shape[1:] != (8, 3):
        raise InputError(f"time_of_impact: queries have the shape {queries.shape}; give (n, 8, 3)")
    if method not in METHODS:
        raise InputError(f"time_of_impact: there is no method {method!r}; choose one of {', '.join(METHODS)}")
    if not (0.0 < tightness < 1.0 and max_iterations >= 1):
        raise InputError("time_of_impact: tightness lies between 0 and 1, and max_iterations is 1 or more")
    n = len(queries)
    kinds = _kinds(kind, n)
    separation = _separations(min_separation, n)
    if method == "cubic" and separation.any():
        raise InputError("time_of_impact: the cubic test knows no min_separation; leave it 0 or take method='additive'")
    given = [on_device(queries, wp.float64, device), on_device(kinds, wp.int32, device), int(len(kinds) > 1)]
    state = wp.empty(n, dtype=wp.uint8, device=device)
    when, gap = (wp.empty(n, dtype=wp.float64, device=device) for _ in range(2))
    if method == "cubic":
        launch_over_threads(cubic_queries, n, [*given, state, when], device, threads)
    else:
        asked = [on_device(separation, wp.float64, device), int(len(separation) > 1), tightness, max_iterations]
        launch_over_threads(walk_queries, n, [*given, *asked, state, when, gap], device, threads)
    status, time = state.numpy(), when.numpy()
    if (status == NOT_FINITE).any():
        bad = int(np.argmax(status == NOT_FINITE))
        raise InputError(f"time_of_impact: query {bad} has a coordinate that is not finite or beyond 1e150 m")
    return status == HIT, time


def _kinds(kind: str | int | np.ndarray, n: int) -> np.ndarray:
    if isinstance(kind, str):
        if kind not in KINDS:
            raise InputError(f"time_of_impact: there is no kind {kind!r}; choose vertex_face or edge_edge")
        return np.array([KINDS[kind]], np.int32)
    kinds = np.atleast_1d(np.asarray(kind))
    if kinds.ndim != 1 or len(kinds) not in (1, n) or not np.isin(kinds, (VERTEX_FACE, EDGE_EDGE)).all():
        raise InputError(f"time_of_impact: kind is 0 (vertex_face) or 1 (edge_edge), one or {n}")
    return kinds.astype(np.int32)


def _separations(min_separation: float | np.ndarray, n: int) -> np.ndarray:
    separation = np.atleast_1d(np.asarray(min_separation, dtype=np.float64))
    if separation.ndim != 1 or len(separation) not in (1, n) or not (separation >= 0.0).all():
        raise InputError(f"time_of_impact: min_separation is 0 or more [m], one or {n}")
    if not (separation < 1e150).all():
        raise InputError("time_of_impact: min_separation is not finite or beyond 1e150 m")
    return separation
