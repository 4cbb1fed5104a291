"""Where the control points of a skin start: rings around the bodies of a chain, and a pole at each end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.meshes.spline_surface import ring_gain
from turnbuckle.scene.definitions import CoatingDef, RigidDef, SkinDef
from turnbuckle.scene.trajectories import start_pose

RINGS = 3  # a body
CAP = 0.55  # radius of the ring in the plane of a pole, in parts of the last ring's: makes a dome close to a half ball
DOME = 0.8  # height of the dome over a user's last section, in parts of its radius


@dataclass(frozen=True)
class Ring:
    """Control points (around, 3) in the world at the start [m], and the body that carries them."""

    body: str
    controls: np.ndarray


def automatic_rings(d: SkinDef, shapes: Sequence[Shape], x: np.ndarray) -> tuple[list[Ring], np.ndarray]:
    """Rings from the bodies' surfaces, seen from the line through their centres; and both poles (2, 3) [m]."""
    surfaces = [x[shape.begin : shape.end][shape.triangles] for shape in shapes]  # (m, 3, 3) each
    for shape, surface in zip(shapes, surfaces, strict=True):
        if not len(surface):
            raise InputError(f"'{shape.name}' has no surface to cover")
    centers = np.array([_center(surface) for surface in surfaces])
    axes = _axes(centers, surfaces)
    count = RINGS if d.rings is None else d.rings
    angle = 2.0 * np.pi * np.arange(d.around) / d.around
    rings, circles = [], []
    across = _perpendicular(axes[0])
    for shape, surface, center, axis, previous in zip(
        shapes, surfaces, centers, axes, [axes[0], *axes[:-1]], strict=True
    ):
        across = _carry(across, previous, axis)
        towards = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across))
        place = (surface.reshape(-1, 3) - center) @ axis
        for k in range(count):
            middle = center + (place.min() + (k + 0.5) / count * np.ptp(place)) * axis
            if d.radius is None:
                radius = _filled(farthest_hits(middle, towards, surface), surface, middle, axis)
            else:
                radius = np.full(d.around, d.radius)
            circles.append((middle, radius[:, None] * towards))
            rings.append(Ring(shape.name, middle + ring_gain(d.around) * circles[-1][1]))
    poles = np.array(
        [
            _pole(surfaces[0], centers[0], -axes[0]),
            _pole(surfaces[-1], centers[-1], axes[-1]),
        ]
    )
    return _capped(rings, poles, [circles[0], circles[-1]]), poles


def given_rings(d: SkinDef, bodies: Mapping[str, Any]) -> tuple[list[Ring], np.ndarray]:
    """Rings of the user's sections, and both poles (2, 3) [m]."""
    angle = 2.0 * np.pi * np.arange(d.around) / d.around
    rings: list[Ring] = []
    circles: list[tuple[np.ndarray, np.ndarray]] = []
    axes: list[np.ndarray] = []
    across = np.zeros(3)
    for section in d.sections or ():
        body = bodies[section.body]
        if isinstance(body, CoatingDef):
            body = bodies[body.around]
        if isinstance(body, RigidDef):
            origin, turn = start_pose(body)
        else:
            origin, turn = np.array(body.position), Rotation.from_rotvec(np.array(body.rotation))
        axis = turn.apply(section.axis / np.linalg.norm(section.axis))
        middle = origin + turn.apply(body.scale * section.position)
        across = _carry(across, axes[-1], axis) if axes else _perpendicular(axis)
        towards = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across))
        axes.append(axis)
        circles.append((middle, body.scale * section.radius * towards))
        rings.append(Ring(section.body, middle + ring_gain(d.around) * circles[-1][1]))
    poles = np.array(
        [
            middle + sign * DOME * np.linalg.norm(circle[0]) * axis
            for sign, (middle, circle), axis in ((-1.0, circles[0], axes[0]), (1.0, circles[-1], axes[-1]))
        ]
    )
    return _capped(rings, poles, [circles[0], circles[-1]]), poles


