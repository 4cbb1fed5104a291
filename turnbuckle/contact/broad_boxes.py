"""Boxes around what moves: float32, rounded outwards, about a moving origin so that far away costs no precision.

A box holds its feature at both ends of the step (and so all the way, since vertices move on straight lines), with half
of the inflation on every side: boxes of two features overlap if these come nearer than the mean of their inflations.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})


@wp.struct
class Features:
    """Features of one kind on the device: vertices, edges or faces."""

    corners: wp.array(dtype=wp.int32)  # (n * sides,) vertices of each
    sides: int  # vertices of one: 1, 2 or 3
    count: int
    shape: wp.array(dtype=wp.int32)  # (n,)
    moves: wp.array(dtype=wp.uint8)  # (n,) 0: none of its vertices ever moves
    box: wp.array(dtype=wp.float32)  # (n * 6,) lower x, y, z, then upper x, y, z
    ends: wp.array(dtype=wp.float32)  # (n * 12,) the same at the start, and at the end


@dataclass
class FeatureNumbers:
    """The same on the host."""

    corners: np.ndarray  # (n, sides) int32
    shape: np.ndarray  # (n,) int32
    moves: np.ndarray  # (n,) bool


def make_features(corners: np.ndarray, shape: np.ndarray, moves: np.ndarray, device: str):
    """Features with the vertices ``corners`` (n, sides); ``shape`` and ``moves`` (s,) are of the vertices."""
    corners = np.ascontiguousarray(corners, dtype=np.int32)
    n, sides = corners.shape
    host = FeatureNumbers(corners, shape[corners[:, 0]].astype(np.int32), moves[corners].any(axis=1))
    out = Features()
    out.corners = wp.array(corners.reshape(-1), dtype=wp.int32, device=device)
    out.sides = sides
    out.count = n
    out.shape = wp.array(host.shape, dtype=wp.int32, device=device)
    out.moves = wp.array(host.moves.astype(np.uint8), dtype=wp.uint8, device=device)
    out.box = wp.zeros(6 * n, dtype=wp.float32, device=device)
    out.ends = wp.zeros(12 * n, dtype=wp.float32, device=device)
    return out, host


# Rounding to float32 may go inwards: go on to the next number then. Subtracting the origin and half the inflation in
# float64 errs by at most 2^-53 of each of the two results: `slack` is more than that.
@wp.func_native(
    """
    auto next = [](float f, int up) {
        if (f != f) return f;
        unsigned bits;
        memcpy(&bits, &f, 4);
        if ((bits & 0x7fffffffu) == 0u) bits = up ? 1u : 0x80000001u;
        else if (((bits >> 31) != 0u) == (up != 0)) bits -= 1u;
        else bits += 1u;
        memcpy(&f, &bits, 4);
        return f;
    };
    const double p[3] = {a[0] - origin[0], a[1] - origin[1], a[2] - origin[2]};
    const double q[3] = {b[0] - origin[0], b[1] - origin[1], b[2] - origin[2]};
    float *out = box.data + 6 * v;
    for (int end = 0; end < 2; ++end)
        for (int k = 0; k < 3; ++k) {
            const double at = end ? q[k] : p[k], big = (at < 0.0 ? -at : at) + radius;
            const double lower = at - radius - 1e-15 * big, upper = at + radius + 1e-15 * big;
            float l = (float)lower, u = (float)upper;
            l = (double)l > lower ? next(l, 0) : l;
            u = (double)u < upper ? next(u, 1) : u;
            ends.data[12 * v + 6 * end + k] = l;
            ends.data[12 * v + 6 * end + 3 + k] = u;
            out[k] = end && out[k] < l ? out[k] : l;
            out[3 + k] = end && out[3 + k] > u ? out[3 + k] : u;
        }
"""
)
def _vertex_box(
    box: wp.array(dtype=wp.float32), ends: wp.array(dtype=wp.float32), v: int, a: vec3, b: vec3, origin: vec3, radius: wp.float64
): ...  # fmt: skip


@wp.func_native(
    """
    const int *c = corners.data + sides * i;
    float *out = box.data + 6 * i;
    for (int end = 0; end < 2; ++end) {
        const float *from = vertex.data + 12 * c[0] + 6 * end;
        float lower[3] = {from[0], from[1], from[2]}, upper[3] = {from[3], from[4], from[5]};
        for (int s = 1; s < sides; ++s) {
            const float *other = vertex.data + 12 * c[s] + 6 * end;
            for (int k = 0; k < 3; ++k) {
                lower[k] = other[k] < lower[k] ? other[k] : lower[k];
                upper[k] = other[3 + k] > upper[k] ? other[3 + k] : upper[k];
            }
        }
        for (int k = 0; k < 3; ++k) {
            ends.data[12 * i + 6 * end + k] = lower[k];
            ends.data[12 * i + 6 * end + 3 + k] = upper[k];
            out[k] = end && out[k] < lower[k] ? out[k] : lower[k];
            out[3 + k] = end && out[3 + k] > upper[k] ? out[3 + k] : upper[k];
        }
    }
"""
)
def _feature_box(
    box: wp.array(dtype=wp.float32), ends: wp.array(dtype=wp.float32), vertex: wp.array(dtype=wp.float32), corners: wp.array(dtype=wp.int32),
    sides: int, i: int,
): ...  # fmt: skip


@wp.kernel
def vertex_boxes(
    begin: int,
    x0: wp.array(dtype=vec3),
    x1: wp.array(dtype=vec3),
    inflation: wp.array(dtype=wp.float64),
    origin: wp.array(dtype=vec3),
    vertices: Features,
):
    """Boxes of the vertices at ``x0``, at ``x1`` and between, in place."""
    v = begin + wp.tid()
    _vertex_box(vertices.box, vertices.ends, v, x0[v], x1[v], origin[0], wp.float64(0.5) * inflation[v])


@wp.kernel
def feature_boxes(begin: int, vertices: Features, features: Features):
    """Boxes of edges or faces around those of their vertices, in place."""
    i = begin + wp.tid()
    _feature_box(features.box, features.ends, vertices.ends, features.corners, features.sides, i)
