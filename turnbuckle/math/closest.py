"""Closest points on segments and triangles, as weights of their corners (Ericson, Real-Time Collision Detection, 5.1)."""

import warp as wp

from turnbuckle.math.types import real, vec3


@wp.func
def closest_on_segment(p: vec3, a: vec3, b: vec3):
    """Weights of a and b; exactly (1, 0, 0) or (0, 1, 0) beyond an end."""
    d = b - a
    length2 = wp.dot(d, d)
    t = real(0.0)
    if length2 > real(0.0):
        t = wp.clamp(wp.dot(p - a, d) / length2, real(0.0), real(1.0))
    return vec3(real(1.0) - t, t, real(0.0))


@wp.func
def closest_on_triangle(p: vec3, a: vec3, b: vec3, c: vec3):
    """Barycentric weights of the closest point; exactly 0 for the corners that the closest edge or corner leaves out."""
    ab = b - a
    ac = c - a
    ap = p - a
    d1 = wp.dot(ab, ap)
    d2 = wp.dot(ac, ap)
    if d1 <= real(0.0) and d2 <= real(0.0):
        return vec3(real(1.0), real(0.0), real(0.0))
    bp = p - b
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    if d3 >= real(0.0) and d4 <= d3:
        return vec3(real(0.0), real(1.0), real(0.0))
    vc = d1 * d4 - d3 * d2
    if vc <= real(0.0) and d1 >= real(0.0) and d3 <= real(0.0):
        t = d1 / (d1 - d3)
        return vec3(real(1.0) - t, t, real(0.0))
    cp = p - c
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    if d6 >= real(0.0) and d5 <= d6:
        return vec3(real(0.0), real(0.0), real(1.0))
    vb = d5 * d2 - d1 * d6
    if vb <= real(0.0) and d2 >= real(0.0) and d6 <= real(0.0):
        t = d2 / (d2 - d6)
        return vec3(real(1.0) - t, real(0.0), t)
    va = d3 * d6 - d5 * d4
    if va <= real(0.0) and (d4 - d3) >= real(0.0) and (d5 - d6) >= real(0.0):
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return vec3(real(0.0), real(1.0) - t, t)
    scale = real(1.0) / (va + vb + vc)
    beta = vb * scale
    gamma = vc * scale
    return vec3(real(1.0) - beta - gamma, beta, gamma)
