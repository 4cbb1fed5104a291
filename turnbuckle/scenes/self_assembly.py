"""Parts thrown apart that gather into a hollow ball: Local, section 4.5."""

from itertools import product
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import box_tetrahedra, six_volumes
from turnbuckle.scene.scene import Scene

CELLS = (2, 2, 1)  # of a part, five tetrahedra each


def self_assembly(
    divisions: int = 2,
    radius: float = 0.5,
    thickness: float = 0.12,
    spread: float = 1.2,
    tumble: float = 1.2,
    start: float = 0.3,
    gathering: float = 1.2,
    mode: Literal["closing", "paper"] = "closing",
    stiffness: float = 40.0,
    density: float = 300.0,
    air: float = 1.0,
    seed: int = 1,
    dt: float = 2.5e-4,
    duration: float = 2.5,
) -> Scene:
    """Parts thrown apart at random gather into one hollow ball by gradual constraints, closed loops included (4.5).

    A cube of `divisions` x `divisions` squares a face, blown up to a ball of `radius` [m], is cut into parts, solids of
    `thickness` [m] (divisions = 2: 24 parts, 480 tetrahedra). They fly apart without gravity, from places about
    `spread` [m] outside, each turned by up to `tumble` [rad]. From `start` [s] on, all corners that belong together are joined over `gathering` [s],
    where three or four parts meet as one constraint of three or four points: round every corner a closed loop.
    `mode`: "closing" closes every gap at a steady rate; "paper" applies the growing fraction j/n of the force.

    The paper shows no counts for it; divisions = 2: 148 points to point.
    """
    if divisions < 1:
        raise InputError(f"self_assembly: divisions = {divisions}; at least 1 is needed")
    if not 0.0 < thickness < radius:
        raise InputError(f"self_assembly: thickness = {thickness:g} m must lie between 0 and the radius {radius:g} m")
    scene = Scene("self_assembly", gravity=[0.0, 0.0, 0.0], dt=dt, duration=duration)
    random = np.random.default_rng(seed)
    shares: dict[tuple[int, ...], list[dict]] = {}
    for name, keys, rest, cells in _parts(divisions, radius, thickness):
        centre = rest.mean(axis=0)
        outwards = centre / np.linalg.norm(centre)
        axis = random.normal(size=3)
        turn = Rotation.from_rotvec(tumble * random.uniform(0.5, 1.0) * axis / np.linalg.norm(axis))
        placed = centre + spread * random.uniform(0.6, 1.4) * outwards + 0.3 * spread * random.uniform(-1.0, 1.0, 3)
        scene.add_solid(
            name,
            vertices=turn.apply(rest - centre),
            tetrahedra=cells,
            position=placed,
            velocity=0.8 * outwards + 0.4 * random.uniform(-1.0, 1.0, 3),
            density=density,
            color=0.35 + 0.5 * (0.5 + 0.5 * outwards),
            k_distance=stiffness,
            k_area=stiffness,
            k_volume=stiffness,
            damping_distance=4e-5 * stiffness,
            damping_area=4e-5 * stiffness,
            damping_volume=4e-5 * stiffness,
        )
        for index, key in enumerate(keys):
            shares.setdefault(tuple(key), []).append({"body": name, "index": index})
    if air > 0.0:
        scene.add_force("air", expression=[f"-{air!r} * m * {v}" for v in ("vx", "vy", "vz")])
    groups = [refs for refs in shares.values() if len(refs) > 1]
    ramp = {"steps": max(round(gathering / dt), 1), "mode": mode}
    scene.add_constraint("points_to_point", "seams", groups=groups, start=start, ramp=ramp)
    return scene


def _parts(divisions: int, radius: float, thickness: float):
    """Name, keys (n, 4), points (n, 3) [m] in the ball, and tetrahedra of each part. Points of one place share a key.

    A key is the point's place on the cube in whole numbers, and its layer (0 inside, 1 outside).
    """
    fine = CELLS[0] * divisions  # cells along an edge of the cube
    grid, cells = box_tetrahedra(CELLS, CELLS)
    grid = np.rint(grid).astype(int)
    for axis, high, i, j in product(range(3), (0, 1), range(divisions), range(divisions)):
        place = np.empty((len(grid), 3), dtype=int)
        place[:, axis] = fine * high
        place[:, (axis + 1) % 3] = CELLS[0] * i + grid[:, 0]
        place[:, (axis + 2) % 3] = CELLS[1] * j + grid[:, 1]
        # tan makes the squares of the blown-up cube about equal
        direction = np.tan(0.25 * np.pi * (2.0 * place / fine - 1.0))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points = direction * (radius - thickness * (1 - grid[:, 2:]))
        turned = six_volumes(points, cells) < 0.0
        own = np.where(turned[:, None], cells[:, [0, 2, 1, 3]], cells)
        yield f"part_{'xyz'[axis]}{high}_{i}{j}", np.c_[place, grid[:, 2]], points, own
