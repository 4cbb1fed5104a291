"""Skirts as rings around a waist, one over the other."""

from dataclasses import dataclass

import numpy as np

from turnbuckle.data.errors import InputError

Pair = tuple[float, float]


@dataclass(frozen=True)
class Garment:
    """Cloth of several layers that share no vertex."""

    vertices: np.ndarray  # (n, 3) [m]
    triangles: np.ndarray  # (m, 3) int32, normals outwards
    layer: np.ndarray  # (n,) int32, 0 is the innermost
    top: np.ndarray  # (k,) int32, the waist's vertices


def layered_skirt(
    layers: int = 6,
    around: int = 100,
    rows: int = 28,
    waist: Pair = (0.137, 0.104),
    hem: Pair = (0.46, 0.44),
    height: float = 1.06,
    length: float = 0.74,
    gap: float = 0.008,
    ruffles: int = 12,
    depth: float = 0.03,
) -> Garment:
    """``layers`` skirts, each ``around * rows`` vertices, from the waist at z = ``height`` down by ``length`` [m].

    ``waist`` and ``hem`` are the half axes along x and y of the innermost; each layer lies ``gap`` [m] outside the one
    before. Towards the hem its radius waves ``ruffles`` times around, by ``depth`` of it. Raises InputError.
    """
    if layers < 1 or around < 3 or rows < 2:
        raise InputError(f"skirt: {layers} layers of {around} x {rows} vertices; give at least 1, 3 and 2")
    if not (gap > 0.0 and length > 0.0 and 0.0 <= depth < 0.3):
        raise InputError("skirt: gap and length must be positive, depth from 0 to 0.3")
    down = np.linspace(0.0, 1.0, rows)[:, None]
    angle = 2.0 * np.pi * (np.arange(around) + 0.5 * (np.arange(rows) % 2)[:, None]) / around  # bricks, not squares
    wave = 1.0 + depth * down**2 * np.cos(ruffles * angle)
    spread = down * (1.25 - 0.25 * down)  # wider at the hips than a cone
    vertices, triangles = [], []
    for layer in range(layers):
        radii = [(w + layer * gap + (h - w) * spread) * wave for w, h in zip(waist, hem, strict=True)]
        z = np.broadcast_to(height - length * down, angle.shape)
        vertices.append(np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle), z], axis=2).reshape(-1, 3))
        triangles.append(_bricks(around, rows) + layer * around * rows)
    one = around * rows
    return Garment(
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        np.repeat(np.arange(layers, dtype=np.int32), one),
        (np.arange(layers)[:, None] * one + np.arange(around)).ravel().astype(np.int32),
    )


def _bricks(around: int, rows: int) -> np.ndarray:
    """Triangles over rows that are shifted by half a step each other row, normals outwards where angles go up."""
    ids = np.arange(rows * around).reshape(rows, around)
    found = []
    for row in range(rows - 1):
        upper, lower = ids[row], ids[row + 1]
        after_upper, after_lower = np.roll(upper, -1), np.roll(lower, -1)
        if row % 2 == 0:  # the lower row is shifted forwards
            found += [np.stack([upper, lower, after_upper], 1), np.stack([lower, after_lower, after_upper], 1)]
        else:
            found += [np.stack([upper, lower, after_lower], 1), np.stack([upper, after_lower, after_upper], 1)]
    return np.concatenate(found)
