"""Bodies as the user writes them: ropes, nets, cloth, solids. Every field has a unit."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.contact_definitions import TouchFields
from turnbuckle.scene.fields import (
    COUNT_LIMIT,
    Cells2,
    Cells3,
    Color,
    Corners,
    Count,
    Lines,
    MeshPath,
    Name,
    NonNegative,
    Positions,
    Positive,
    Size2,
    Size3,
    Tetrahedra,
    Triangles,
    Vec3,
    zeros3,
)

MESH = Field(default=None, description="Path of a mesh file, relative to the scene file [path].")


class BodyBase(TouchFields):
    """What all bodies share. A point p of the body starts at x = position + R (scale * p)."""

    name: Name = Field(description="Name, unique among bodies [text].")
    position: Vec3 = Field(default_factory=zeros3, description="Where the body's origin starts [m].")
    rotation: Vec3 = Field(default_factory=zeros3, description="Rotation vector (axis times angle) [rad].")
    scale: Positive = Field(default=1.0, description="Factor on the body's own coordinates [1].")
    velocity: Vec3 = Field(default_factory=zeros3, description="Velocity of every point at the start [m/s].")
    color: Color | None = Field(default=None, description="Red, green, blue, each from 0 to 1 [1].")

    def _density_or_mass(self, default: float) -> None:
        """Exactly one of density and mass; the default density where neither is given."""
        density, mass = getattr(self, "density"), getattr(self, "mass")  # noqa: B009  (fields of the subclasses)
        if density is not None and mass is not None:
            raise problem("give density or mass, not both", "mass")
        if density is None and mass is None:
            self.fill("density", default)


def _check_indices(elements: np.ndarray | None, count: int, field: str) -> None:
    """Refuse an element that names a point past the last, or the same point twice."""
    if elements is None:
        return
    bad = elements >= count
    if bad.any():
        row = int(np.argwhere(bad)[0][0])
        raise problem(f"names point {int(elements[bad][0])}, but the body has {count} points", field, row)
    ordered = np.sort(elements, axis=1)
    double = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if double.any():
        row = int(np.argmax(double))
        raise problem(f"uses a point twice ({elements[row].tolist()})", field, row)


class RopeDef(BodyBase):
    """A rope, or with `lines` a general net of edges: mass points, stretch springs, bending springs."""

    type: Literal["rope"] = "rope"
    points: Positions | None = Field(default=None, description="Points in order, shape (n, 3) [m].")
    lines: Lines | None = Field(default=None, description="Edges between `points`, shape (m, 2) [indices].")
    mesh: MeshPath | None = MESH
    start: Vec3 | None = Field(default=None, description="First end of a straight rope [m].")
    end: Vec3 | None = Field(default=None, description="Other end of a straight rope [m].")
    segments: Count | None = Field(default=None, description="Springs of a straight rope [1].")
    stretch_stiffness: NonNegative = Field(default=1e4, description="Stiffness of each spring [N/m].")
    bend_stiffness: NonNegative = Field(default=0.0, description="Stiffness of springs two points apart [N/m].")
    damping: NonNegative = Field(default=0.0, description="Damping of the stretch springs [N s/m].")
    bend_damping: NonNegative = Field(default=0.0, description="Damping of the bending springs [N s/m].")
    density: Positive | None = Field(default=None, description="Mass per length [kg/m], 0.1 when no mass is given.")
    mass: Positive | None = Field(default=None, description="Mass of the whole rope [kg].")

    @model_validator(mode="after")
    def _check(self) -> RopeDef:
        exactly_one(self, [("points",), ("mesh",), ("start", "end", "segments")])
        if self.lines is not None and self.points is None:
            raise problem("lines go with points only", "lines")
        if self.points is not None:
            if len(self.points) < 2:
                raise problem("a rope needs at least two points", "points")
            _check_indices(self.lines, len(self.points), "lines")
        if self.start is not None and self.end is not None and np.array_equal(self.start, self.end):
            raise problem("start and end are the same place", "end")
        self._density_or_mass(0.1)
        return self


class SheetDef(BodyBase):
    """What nets and cloth share: a mass-spring sheet on a grid (local x-y plane, corner at 0) or on triangles."""

    size: Size2 | None = Field(default=None, description="Lengths of the grid along x and y [m].")
    cells: Cells2 | None = Field(default=None, description="Cells of the grid along x and y [1].")
    mesh: MeshPath | None = MESH
    vertices: Positions | None = Field(default=None, description="Points, shape (n, 3) [m].")
    triangles: Triangles | None = Field(default=None, description="Triangles of `vertices`, shape (m, 3) [indices].")
    structural_stiffness: NonNegative = Field(default=1e3, description="Springs along the edges [N/m].")
    shear_stiffness: NonNegative = Field(default=0.0, description="Springs along both diagonals of a grid cell [N/m].")
    bend_stiffness: NonNegative = Field(
        default=0.0, description="Springs two points apart on grids, across an edge on triangles [N/m]."
    )
    damping: NonNegative = Field(default=0.0, description="Damping of all springs [N s/m].")
    density: Positive | None = Field(default=None, description="Mass per area [kg/m^2], 0.2 when no mass is given.")
    mass: Positive | None = Field(default=None, description="Mass of the whole sheet [kg].")

    @model_validator(mode="after")
    def _check(self) -> SheetDef:
        exactly_one(self, [("size", "cells"), ("mesh",), ("vertices", "triangles")])
        if self.cells is not None and float(np.prod(self.cells.astype(float))) > COUNT_LIMIT:
            raise problem(f"asks for more than {COUNT_LIMIT} cells", "cells")
        if self.vertices is not None:
            _check_indices(self.triangles, len(self.vertices), "triangles")
        self._density_or_mass(0.2)
        return self


class NetDef(SheetDef):
    """A net: springs along the edges, no shear unless asked for."""

    type: Literal["net"] = "net"


class ClothDef(SheetDef):
    """Cloth: as a net, with shear springs; it bends by springs, or by the angles between its triangles."""

    type: Literal["cloth"] = "cloth"
    shear_stiffness: NonNegative = Field(default=1e3, description="Springs along both diagonals of a grid cell [N/m].")
    bend_model: Literal["springs", "hinges"] = Field(
        default="springs",
        description="What bend_stiffness is of: springs [N/m], or the angle across each inner edge [N m/rad] [text].",
    )
    bend_damping: NonNegative | None = Field(
        default=None,
        description="Of bending springs, as damping when left out [N s/m]; of angles, 0 when left out [N m s/rad].",
    )
    strain_limit: Positive | None = Field(
        default=None, description="Structural and shear springs get no longer than by this part of their length [1]."
    )


class BoxDef(Definition):
    """A box of cells, its corner at the body's origin; each cell becomes five tetrahedra."""

    size: Size3 = Field(description="Lengths along x, y, z [m].")
    cells: Cells3 = Field(description="Cells along x, y, z [1].")

    @model_validator(mode="after")
    def _check(self) -> BoxDef:
        if float(np.prod(self.cells.astype(float))) > COUNT_LIMIT:
            raise problem(f"asks for more than {COUNT_LIMIT} cells", "cells")
        return self


