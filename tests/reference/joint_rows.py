"""Joints as functions phi(P_a, A, P_b, B) = 0 of a point and a frame of each body, written without derivatives.

Points are (batch, 3), frames (batch, 3, 3) with axes x, y, z as columns; values may be complex, so nothing here takes an
absolute value or a conjugate. Result (batch, rows). The point and frame of ``a`` move against the domain of ``b``.
"""

from collections.abc import Callable

import numpy as np

Rows = Callable[..., np.ndarray]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(-1)


def _axes(frame: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return frame[..., 0], frame[..., 1], frame[..., 2]


def _stack(*parts: np.ndarray) -> np.ndarray:
    return np.stack(parts, axis=-1)


def ball(pa, fa, pb, fb):
    return pa - pb


def parallel(pa, fa, pb, fb):
    """z of both frames along each other."""
    x, y, _ = _axes(fa)
    return _stack(_dot(x, fb[..., 2]), _dot(y, fb[..., 2]))


def same_rotation(pa, fa, pb, fb):
    (ax, ay, az), (bx, by, bz) = _axes(fa), _axes(fb)
    return _stack(_dot(ax, by), _dot(ay, bz), _dot(az, bx))


def line(pa, fa, pb, fb):
    """P_a on the line through P_b along z of b."""
    x, y, _ = _axes(fb)
    return _stack(_dot(x, pa - pb), _dot(y, pa - pb))


def plane(pa, fa, pb, fb):
    """P_a in the plane through P_b with normal z of b."""
    return _stack(_dot(fb[..., 2], pa - pb))


def revolute(*poses):
    return np.concatenate([ball(*poses), parallel(*poses)], axis=-1)


def cylindrical(*poses):
    return np.concatenate([line(*poses), parallel(*poses)], axis=-1)


def prismatic(*poses):
    return np.concatenate([line(*poses), same_rotation(*poses)], axis=-1)


def planar(*poses):
    return np.concatenate([plane(*poses), parallel(*poses)], axis=-1)


def weld(*poses):
    return np.concatenate([ball(*poses), same_rotation(*poses)], axis=-1)


def angle(value: float) -> Rows:
    """Angle [rad] between z of both frames."""

    def rows(pa, fa, pb, fb):
        return _stack(_dot(fa[..., 2], fb[..., 2]) - np.cos(value))

    return rows


def universal(*poses):
    """z of both frames, an axis of each body, perpendicular; both points together."""
    return np.concatenate([ball(*poses), angle(np.pi / 2)(*poses)], axis=-1)


def twist(pa, fa, pb, fb):
    """No relative rotation about the axes z where these agree; x of a in the plane of x, z of b."""
    return _stack(_dot(fa[..., 0], fb[..., 1]) - _dot(fa[..., 1], fb[..., 0]))


def distance(value: float) -> Rows:
    """Distance of the points [m]."""

    def rows(pa, fa, pb, fb):
        return _stack(np.sqrt(_dot(pa - pb, pa - pb)) - value)

    return rows


def rolling_ball(radius: float) -> Rows:
    """Rates: a ball around P_a touches the plane with normal z of b without slip."""

    def rows(pa, fa, pb, fb, va, wa, vb, wb):
        contact = pa - radius * fb[..., 2]
        return va + np.cross(wa, contact - pa) - vb - np.cross(wb, contact - pb)

    return rows


def rolling_wheel(radius: float) -> Rows:
    """Rates: the edge of a thin wheel around P_a with axle z of a touches the plane with normal z of b without slip."""

    def rows(pa, fa, pb, fb, va, wa, vb, wb):
        axle, normal = fa[..., 2], fb[..., 2]
        up = normal - _dot(normal, axle)[..., None] * axle
        contact = pa - radius * up / np.sqrt(_dot(up, up))[..., None]
        return va + np.cross(wa, contact - pa) - vb - np.cross(wb, contact - pb)

    return rows
