"""Kernels of additive CCD: over queries of eight corners, over pairs of surfaces, and the closest points of pairs.

The arithmetic and its proof stand in `turnbuckle.contact.ccd_core`.
"""

import warp as wp

from turnbuckle.contact.ccd_core import TOUCH, WALK

wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)
U8 = wp.array(dtype=wp.uint8)
F64 = wp.array(dtype=wp.float64)

CLEAR = 0
HIT = 1
NOT_FINITE = 2

# Corners of pair i of surfaces. Expects the arrays below; gives `kind`, `corner[4]`, `c0[12]`, `c1[12]`.
GATHER = r"""
    const int kind = kinds.data[i];
    int corner[4];
    if (kind) {
        for (int k = 0; k < 2; ++k) {
            corner[k] = edges.data[2 * a.data[i] + k];
            corner[2 + k] = edges.data[2 * b.data[i] + k];
        }
    } else {
        corner[0] = a.data[i];
        for (int k = 0; k < 3; ++k) corner[1 + k] = faces.data[3 * b.data[i] + k];
    }
    double c0[12], c1[12];
    for (int k = 0; k < 4; ++k)
        for (int c = 0; c < 3; ++c) {
            c0[3 * k + c] = x0.data[3 * corner[k] + c];
            c1[3 * k + c] = x1.data[3 * corner[k] + c];
        }
"""


@wp.func_native(
    """
    const int kind = kinds.data[i * kind_step];
    const double *c0 = queries.data + 24 * (long long)i, *c1 = c0 + 12;
    double xi = separation.data[i * separation_step];
"""
    + WALK
    + """
    status_out.data[i] = status;
    time_out.data[i] = status == 1 ? time : 1.0;
    gap_out.data[i] = gap;
"""
)
def _walk_query(
    queries: F64, kinds: I32, kind_step: int, separation: F64, separation_step: int, tightness: wp.float64, limit: int,
    status_out: U8, time_out: F64, gap_out: F64, i: int,
): ...  # fmt: skip


@wp.kernel
def walk_queries(
    begin: int, queries: F64, kinds: I32, kind_step: int, separation: F64, separation_step: int,
    tightness: wp.float64, limit: int, status_out: U8, time_out: F64, gap_out: F64,
):  # fmt: skip
    """CCD of query i: 24 numbers in ``queries``; ``kinds`` and ``separation`` are one (step 0) or one each (step 1)."""
    _walk_query(
        queries, kinds, kind_step, separation, separation_step, tightness, limit, status_out, time_out, gap_out,
        begin + wp.tid(),
    )  # fmt: skip


@wp.func_native(
    GATHER
    + """
    double xi = separation.data[i * separation_step];
"""
    + WALK
    + """
    status_out.data[i] = status;
    time_out.data[i] = status == 1 ? time : 1.0;
    gap_out.data[i] = gap;
"""
)
def _walk_pair(
    kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, separation: F64, separation_step: int,
    tightness: wp.float64, limit: int, status_out: U8, time_out: F64, gap_out: F64, i: int,
): ...  # fmt: skip


@wp.kernel
def walk_pairs(
    begin: int, kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, separation: F64,
    separation_step: int, tightness: wp.float64, limit: int, status_out: U8, time_out: F64, gap_out: F64,
):  # fmt: skip
    """CCD of pair i of surfaces (flat arrays) whose vertices go straight from ``x0`` to ``x1``."""
    _walk_pair(
        kinds, a, b, faces, edges, x0, x1, separation, separation_step, tightness, limit, status_out, time_out,
        gap_out, begin + wp.tid(),
    )  # fmt: skip


@wp.func_native(
    """
    const int i = which.data[j];
    const double when = time.data[j];
"""
    + GATHER
    + TOUCH
    + """
    for (int k = 0; k < 4; ++k) { corners_out.data[4 * j + k] = corner[k]; weights_out.data[4 * j + k] = weights[k]; }
    for (int c = 0; c < 3; ++c) normal_out.data[3 * j + c] = unit_normal[c];
    distance_out.data[j] = distance;
"""
)
def _touch_pair(
    which: I32, kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, time: F64,
    corners_out: I32, weights_out: F64, normal_out: F64, distance_out: F64, j: int,
): ...  # fmt: skip


@wp.kernel
def touch_pairs(
    begin: int, which: I32, kinds: I32, a: I32, b: I32, faces: I32, edges: I32, x0: F64, x1: F64, time: F64,
    corners_out: I32, weights_out: F64, normal_out: F64, distance_out: F64,
):  # fmt: skip
    """Corners, their weights, unit normal (all flat) of pair ``which[j]`` at ``time[j]``, and its distance at the start."""
    _touch_pair(
        which, kinds, a, b, faces, edges, x0, x1, time, corners_out, weights_out, normal_out, distance_out,
        begin + wp.tid(),
    )  # fmt: skip