class CylinderDef(Definition):
    """A solid cylinder along the body's z axis, from z = 0 to z = length."""

    radius: Positive = Field(description="Radius [m].")
    length: Positive = Field(description="Length along z [m].")
    around: Corners = Field(default=8, description="Corners of the rim [1].")
    along: Count = Field(default=4, description="Layers along z [1].")

    @model_validator(mode="after")
    def _check(self) -> CylinderDef:
        if self.around * self.along > COUNT_LIMIT:
            raise problem(f"asks for more than {COUNT_LIMIT} cells", "along")
        return self


TESCHNER = ("k_distance", "k_area", "k_volume", "damping_distance", "damping_area", "damping_volume")
COROTATIONAL = ("youngs_modulus", "poissons_ratio", "damping")


class MaterialFields(Definition):
    """What a solid is made of: the distance, area and volume energies of Teschner et al. 2004 (E = k C^2 / 2), or
    linear elasticity in the frame of each element's rotation (Mueller and Gross 2004).
    """

    material: Literal["teschner", "corotational"] | None = Field(
        default=None, description="Kind of material; corotational where youngs_modulus is given, else teschner [text]."
    )
    youngs_modulus: Positive | None = Field(default=None, description="Corotational: Young's modulus, 1e5 [Pa].")
    poissons_ratio: Annotated[NonNegative, Field(lt=0.5)] | None = Field(
        default=None, description="Corotational: Poisson's ratio, 0.3, below 0.5 [1]."
    )
    damping: NonNegative | None = Field(
        default=None, description="Corotational: viscous forces are this time times the stiffness, 0 [s]."
    )
    k_distance: NonNegative = Field(default=100.0, description="Stiffness of edges, C = (l - l0) / l0 [J].")
    k_area: NonNegative = Field(default=100.0, description="Stiffness of faces, C = (A - A0) / A0 [J].")
    k_volume: NonNegative = Field(default=100.0, description="Stiffness of volumes, C = (V - V0) / V0 [J].")
    damping_distance: NonNegative = Field(default=0.0, description="Damping of edges [J s].")
    damping_area: NonNegative = Field(default=0.0, description="Damping of faces [J s].")
    damping_volume: NonNegative = Field(default=0.0, description="Damping of volumes [J s].")

    @model_validator(mode="after")
    def _check_material(self) -> MaterialFields:
        given = [name for name in COROTATIONAL if getattr(self, name) is not None]
        if self.material is None:
            self.fill("material", "corotational" if given else "teschner")
        others = given if self.material == "teschner" else [n for n in TESCHNER if n in self.model_fields_set]
        if others:
            raise problem(f"{others[0]} does not go with material: {self.material}", others[0])
        if self.material == "corotational":
            for name, value in (("youngs_modulus", 1e5), ("poissons_ratio", 0.3), ("damping", 0.0)):
                if getattr(self, name) is None:
                    self.fill(name, value)
        return self


