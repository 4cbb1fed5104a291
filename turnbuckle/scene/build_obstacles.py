"""From the definition of an obstacle to its surface and where its points are at any time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Scripted
from turnbuckle.data.shape import Shape
from turnbuckle.meshes.sequences import MeshSequence, frame_times, read_sequence
from turnbuckle.meshes.shapes import grid_sheet
from turnbuckle.meshes.solids import box_surface, capsule_surface, cylinder_surface, sphere_surface
from turnbuckle.scene.build_rigid import surface_of
from turnbuckle.scene.definitions import BodyDef, ObstacleDef
from turnbuckle.scene.trajectories import Trajectory, start_pose, trajectory_of


@dataclass(frozen=True)
class ObstacleMotion:
    """Where the points of an obstacle are: called with t [s] it gives positions (n, 3) [m]."""

    name: str
    places: np.ndarray | MeshSequence | Callable[[float], np.ndarray]  # in the body's own coordinates, not scaled
    count: int  # of points
    scale: float
    origin: np.ndarray  # (3,) [m]
    turn: Rotation
    trajectory: Trajectory | None

    def __call__(self, t: float) -> np.ndarray:
        """Positions at ``t`` [s], (n, 3) [m]. Raises StepError where the user's function fails."""
        if isinstance(self.places, np.ndarray):
            own = self.places
        elif isinstance(self.places, MeshSequence):
            own = self.places.at(t)
        else:
            own = self._asked(self.places, t)
        origin, turn = (self.origin, self.turn) if self.trajectory is None else self.trajectory.pose(t)
        return np.ascontiguousarray(turn.apply(own * self.scale) + origin)

    def _asked(self, function: Callable[[float], np.ndarray], t: float) -> np.ndarray:
        try:
            found = np.asarray(function(t), dtype=np.float64)
        except Exception as error:  # whatever the user's function raises
            raise StepError(f"body '{self.name}': its motion failed at t = {t:g} s ({error})") from None
        if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all():
            raise StepError(f"body '{self.name}': its motion must give finite vertices (n, 3) at t = {t:g} s")
        if self.count and len(found) != self.count:
            raise StepError(
                f"body '{self.name}': its motion gives {len(found)} vertices at t = {t:g} s, {self.count} at the start"
            )
        return found

    @property
    def moves(self) -> bool:
        """False for what stays where it is."""
        still = isinstance(self.places, np.ndarray) or (
            isinstance(self.places, MeshSequence) and len(self.places.times) == 1
        )
        return self.trajectory is not None or not still

    @property
    def keys(self) -> tuple[np.ndarray, ...]:
        """What it is made of, as arrays: two obstacles with like keys go the same way (callables apart)."""
        placed = (np.array([self.scale]), self.origin, self.turn.as_quat())
        if isinstance(self.places, MeshSequence):
            return (*placed, self.places.vertices, self.places.times)
        own = (self.places,) if isinstance(self.places, np.ndarray) else ()
        return (*placed, *own, *(self.trajectory.keys if self.trajectory is not None else ()))


def obstacle(d: ObstacleDef, folder: Path) -> tuple[ObstacleMotion, np.ndarray]:
    """Its motion, and its triangles (m, 3) int32 over its points. Paths are relative to ``folder``. Raises InputError."""
    places, triangles = _surface(d, folder)
    origin, turn = start_pose(d)
    trajectory = None if d.trajectory is None else trajectory_of(d)
    count = len(places) if isinstance(places, np.ndarray) else 0
    motion = ObstacleMotion(d.name, places, count, d.scale, np.array(origin), turn, trajectory)
    try:
        first = motion(0.0)
    except StepError as error:
        raise InputError(str(error)) from None
    if triangles.max() >= len(first):
        raise InputError(f"triangles name point {triangles.max()}, but its motion has {len(first)} points")
    return ObstacleMotion(d.name, places, len(first), d.scale, motion.origin, turn, trajectory), triangles


def _surface(
    d: ObstacleDef, folder: Path
) -> tuple[np.ndarray | MeshSequence | Callable[[float], np.ndarray], np.ndarray]:
    if d.plane is not None:
        sheet = grid_sheet((float(d.plane[0]), float(d.plane[1])), (1, 1))
        return sheet.vertices - 0.5 * np.array([*d.plane, 0.0]), sheet.triangles
    if d.box is not None:
        return box_surface(d.box)
    if d.sphere is not None:
        return sphere_surface(d.sphere)
    if d.cylinder is not None:
        return cylinder_surface(d.cylinder.radius, d.cylinder.length)
    if d.capsule is not None:
        return capsule_surface(d.capsule.radius, d.capsule.length)
    if d.sequence is not None:
        times = None if d.times is None else np.array(d.times)
        read = read_sequence(folder / Path(d.sequence).expanduser(), times, d.frame_rate)
        return MeshSequence(read.vertices, read.triangles, read.times + d.start), read.triangles
    if d.frames is not None:
        triangles = np.array(d.triangles, dtype=np.int32)
        times = frame_times(len(d.frames), d.times, d.frame_rate) + d.start
        return MeshSequence(np.array(d.frames), triangles, times), triangles
    if d.motion is not None:
        return d.motion, np.array(d.triangles, dtype=np.int32)
    vertices, triangles = surface_of(d, folder)
    return np.array(vertices), np.array(triangles, dtype=np.int32)


def scripted(
    definitions: Sequence[BodyDef], motions: Sequence[ObstacleMotion | None], shapes: Sequence[Shape]
) -> tuple[Scripted, ...]:
    """The scripted points of a scene: those of its obstacles."""
    return tuple(
        Scripted(d.name, s.begin, s.end, motion, motion.moves)
        for d, motion, s in zip(definitions, motions, shapes, strict=True)
        if motion is not None
    )


def first_velocities(scripts: Sequence[Scripted], v: np.ndarray, dt: float) -> None:
    """Write the velocities of scripted points over the first step into ``v`` (points, 3) [m/s]."""
    for script in scripts:
        if script.moves:
            v[script.begin : script.end] = (script.positions(dt) - script.positions(0.0)) / dt
