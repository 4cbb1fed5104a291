"""Second derivatives of the dihedral angle (NumPy, vectorised); `bending` has the angle and its gradient.

With ``d = x1 - x0``, ``a = x2 - x0``, ``b = x3 - x0``, ``n = d x a`` and m its direction,

    g_a = -|d| n / |n|^2,    dg_a/da = -|d| / |n|^2 (I - 2 m m^T) [d]x,    dg_a/dd = |d| / |n|^2 (I - 2 m m^T) [a]x - n e^T / |n|^2,

the same for b with ``n = b x d``, and ``g_d = -((a . d) g_a + (b . d) g_b) / |d|^2``.
"""

import numpy as np

from turnbuckle.bodies.stiffness import Gradients, skew, to_corners
from turnbuckle.data.model import Hinges


def bends(hinges: Hinges, x: np.ndarray) -> Gradients:
    """``C = theta - theta_0`` [rad] of each hinge."""
    x0 = x[hinges.points[:, 0]]
    d, a, b = (x[hinges.points[:, k]] - x0 for k in (1, 2, 3))
    size = np.maximum(np.linalg.norm(d, axis=1), 1e-100)
    e = d / size[:, None]
    sides = [_side(d, a, size, e, 1.0), _side(d, b, size, e, -1.0)]
    n1, n2 = sides[0][0], sides[1][0]
    angle = np.arctan2(np.einsum("nd,nd->n", np.cross(n1, n2), e), np.einsum("nd,nd->n", n1, n2)) - hinges.angle
    angle -= 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    h = np.zeros((len(d), 9, 9))
    g_d = np.zeros_like(d)
    for k, (p, (_, g, by_own, by_edge)) in enumerate(zip((a, b), sides, strict=True)):
        own = slice(3 + 3 * k, 6 + 3 * k)
        along = np.einsum("nd,nd->n", p, d)[:, None] / (size * size)[:, None]
        g_d -= along * g
        h[:, own, own] = by_own
        h[:, own, :3] = by_edge
        h[:, :3, own] = by_edge.transpose(0, 2, 1)
        h[:, :3, :3] -= along[:, :, None] * by_edge
        h[:, :3, :3] -= g[:, :, None] * (p / (size * size)[:, None] - 2.0 * along * d / (size * size)[:, None])[:, None]
    h = 0.5 * (h + h.transpose(0, 2, 1))
    gradient = np.hstack([g_d, sides[0][1], sides[1][1]])
    full = np.hstack([-(g_d + sides[0][1] + sides[1][1]), gradient])
    return Gradients(hinges.points, hinges.k, hinges.k_d, angle, full, to_corners(h, 3))


def _side(
    d: np.ndarray, p: np.ndarray, size: np.ndarray, e: np.ndarray, sign: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Normal ``sign d x p``, gradient by p, and its derivatives by p and by d."""
    n = sign * np.cross(d, p)
    length = np.maximum(np.linalg.norm(n, axis=1), 1e-6 * size * size)  # thinner triangles: bounded, not exact
    m = n / length[:, None]
    factor = (sign * size / length**2)[:, None, None]
    mirror = np.eye(3) - 2.0 * m[:, :, None] * m[:, None, :]
    by_own = -factor * np.einsum("nij,njk->nik", mirror, skew(d))
    by_edge = factor * np.einsum("nij,njk->nik", mirror, skew(p)) - (n / (length**2)[:, None])[:, :, None] * e[:, None]
    return n, -n * (size / length**2)[:, None], by_own, by_edge