class SolidDef(BodyBase, MaterialFields):
    """A tetrahedral solid."""

    type: Literal["solid"] = "solid"
    mesh: MeshPath | None = Field(
        default=None, description="Closed surface (tetrahedralised) or tetrahedral mesh, relative to the scene [path]."
    )
    box: BoxDef | None = Field(default=None, description="A box of cells [m].")
    cylinder: CylinderDef | None = Field(default=None, description="A solid cylinder [m].")
    vertices: Positions | None = Field(default=None, description="Points, shape (n, 3) [m].")
    tetrahedra: Tetrahedra | None = Field(default=None, description="Tetrahedra of `vertices`, (m, 4) [indices].")
    triangles: Triangles | None = Field(
        default=None,
        description="In place of tetrahedra: triangles (m, 3) of a closed surface of `vertices`, which is filled [indices].",
    )
    cage: Count | None = Field(
        default=None,
        description="Fill the closed surface with about so many tetrahedra of a grid of cells around it, robust and "
        "coarse; the surface moves with them [1].",
    )
    surface: MeshPath | None = Field(
        default=None, description="Finer triangle surface that moves with the solid [path]."
    )
    edge_length: Positive | None = Field(default=None, description="Wanted edge length of the tetrahedra [m].")
    density: Positive | None = Field(default=None, description="Mass per volume [kg/m^3], 1000 when no mass is given.")
    mass: Positive | None = Field(default=None, description="Mass of the whole solid [kg].")

    @model_validator(mode="after")
    def _check(self) -> SolidDef:
        cells = "tetrahedra" if self.triangles is None else "triangles"
        way = exactly_one(self, [("mesh",), ("box",), ("cylinder",), ("vertices", cells)])
        if self.triangles is not None and (way != "vertices" or self.tetrahedra is not None):
            raise problem("triangles go with vertices only, in place of tetrahedra", "triangles")
        for name in ("edge_length", "cage"):
            if getattr(self, name) is not None and way != "mesh" and self.triangles is None:
                raise problem(f"{name} goes with mesh or triangles only", name)
        if self.edge_length is not None and self.cage is not None:
            raise problem("give edge_length or cage, not both", "cage")
        if self.vertices is not None:
            _check_indices(self.tetrahedra, len(self.vertices), "tetrahedra")
            _check_indices(self.triangles, len(self.vertices), "triangles")
        self._density_or_mass(1000.0)
        return self