def _capped(rings: list[Ring], poles: np.ndarray, ends: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Ring]:
    """A small ring in the plane of each pole, like the end ring: there the surface is flat, without a tip."""
    low, high = (
        Ring(ring.body, pole + CAP * ring_gain(len(circle)) * circle)
        for ring, pole, (_, circle) in zip((rings[0], rings[-1]), poles, ends, strict=True)
    )
    return [low, *rings, high]


def _center(surface: np.ndarray) -> np.ndarray:
    """Mean of a surface (m, 3, 3) by area."""
    area = np.linalg.norm(np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]), axis=1)
    return np.asarray(area @ surface.mean(axis=1) / area.sum())


def _axes(centers: np.ndarray, surfaces: Sequence[np.ndarray]) -> np.ndarray:
    """Direction of the chain at each body: between the centres of its neighbours, of a single body its long axis."""
    if len(centers) == 1:
        offset = surfaces[0].reshape(-1, 3) - centers[0]
        return np.linalg.svd(offset, full_matrices=False)[2][:1]
    ahead = np.r_[centers[1:], centers[-1:]] - np.r_[centers[:1], centers[:-1]]
    length = np.linalg.norm(ahead, axis=1)
    if (length <= 1e-9 * np.ptp(np.concatenate(surfaces), axis=(0, 1)).max()).any():
        raise InputError("its bodies are not in the order of a chain (the neighbours of one coincide); give sections")
    return ahead / length[:, None]


def _perpendicular(axis: np.ndarray) -> np.ndarray:
    other = np.eye(3)[np.argmin(np.abs(axis))]
    other = other - (other @ axis) * axis
    return np.asarray(other / np.linalg.norm(other))


def _carry(across: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """A vector across the old axis turned by the smallest rotation to the new one, so that rings do not twist."""
    axis = np.cross(old, new)
    sine = np.linalg.norm(axis)
    if sine > 1e-12:
        across = Rotation.from_rotvec(axis / sine * np.arctan2(sine, old @ new)).apply(across)
    across = across - (across @ new) * new
    return np.asarray(across / np.linalg.norm(across))


def farthest_hits(origin: np.ndarray, directions: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """How far along each unit direction (n, 3) the last triangle (m, 3, 3) is hit, (n,); NaN where none is.

    Moeller, Trumbore 1997: origin + t d = a + p (b - a) + q (c - a).
    """
    a, edge1, edge2 = surface[:, 0], surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]
    offset = origin - a
    offset_edge1 = np.cross(offset, edge1)
    distance = np.full(len(directions), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, direction in enumerate(directions):
            normal = np.cross(direction, edge2)
            det = np.einsum("ij,ij->i", edge1, normal)
            p = np.einsum("ij,ij->i", offset, normal) / det
            q = offset_edge1 @ direction / det
            t = np.einsum("ij,ij->i", offset_edge1, edge2) / det
            hit = (p >= -1e-9) & (q >= -1e-9) & (p + q <= 1.0 + 1e-9) & (t > 0.0) & np.isfinite(t)
            if hit.any():
                distance[k] = t[hit].max()
    return distance


def _filled(radius: np.ndarray, surface: np.ndarray, middle: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Where a ray missed (a bent body): the mean of the others, or half the body's width."""
    if np.isfinite(radius).any():
        return np.where(np.isfinite(radius), radius, np.nanmean(radius))
    offset = surface.reshape(-1, 3) - middle
    across = offset - np.outer(offset @ axis, axis)
    return np.full(len(radius), 0.5 * np.linalg.norm(across, axis=1).max())


def _pole(surface: np.ndarray, center: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Where the axis leaves the body; where it does not meet it, at the height of its farthest point."""
    distance = farthest_hits(center, axis[None], surface)[0]
    if not np.isfinite(distance):
        distance = ((surface.reshape(-1, 3) - center) @ axis).max()
    return center + distance * axis
