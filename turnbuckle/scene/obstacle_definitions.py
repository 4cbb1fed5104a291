"""Obstacles as the user writes them: what others touch, and nothing moves but a script."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic.json_schema import SkipJsonSchema

from turnbuckle.scene.base_definition import exactly_one, problem
from turnbuckle.scene.body_definitions import BodyBase, _check_indices
from turnbuckle.scene.fields import Flag, Frames, Number, Positive, SequencePath, Size2, Times
from turnbuckle.scene.rigid_definitions import SHAPES, ShapeDef, TrajectoryDef, _trajectory_kind

FORMS: tuple[tuple[str, ...], ...] = (
    *SHAPES,
    ("plane",),
    ("sequence",),
    ("frames", "triangles"),
    ("motion", "triangles"),
)


class ObstacleDef(BodyBase, ShapeDef):
    """Immobile, on a trajectory, or following a sequence of meshes; nothing that touches it changes its way.

    Its points have no mass. Constraints take them like those of other bodies: a dress is attached to the body that
    wears it. Surfaces need not be closed, and may intersect themselves and other obstacles.
    """

    type: Literal["obstacle"] = "obstacle"
    plane: Size2 | None = Field(
        default=None, description="A rectangle of these lengths along x and y, centred on the origin, facing +z [m]."
    )
    sequence: SequencePath | None = Field(
        default=None,
        description="Meshes of one topology: an .npz of verts (k, n, 3), faces (m, 3), and dt or times; or a folder of "
        "OBJ files in the order of their names; relative to the scene file [path].",
    )
    frames: Frames | None = Field(default=None, description="As a sequence: its vertices, shape (k, n, 3) [m].")
    motion: SkipJsonSchema[Callable[..., Any] | None] = Field(
        default=None, description="Python only: t [s] -> vertices (n, 3) in the body's own coordinates [m]."
    )
    times: Times | None = Field(default=None, description="Of the frames, increasing, shape (k,) [s].")
    frame_rate: Positive | None = Field(
        default=None, description="Frames a second; as the file says, 25 where nothing does [1/s]."
    )
    start: Number = Field(
        default=0.0, description="When the first frame is there; it is held before, the last one after [s]."
    )
    trajectory: Annotated[
        Annotated[TrajectoryDef, Tag("<keyframes>")]
        | Annotated[SkipJsonSchema[Callable[..., Any]], Tag("<callable>")]
        | Annotated[None, Tag("<none>")],
        Discriminator(_trajectory_kind),
    ] = Field(
        default=None, description="Keyframes, or in Python t [s] -> (position (3,) [m], rotation vector (3,) [rad])."
    )

    drawn: Flag = Field(default=True, description="Whether pictures show it [true or false].")

    @model_validator(mode="after")
    def _check(self) -> ObstacleDef:
        way = _form(self)
        if way == "vertices":
            _check_indices(self.triangles, len(self.vertices), "triangles")  # type: ignore[arg-type]
        if way == "frames":
            _check_indices(self.triangles, self.frames.shape[1], "triangles")  # type: ignore[union-attr]
        moving = way in ("sequence", "frames")
        for name in ("times", "frame_rate", "start"):
            if name in self.model_fields_set and not moving:
                raise problem(f"{name} goes with sequence or frames only", name)
        if self.times is not None:
            if self.frame_rate is not None:
                raise problem("give times or frame_rate, not both", "frame_rate")
            if (np.diff(self.times) <= 0).any():
                raise problem("times must increase", "times")
            if self.frames is not None and len(self.times) != len(self.frames):
                raise problem(f"has {len(self.times)} times for {len(self.frames)} frames", "times")
        if self.trajectory is not None and way in ("sequence", "frames", "motion"):
            raise problem(f"{way} moves already; give that or a trajectory", "trajectory")
        if "velocity" in self.model_fields_set:
            raise problem("an obstacle goes where its script says; give a trajectory", "velocity")
        return self


def _form(d: ObstacleDef) -> str:
    """The one way in which the surface is given. `triangles` belong to several."""
    ways = {group[0]: group for group in FORMS}
    given = d.given(ways)
    if len(given) == 1 and len(ways[given[0]]) == 2 and d.triangles is None:
        raise problem(f"{given[0]!r} needs 'triangles' beside it")
    if len(given) == 1 and len(ways[given[0]]) == 1 and d.triangles is not None:
        raise problem(f"triangles do not go with {given[0]}", "triangles")
    return given[0] if len(given) == 1 else exactly_one(d, [(name,) for name in ways])
