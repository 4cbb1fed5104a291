"""Surfaces of the primitive solids: closed triangle meshes, normals outwards, centred on the origin, along z."""

import numpy as np

from turnbuckle.data.errors import InputError

AROUND = 32  # corners of a circle

Surface = tuple[np.ndarray, np.ndarray]


def box_surface(size: np.ndarray) -> Surface:
    """A box of lengths ``size`` (3,) [m]: 8 vertices (corner x + 2 y + 4 z), 12 triangles (m, 3) int32."""
    half = 0.5 * _positive("box", size)
    corner = np.arange(8)
    vertices = np.stack([corner & 1, corner >> 1 & 1, corner >> 2], axis=1) * (2.0 * half) - half
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


def sphere_surface(radius: float, around: int = AROUND) -> Surface:
    """A sphere [m], its vertices on it: `around` meridians, half as many bands."""
    _positive("sphere", (radius,))
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, max(around // 2, 2) + 1)[1:-1]
    return revolve(radius * np.cos(angle), radius * np.sin(angle), (-radius, radius), around)


def cylinder_surface(radius: float, length: float, around: int = AROUND) -> Surface:
    """A cylinder [m], from z = -length/2 to length/2."""
    _positive("cylinder", (radius, length))
    half = 0.5 * length
    return revolve(np.full(2, radius), np.array([-half, half]), (-half, half), around)


def capsule_surface(radius: float, length: float, around: int = AROUND) -> Surface:
    """A capsule [m]: a cylinder from z = -length/2 to length/2 with half spheres beyond."""
    _positive("capsule", (radius, length))
    half = 0.5 * length
    angle = np.linspace(0.0, 0.5 * np.pi, max(around // 4, 1) + 1)[:-1]
    height = half + radius * np.sin(angle)
    ring = radius * np.cos(angle)
    return revolve(np.r_[ring[::-1], ring], np.r_[-height[::-1], height], (-half - radius, half + radius), around)


def revolve(radii: np.ndarray, heights: np.ndarray, poles: tuple[float, float], around: int = AROUND) -> Surface:
    """A profile turned about z: rings of ``radii`` at ``heights`` (k,) going up [m], closed at the heights ``poles``.

    Returns vertices (k around + 2, 3): ring by ring, the lower pole last but one, the upper last; and triangles.
    """
    angle = 2.0 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = np.concatenate(
        [radii[:, None, None] * circle, np.broadcast_to(heights[:, None, None], (len(radii), around, 1))], axis=2
    )
    ends = np.array([[0.0, 0.0, poles[0]], [0.0, 0.0, poles[1]]])
    vertices = np.concatenate([rings.reshape(-1, 3), ends])
    return vertices, ring_triangles(len(radii), around)


def ring_triangles(rings: int, around: int) -> np.ndarray:
    """Triangles (m, 3) int32 over rings of vertices, ring by ring, closed by two poles, the last two vertices."""
    ids = np.arange(rings * around).reshape(rings, around)
    after = np.roll(ids, -1, axis=1)
    a, b, c, d = ids[:-1].ravel(), after[:-1].ravel(), after[1:].ravel(), ids[1:].ravel()
    low, high = np.full(around, rings * around), np.full(around, rings * around + 1)
    triangles = [(a, b, c), (a, c, d), (low, after[0], ids[0]), (high, ids[-1], after[-1])]
    return np.concatenate([np.stack(t, axis=1) for t in triangles]).astype(np.int32)


def _positive(what: str, sizes: object) -> np.ndarray:
    values = np.asarray(sizes, dtype=np.float64)
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise InputError(f"{what}: the sizes are {values.tolist()}; give positive lengths in metres")
    return values
