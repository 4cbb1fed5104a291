"""Material around rigid kernels, and skins over chains of bodies, as the user writes them (Displacement, 5.1)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from turnbuckle.scene.base_definition import Definition, exactly_one, problem
from turnbuckle.scene.body_definitions import MaterialFields
from turnbuckle.scene.contact_definitions import TouchFields
from turnbuckle.scene.fields import Color, Corners, Count, MeshPath, Name, Positive, Vec3


class CoatingDef(TouchFields, MaterialFields):
    """A deformable solid around a rigid body, its kernel. It lies and moves with the kernel at the start.

    Its inner points, those on the kernel's surface (with `mesh`: in the kernel), are held on the kernel exactly by a
    constraint named `NAME.kernel`. Elsewhere it is a solid like any other: constraints take its points by its name.
    """

    type: Literal["coating"] = "coating"
    name: Name = Field(description="Name, unique among bodies [text].")
    around: Name = Field(description="Name of the rigid body inside [text].")
    thickness: Positive | None = Field(
        default=None, description="Thickness around a box, sphere, cylinder or capsule [m]."
    )
    mesh: MeshPath | None = Field(
        default=None, description="Outer surface, closed, in the kernel's frame; filled with tetrahedra [path]."
    )
    edge_length: Positive | None = Field(default=None, description="Wanted edge length of the tetrahedra [m].")
    layers: Count | None = Field(default=None, description="Layers of tetrahedra in `thickness`, 1 when left out [1].")
    color: Color | None = Field(default=None, description="Red, green, blue, each from 0 to 1 [1].")
    density: Positive | None = Field(default=None, description="Mass per volume [kg/m^3], 1000 when no mass is given.")
    mass: Positive | None = Field(default=None, description="Mass of the whole coating [kg].")

    @model_validator(mode="after")
    def _check(self) -> CoatingDef:
        way = exactly_one(self, [("thickness",), ("mesh",)])
        if way == "mesh" and self.layers is not None:
            raise problem("layers go with thickness only", "layers")
        if self.density is not None and self.mass is not None:
            raise problem("give density or mass, not both", "mass")
        if self.density is None and self.mass is None:
            self.fill("density", 1000.0)
        return self


class SectionDef(Definition):
    """A ring of control points, fixed in the frame of a body."""

    body: Name = Field(description="One of the skin's bodies [text].")
    position: Vec3 = Field(description="Centre of the ring, in the body's frame at the start [m].")
    axis: Vec3 = Field(description="Normal of the ring, pointing along the chain, in the body's frame [vector].")
    radius: Positive = Field(description="Radius of the surface there [m].")

    @model_validator(mode="after")
    def _check(self) -> SectionDef:
        if not (self.axis != 0.0).any():
            raise problem("must not be zero", "axis")
        return self


class SkinDef(Definition):
    """One closed bicubic B-spline surface over a chain of bodies, drawn and exported in their place.

    Rings of control points lie around each body and move with it; both ends are closed by caps.
    """

    name: Name = Field(description="Name, unique among bodies and skins [text].")
    bodies: Annotated[list[Name], Field(min_length=1)] = Field(
        description="The bodies it covers, in order along the chain: rigid bodies, coatings or solids [text]."
    )
    rings: Count | None = Field(default=None, description="Rings of control points around each body, 3 [1].")
    radius: Positive | None = Field(
        default=None, description="Radius of the surface; that of the bodies when left out [m]."
    )
    sections: Annotated[list[SectionDef], Field(min_length=2)] | None = Field(
        default=None, description="The rings themselves, in order along the chain, in place of rings and radius [list]."
    )
    around: Corners = Field(default=12, description="Control points of a ring [1].")
    resolution: Count = Field(default=4, description="Cells of the drawn surface per control point, each way [1].")
    color: Color | None = Field(default=None, description="Red, green, blue, each from 0 to 1 [1].")

    @model_validator(mode="after")
    def _check(self) -> SkinDef:
        for i, name in enumerate(self.bodies):
            if name in self.bodies[:i]:
                raise problem(f"names {name!r} twice", "bodies", i)
        if self.sections is not None:
            for field in ("rings", "radius"):
                if getattr(self, field) is not None:
                    raise problem(f"sections stand in place of {field}; give one of them", field)
            for i, section in enumerate(self.sections):
                if section.body not in self.bodies:
                    raise problem(f"{section.body!r} is none of the skin's bodies", "sections", i, "body")
        return self
