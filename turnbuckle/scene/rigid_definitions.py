"""Rigid bodies as the user writes them: shapes, mass, and how they move (Displacement, 2.2 and 5.1).

All coordinates are in the body's own frame: boxes, spheres, cylinders and capsules are centred on its origin (cylinders
and capsules along z), meshes lie as they are in their file. Joints use the same frame, not that of the centre of mass.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic.json_schema import SkipJsonSchema

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.body_definitions import MESH, BodyBase, _check_indices
from turnbuckle.scene.fields import (
    ArraySpec,
    MeshPath,
    NonNegative,
    Positions,
    Positive,
    Size3,
    Times,
    Triangles,
    Vec3,
    zeros3,
)

Inertia = Annotated[np.ndarray, ArraySpec(((3,), (3, 3)))]
SHAPES: tuple[tuple[str, ...], ...] = (
    ("box",), ("sphere",), ("cylinder",), ("capsule",), ("mesh",), ("vertices", "triangles"),
)  # fmt: skip


class RoundDef(Definition):
    """A cylinder or capsule along z, its middle at the origin."""

    radius: Positive = Field(description="Radius [m].")
    length: Positive = Field(description="Length along z, of a capsule without its caps [m].")


class ShapeDef(Definition):
    """One solid shape."""

    box: Size3 | None = Field(default=None, description="Lengths along x, y, z, centred on the origin [m].")
    sphere: Positive | None = Field(default=None, description="Radius, centred on the origin [m].")
    cylinder: RoundDef | None = Field(default=None, description="A cylinder along z [m].")
    capsule: RoundDef | None = Field(default=None, description="A capsule along z [m].")
    mesh: MeshPath | None = MESH
    vertices: Positions | None = Field(default=None, description="Points of a closed surface, (n, 3) [m].")
    triangles: Triangles | None = Field(default=None, description="Its triangles, normals outwards, (m, 3) [indices].")

    def check_shape(self, also: tuple[str, ...] = ()) -> str:
        """Exactly one shape is given (or the field `also`); its first field's name."""
        way = exactly_one(self, [*SHAPES, *((name,) for name in also)])
        if self.vertices is not None:
            _check_indices(self.triangles, len(self.vertices), "triangles")
        return way


class PartDef(ShapeDef):
    """One shape of a compound body."""

    position: Vec3 = Field(default_factory=zeros3, description="Of the shape's origin in the body's frame [m].")
    rotation: Vec3 = Field(default_factory=zeros3, description="Rotation vector in the body's frame [rad].")
    density: Positive | None = Field(default=None, description="Mass per volume, the body's when left out [kg/m^3].")

    @model_validator(mode="after")
    def _check(self) -> PartDef:
        self.check_shape()
        return self


class TrajectoryDef(Definition):
    """A pose that follows keyframes, held before the first and after the last."""

    times: Times = Field(description="Times, increasing, shape (k,) [s].")
    positions: Positions = Field(description="Of the body's origin, shape (k, 3) [m].")
    rotations: Positions | None = Field(
        default=None, description="Rotation vectors, shape (k, 3); the rotation at the start when left out [rad]."
    )
    interpolation: Literal["linear", "smooth"] = Field(
        default="smooth", description="Constant velocity between keys, or twice differentiable through them [text]."
    )

    @model_validator(mode="after")
    def _check(self) -> TrajectoryDef:
        if (np.diff(self.times) <= 0).any():
            raise problem("times must increase", "times")
        for name in ("positions", "rotations"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.times):
                raise problem(f"has {len(values)} keys, but times has {len(self.times)}", name)
        return self


def _trajectory_kind(value: Any) -> str:
    if value is None:
        return "<none>"
    return "<callable>" if callable(value) else "<keyframes>"


class RigidDef(BodyBase, ShapeDef):
    """A rigid body. `velocity` (of `BodyBase`) is that of the centre of mass."""

    type: Literal["rigid"] = "rigid"
    parts: Annotated[list[PartDef], Field(min_length=1)] | None = Field(
        default=None, description="Shapes of a compound body [list]."
    )
    motion: Literal["dynamic", "immobile", "trajectory"] | None = Field(
        default=None, description="How it moves: dynamic, unless a trajectory is given [text]."
    )
    trajectory: Annotated[
        Annotated[TrajectoryDef, Tag("<keyframes>")]
        | Annotated[SkipJsonSchema[Callable[..., Any]], Tag("<callable>")]
        | Annotated[None, Tag("<none>")],
        Discriminator(_trajectory_kind),
    ] = Field(
        default=None, description="Keyframes, or in Python t [s] -> (position (3,) [m], rotation vector (3,) [rad])."
    )
    density: Positive | None = Field(default=None, description="Mass per volume [kg/m^3], 1000 when no mass is given.")
    mass: Positive | None = Field(default=None, description="Mass of the whole body [kg].")
    inertia: Inertia | None = Field(
        default=None, description="About the centre of mass, in the body's frame: (3,) or (3, 3) [kg m^2]."
    )
    center: Vec3 | None = Field(default=None, description="Centre of mass in the body's frame; the shape's [m].")
    angular_velocity: Vec3 = Field(default_factory=zeros3, description="At the start, in world axes [rad/s].")
    linear_damping: NonNegative = Field(default=0.0, description="Rate at which velocity decays [1/s].")
    angular_damping: NonNegative = Field(default=0.0, description="Rate at which angular velocity decays [1/s].")
    markers: Positions | None = Field(
        default=None,
        description="Further points in the body's frame that constraints can take; numbered first, 0, 1, ... [m].",
    )
    anchors: Positions | None = Field(
        default=None,
        description="Further points in the body's frame, numbered last; coatings are held at such [m].",
    )
    ability_to_rotate: Positive | None = Field(
        default=None,
        description="Stands for m J^-1 under the displacement solver, in place of the inertia (3.1.4) [1/m^2].",
    )

    @model_validator(mode="after")
    def _check(self) -> RigidDef:
        self.check_shape(("parts",))
        if self.motion is None:
            self.fill("motion", "dynamic" if self.trajectory is None else "trajectory")
        if (self.motion == "trajectory") != (self.trajectory is not None):
            raise problem("motion: trajectory needs a trajectory, and only that", "motion")
        if self.inertia is not None:
            matrix = np.diag(self.inertia) if self.inertia.ndim == 1 else self.inertia
            if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
                raise problem("must be symmetric", "inertia")
            low, middle, high = np.linalg.eigvalsh(matrix)
            if low <= 0.0 or high > (low + middle) * (1.0 + 1e-9):
                raise problem(
                    "no body has it: principal moments must be positive, each at most the sum of the others", "inertia"
                )
        self._density_or_mass(1000.0)
        return self
