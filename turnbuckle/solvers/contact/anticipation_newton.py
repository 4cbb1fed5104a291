"""Newton's method on the natural maps of a dense contact problem: from where Gauss-Seidel has come to round-off.

    F_n = w r_n - (w r_n - u_n)+,    F_t = w r_t - P(w r_t - u_t),    u = B r + still,

w a local inverse mass, P the projection onto the section of radius ``w mu r_n+``; piecewise smooth. Steps are least squares
of least size, so that redundant contacts do no harm. One that does not shorten F gives way to a damped one (Levenberg and
Marquardt: the sum of ``|F' d + F|^2`` and ``damping |d|^2``).
"""

import numpy as np
import scipy.linalg as la

from turnbuckle.solvers.contact import friction_shapes

ITERATIONS = 40  # of an attempt
GAIN = 0.9  # what an undamped step must make of |F|
DAMPING = (1e-3, 1e6)  # first and largest, of the mean of the diagonal of F'^T F'
ROUND_OFF = 1e-16  # [m/s]


def finish(
    b: np.ndarray, still: np.ndarray, friction: np.ndarray, count: int, axes: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, int]:
    """Impulses (m, 3), and the iterations they took, from ``r``; ``b`` (3 m, 3 m), ``still`` (m, 3) less the floors."""
    m = len(still)
    own = b.reshape(m, 3, m, 3)[np.arange(m), :, np.arange(m), :]
    w = np.trace(own, axis1=1, axis2=2) / 3.0
    w[w <= 0.0] = 1.0
    scale = np.repeat(1.0 / w, 3)

    def evaluate(at: np.ndarray) -> tuple[float, tuple]:
        maps = _natural_map(w, friction, count, axes, at, (b @ at.ravel()).reshape(m, 3) + still)
        return float(np.linalg.norm(maps[0])), maps

    damping = DAMPING[0]
    size, (value, of_r, of_u) = evaluate(r)
    steps = 0
    while steps < ITERATIONS and size > ROUND_OFF * m:
        steps += 1
        matrix = np.einsum("iab,ibc->iac", of_u, b.reshape(m, 3, 3 * m)).reshape(3 * m, 3 * m)
        matrix.reshape(m, 3, m, 3)[np.arange(m), :, np.arange(m), :] += of_r
        matrix *= scale
        change = la.lstsq(matrix, -value.ravel(), cond=1e-13, lapack_driver="gelsy")[0]
        tried = r + (scale * change).reshape(m, 3)
        tried_size, maps = evaluate(tried)
        if not tried_size <= GAIN * size:
            square, slope = matrix.T @ matrix, matrix.T @ value.ravel()
            mean = np.trace(square) / len(square)
            while damping <= DAMPING[1]:
                change = la.solve(square + damping * mean * np.eye(3 * m), -slope, assume_a="pos")
                tried = r + (scale * change).reshape(m, 3)
                tried_size, maps = evaluate(tried)
                if tried_size < size:
                    break
                damping *= 8.0
            else:
                break
            damping = max(0.1 * damping, 1e-14)
        r, size, (value, of_r, of_u) = tried, tried_size, maps
    r = r.copy()
    r[:, 0] = np.maximum(r[:, 0], 0.0)
    r[:, 1:] = friction_shapes.project(r[:, 1:], friction * r[:, 0], count, axes)
    return r, steps


def _natural_map(w, friction, count, axes, r, u):
    """Values (m, 3) and derivatives (m, 3, 3) by impulses and by velocities."""
    m = len(r)
    of_r, of_u = np.zeros((m, 3, 3)), np.zeros((m, 3, 3))
    presses = w * r[:, 0] - u[:, 0] > 0.0
    value = np.empty((m, 3))
    value[:, 0] = np.where(presses, u[:, 0], w * r[:, 0])
    of_u[presses, 0, 0] = 1.0
    of_r[~presses, 0, 0] = w[~presses]
    radius = w * friction * np.maximum(r[:, 0], 0.0)
    tried = w[:, None] * r[:, 1:] - u[:, 1:]
    held = friction_shapes.project(tried, radius, count, axes)
    value[:, 1:] = w[:, None] * r[:, 1:] - held
    by_tried, by_radius = _projection_slope(tried, radius, count, axes)
    of_u[:, 1:, 1:] = by_tried
    of_r[:, 1:, 1:] = w[:, None, None] * (np.eye(2) - by_tried)
    of_r[:, 1:, 0] = -by_radius * (w * friction * (r[:, 0] > 0.0))[:, None]
    return value, of_r, of_u


def _projection_slope(p, radius, count, axes):
    """Derivatives of `friction_shapes.project` by the point (m, 2, 2) and by the radius (m, 2).

    Of the disk in closed form. A polygon's projection is linear in pieces and of degree one, thus differences within a
    piece are exact.
    """
    if count == 0:
        size = np.hypot(p[:, 0], p[:, 1])
        slides = size > radius
        d = p / np.where(size > 0.0, size, 1.0)[:, None]
        across = np.eye(2) - d[:, :, None] * d[:, None, :]
        rim = (radius / np.where(size > 0.0, size, 1.0))[:, None, None] * across
        return np.where(slides[:, None, None], rim, np.eye(2)), np.where(slides[:, None], d, 0.0)
    h = 1e-7 * (np.hypot(p[:, 0], p[:, 1]) + radius) + 1e-300
    here = friction_shapes.project(p, radius, count, axes)
    by_p = np.stack(
        [(friction_shapes.project(p + h[:, None] * e, radius, count, axes) - here) / h[:, None] for e in np.eye(2)],
        axis=2,
    )
    return by_p, (friction_shapes.project(p, radius + h, count, axes) - here) / h[:, None]
