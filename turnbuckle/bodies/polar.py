"""The rotation nearest to a 3 x 3 matrix: of all R with ``R^T R = I`` and ``det R = 1``, the one with the largest ``R : F``.

Where ``det F > 0`` this is the factor R of the polar decomposition ``F = R S``, found by Higham's iteration
``X <- (g X + X^-T / g) / 2`` with ``g = sqrt(|X^-1| / |X|)``: quadratic, five or six cheap turns at the strains of solids,
without a memory of earlier steps (a decomposition that starts from its last result would make a run depend on its
history). Elements that are flat or inside out, where that iteration finds a reflection or nothing, take the eigenvector of
the largest eigenvalue of Davenport's 4 x 4 matrix N, ``R(q) : F = q^T N q``, by Jacobi rotations, which always ends: S then
has its smallest singular value negative (Irving, Teran, Fedkiw 2004), so that an inverted element goes back through
its shortest way. Where two rotations are equally near, one is taken, always the same.
"""

import warp as wp

from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
FLAT = wp.constant(wp.float64(1e-5))  # of |F|^3: determinants below it go the safe way
SWEEPS = 12


@wp.func
def from_rows(a: vec3, b: vec3, c: vec3):
    """The matrix with rows a, b, c."""
    return mat33(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])


@wp.func
def largest_rotation(f: mat33) -> mat33:
    """The nearest rotation to any ``f`` (zero included: the identity), by Davenport's eigenvector."""
    n = wp.mat44d(
        f[0, 0] + f[1, 1] + f[2, 2], f[2, 1] - f[1, 2], f[0, 2] - f[2, 0], f[1, 0] - f[0, 1],
        f[2, 1] - f[1, 2], f[0, 0] - f[1, 1] - f[2, 2], f[0, 1] + f[1, 0], f[0, 2] + f[2, 0],
        f[0, 2] - f[2, 0], f[0, 1] + f[1, 0], f[1, 1] - f[0, 0] - f[2, 2], f[1, 2] + f[2, 1],
        f[1, 0] - f[0, 1], f[0, 2] + f[2, 0], f[1, 2] + f[2, 1], f[2, 2] - f[0, 0] - f[1, 1],
    )  # fmt: skip
    size = wp.ddot(f, f)
    q = wp.mat44d(
        real(1.0), real(0.0), real(0.0), real(0.0), real(0.0), real(1.0), real(0.0), real(0.0),
        real(0.0), real(0.0), real(1.0), real(0.0), real(0.0), real(0.0), real(0.0), real(1.0),
    )  # fmt: skip
    sweep = int(0)
    going = int(1)
    while going == 1:
        left = real(0.0)
        for i in range(3):
            for j in range(i + 1, 4):
                off = n[i, j]
                left += off * off
                if off != real(0.0):
                    ratio = (n[j, j] - n[i, i]) / (real(2.0) * off)
                    t = real(1.0) / (wp.abs(ratio) + wp.sqrt(ratio * ratio + real(1.0)))
                    if ratio < real(0.0):
                        t = -t
                    c = real(1.0) / wp.sqrt(t * t + real(1.0))
                    s = t * c
                    for k in range(4):
                        a = n[k, i]
                        b = n[k, j]
                        n[k, i] = c * a - s * b
                        n[k, j] = s * a + c * b
                    for k in range(4):
                        a = n[i, k]
                        b = n[j, k]
                        n[i, k] = c * a - s * b
                        n[j, k] = s * a + c * b
                    n[i, j] = real(0.0)
                    n[j, i] = real(0.0)
                    for k in range(4):
                        a = q[k, i]
                        b = q[k, j]
                        q[k, i] = c * a - s * b
                        q[k, j] = s * a + c * b
        sweep += 1
        if sweep == SWEEPS or left <= real(1e-31) * size:
            going = 0
    best = int(0)
    for k in range(1, 4):
        if n[k, k] > n[best, best]:
            best = k
    turn = wp.normalize(wp.quatd(q[1, best], q[2, best], q[3, best], q[0, best]))
    return wp.quat_to_matrix(turn)


@wp.func
def nearest_rotation(f: mat33) -> mat33:
    """The rotation R with the largest ``R : f``; finite for every finite ``f``."""
    a = vec3(f[0, 0], f[0, 1], f[0, 2])
    b = vec3(f[1, 0], f[1, 1], f[1, 2])
    c = vec3(f[2, 0], f[2, 1], f[2, 2])
    largest = wp.max(wp.max(wp.abs(a)), wp.max(wp.max(wp.abs(b)), wp.max(wp.abs(c))))
    if largest > real(1e50) or largest < real(1e-50):  # products of three would leave the range of numbers
        largest = wp.max(largest, real(1e-300))
        a = a / largest
        b = b / largest
        c = c / largest
    squared = wp.dot(a, a) + wp.dot(b, b) + wp.dot(c, c)
    if wp.dot(a, wp.cross(b, c)) <= FLAT * squared * wp.sqrt(squared):
        return largest_rotation(from_rows(a, b, c))
    change = real(1.0)
    turns = int(0)
    while change > real(1e-15) and turns < 20:  # the square of the last change; the error left is about that
        u = wp.cross(b, c)
        v = wp.cross(c, a)
        w = wp.cross(a, b)
        inverse = real(1.0) / wp.dot(a, u)
        own = wp.dot(a, a) + wp.dot(b, b) + wp.dot(c, c)
        other = (wp.dot(u, u) + wp.dot(v, v) + wp.dot(w, w)) * inverse * inverse
        g = real(0.5)
        h = real(0.5) * inverse
        if change > real(1e-4):
            scale = wp.sqrt(wp.sqrt(other / own))
            g = g * scale
            h = h / scale
        a1 = a * g + u * h
        b1 = b * g + v * h
        c1 = c * g + w * h
        change = wp.length_sq(a1 - a) + wp.length_sq(b1 - b) + wp.length_sq(c1 - c)
        a = a1
        b = b1
        c = c1
        turns += 1
    return from_rows(a, b, c)
