"""Sections of the friction cone: the disk, and regular polygons around it (Contact, 3.4).

A section is scaled by the radius ``mu r_n`` [N s]. Polygons are drawn around the disk, with a face across `axes`, so that
the four-sided one is the paper's pair of bounds ``|gamma_1|, |gamma_2| <= mu lambda``: exact along its axes, stronger by
``1 / cos(pi / sides)`` at its corners (1.41, 1.08, 1.02 for 4, 8, 16 sides).
"""

import numpy as np

from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.errors import InputError

SIDES = {"cone": 0, "pyramid4": 4, "pyramid8": 8, "pyramid16": 16}  # 0: the disk
REST = 1e-12  # of the largest tangential velocity: below, a contact has no direction of its own


def sides(shape: str) -> int:
    """Sides of a shape's section, 0 of the cone. Raises `InputError` for names that are not in `FRICTION_SHAPES`."""
    if shape not in SIDES:
        raise InputError(f"friction_shape is '{shape}'; use one of {', '.join(SIDES)}")
    return SIDES[shape]


def aligned_axes(problem: ContactProblem) -> np.ndarray:
    """Direction of the first face of each section, (m, 2) unit vectors in the frames of the rows.

    It is that of the tangential velocity without contact, ``J_t v*`` (Contact, 3.4); the frame's own t1 where the contact
    is at rest, so that the answer never depends on round-off.
    """
    u = (problem.j @ problem.free).reshape(-1, 3)[:, 1:]
    speed = np.hypot(u[:, 0], u[:, 1])
    moves = speed > REST * speed.max(initial=0.0)
    return np.where(moves[:, None], u / np.where(moves, speed, 1.0)[:, None], [1.0, 0.0])


def project(impulse: np.ndarray, radius: np.ndarray, count: int, axes: np.ndarray) -> np.ndarray:
    """The nearest points (m, 2) of the sections with the given radii (m,) and `count` sides to tangential impulses (m, 2).

    The nearest point of a regular polygon lies on the face in whose sector (seen from the centre) a point is: the sectors
    are mirror images of each other in the rays to the corners.
    """
    radius = np.maximum(radius, 0.0)
    if count == 0:
        size = np.hypot(impulse[:, 0], impulse[:, 1])
        return impulse * np.where(size > radius, radius / np.where(size > 0.0, size, 1.0), 1.0)[:, None]
    along = axes[:, 0] * impulse[:, 0] + axes[:, 1] * impulse[:, 1]
    across = axes[:, 0] * impulse[:, 1] - axes[:, 1] * impulse[:, 0]
    sector = 2.0 * np.pi / count
    face = np.round(np.arctan2(across, along) / sector) * sector
    cos, sin = np.cos(face), np.sin(face)
    out = cos * along + sin * across
    side = cos * across - sin * along
    far = radius * np.tan(0.5 * sector)
    beyond = out > radius
    out, side = np.where(beyond, radius, out), np.where(beyond, np.clip(side, -far, far), side)
    along, across = cos * out - sin * side, sin * out + cos * side
    return np.stack([axes[:, 0] * along - axes[:, 1] * across, axes[:, 1] * along + axes[:, 0] * across], axis=1)
