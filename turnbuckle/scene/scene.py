"""`Scene`: what a user of the library writes. Every call validates at once and says which field is wrong."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.scene.build import build
from turnbuckle.scene.definitions import (
    JOINTS,
    AttachDef,
    ClothDef,
    CoatingDef,
    ConstraintBase,
    ForceDef,
    NailDef,
    NetDef,
    ObstacleDef,
    PointsToPointDef,
    RigidDef,
    RopeDef,
    SceneDef,
    SkinDef,
    SlideDef,
    SolidDef,
    VelocityDef,
    reference_problems,
)
from turnbuckle.scene.language.reader import add_description, is_description, parse_description, read_description
from turnbuckle.scene.language.writer import write_description
from turnbuckle.scene.overrides import override
from turnbuckle.scene.suggestion import did_you_mean
from turnbuckle.scene.validation import D, given_data, place_text, report, validate
from turnbuckle.scene.yaml_file import definition_text, parse_definition, read_definition, write_definition
from turnbuckle.scene.yaml_writer import write_yaml

CONSTRAINTS: dict[str, type[ConstraintBase]] = {
    "nail": NailDef,
    "points_to_point": PointsToPointDef,
    "attach": AttachDef,
    "slide": SlideDef,
    "velocity": VelocityDef,
    **JOINTS,
}


class Scene:
    """A scene that grows by `add_` calls. `definition` is the validated data, `folder` what meshes are relative to."""

    def __init__(self, name: str = "scene", *, folder: str | os.PathLike[str] | None = None, **fields: Any) -> None:
        """A new scene. `fields` are those of `SceneDef`: dt [s], duration [s], integrator, gravity [m/s^2], ...

        `folder`: where relative paths of meshes start, the working directory when left out.
        Raises `InputError` for a wrong or unknown field.
        """
        self.folder = Path(folder) if folder is not None else Path()
        self.definition: SceneDef = validate(SceneDef, {"name": name, **fields}, "", {"folder": self.folder})

    @classmethod
    def from_definition(cls, definition: SceneDef, folder: str | os.PathLike[str] | None = None) -> Scene:
        """A scene around a definition that is already validated."""
        scene = cls(folder=folder)
        scene.definition = definition
        return scene

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], folder: str | os.PathLike[str] | None = None) -> Scene:
        """A scene from nested dicts as in a scene file (arrays and callables allowed). Raises `InputError`."""
        folder = Path(folder) if folder is not None else Path()
        return cls.from_definition(validate(SceneDef, data, "", {"folder": folder}), folder)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file: YAML, or `.gascuel`, the description language.

        Raises `InputError` with file, line and field of each problem.
        """
        read = read_description if is_description(path) else read_definition
        return cls.from_definition(read(path), Path(path).parent)

    @classmethod
    def loads(cls, text: str, folder: str | os.PathLike[str] | None = None) -> Scene:
        """Read a scene from YAML text; meshes are relative to `folder`, the working directory when left out."""
        folder = Path(folder) if folder is not None else Path()
        return cls.from_definition(parse_definition(text, folder), folder)

    @classmethod
    def from_description(cls, text: str, folder: str | os.PathLike[str] | None = None) -> Scene:
        """Read a scene from text in the description language; meshes are relative to `folder`, as in `loads`."""
        folder = Path(folder) if folder is not None else Path()
        return cls.from_definition(parse_description(text, folder), folder)

    def include(self, path: str | os.PathLike[str]) -> list[str]:
        """Add what a `.gascuel` file describes; returns the names of its constraints.

        The file may name objects of the scene, and need not describe any; where it says `world`, it changes fields of the
        scene. Raises `InputError`; the scene is unchanged then.
        """
        before = len(self.definition.constraints)
        self.definition = add_description(path, self.definition, self.folder)
        return [constraint.name for constraint in self.definition.constraints[before:]]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a scene file, YAML or by its suffix `.gascuel`, that reads back the same bit for bit; long arrays go
        into a `.arrays.npz` beside it.

        Raises `InputError` that names any force or constraint with a Python callable.
        """
        write_definition(self.definition, self.folder, path, write_description if is_description(path) else write_yaml)

    def to_yaml(self) -> str:
        """The scene as YAML text, arrays inside. Raises `InputError` where there is a Python callable."""
        return definition_text(self.definition)

    def to_description(self) -> str:
        """The scene as text in the description language. Raises `InputError` where there is a Python callable."""
        return definition_text(self.definition, write_description)

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.definition.name

    def add_rope(self, name: str, **fields: Any) -> str:
        """Add a rope (fields of `RopeDef`); returns its name."""
        return self._add("bodies", RopeDef, "rope", name, fields)

    def add_net(self, name: str, **fields: Any) -> str:
        """Add a net (fields of `NetDef`); returns its name."""
        return self._add("bodies", NetDef, "net", name, fields)

    def add_cloth(self, name: str, **fields: Any) -> str:
        """Add a cloth (fields of `ClothDef`); returns its name."""
        return self._add("bodies", ClothDef, "cloth", name, fields)

    def add_solid(self, name: str, **fields: Any) -> str:
        """Add a tetrahedral solid (fields of `SolidDef`); returns its name."""
        return self._add("bodies", SolidDef, "solid", name, fields)

    def add_rigid(self, name: str, **fields: Any) -> str:
        """Add a rigid body (fields of `RigidDef`); returns its name."""
        return self._add("bodies", RigidDef, "rigid", name, fields)

    def add_obstacle(self, name: str, **fields: Any) -> str:
        """Add an obstacle, immobile or scripted (fields of `ObstacleDef`); returns its name."""
        return self._add("bodies", ObstacleDef, "obstacle", name, fields)

    def add_coating(self, name: str, **fields: Any) -> str:
        """Add deformable material around a rigid body (fields of `CoatingDef`: around, thickness); returns its name."""
        return self._add("bodies", CoatingDef, "coating", name, fields)

    def add_skin(self, name: str, **fields: Any) -> str:
        """Add one smooth surface over a chain of bodies (fields of `SkinDef`: bodies); returns its name."""
        return self._add("skins", SkinDef, "skin", name, fields)

    def add_joint(self, type: str, name: str, **fields: Any) -> str:
        """Add a joint: "ball", "revolute", "universal", "prismatic", "cylindrical", "planar", "weld", "distance",
        "cone_twist", "point_to_ring", "rolling", or the general "joint"; returns its name.

        `fields` are those of its definition (`turnbuckle.scene.named_joints`, `JointDef`).
        """
        if type not in JOINTS:
            raise InputError(f"joint {name!r}: unknown type {type!r}{did_you_mean(type, JOINTS)}")
        return self._add("constraints", JOINTS[type], type, name, fields)

    def add_force(self, name: str, **fields: Any) -> str:
        """Add a force field (fields of `ForceDef`: body, and expression or callable, or pull); returns its name."""
        return self._add("forces", ForceDef, "force", name, fields)

    def add_constraint(self, type: str, name: str, **fields: Any) -> str:
        """Add a constraint: "nail", "points_to_point", "attach", "slide", "velocity", or a joint; returns its name.

        `fields` are those of its definition (`NailDef`, `PointsToPointDef`, `AttachDef`, `SlideDef`, `VelocityDef`; for
        joints see `add_joint`).
        """
        if type not in CONSTRAINTS:
            raise InputError(f"constraint {name!r}: unknown type {type!r}{did_you_mean(type, CONSTRAINTS)}")
        return self._add("constraints", CONSTRAINTS[type], type, name, fields)

    def set_contact(self, **fields: Any) -> None:
        """Turn contact on (fields of `ContactDef`), with names of bodies that are there already."""
        self._change("contact", fields)

    def add_friction(self, a: str, b: str, static: float, dynamic: float | None = None) -> None:
        """Friction between two bodies or materials that are there already (see `FrictionDef`)."""
        frictions = [given_data(pair) for pair in self.definition.frictions]
        self._change("frictions", [*frictions, {"between": [a, b], "static": static, "dynamic": dynamic}])

    def _change(self, field: str, value: Any) -> None:
        """The scene with one field anew. Raises `InputError`; the scene is unchanged then."""
        data = given_data(self.definition)
        self.definition = validate(SceneDef, {**data, field: value}, "", {"folder": self.folder})

    def _add(self, kind: str, definition: type[D], label: str, name: str, fields: dict[str, Any]) -> str:
        where = f"{label} {name!r}"
        item = validate(definition, {"name": name, **fields}, where, {"folder": self.folder})
        items = getattr(self.definition, kind)
        if any(other.name == name for other in items):
            raise InputError(f"{where}, name: there is already one of this name among {kind}")
        drawn = {"bodies": self.definition.skins, "skins": self.definition.bodies}.get(kind, [])
        if any(other.name == name for other in drawn):
            raise InputError(f"{where}, name: is already the name of a {'skin' if kind == 'bodies' else 'body'}")
        unknown = list(reference_problems(item, [body.name for body in self.definition.bodies]))
        if unknown:
            raise InputError(report([(f"{where}, {place_text(at)}", text) for at, text in unknown]))
        items.append(item)
        return name

    def apply_set(self, assignment: str) -> None:
        """Change one field: `dt=1e-3`, `bodies[0].density=3`, or by name `bodies.rope.density=3`.

        The value is YAML. Raises `InputError` that names the field; the scene is then unchanged.
        """
        self.definition = override(self.definition, assignment, {"folder": self.folder})

    def view(self, **options: Any) -> Any:
        """Show the scene in the browser, or in a notebook: `turnbuckle.view` with its options."""
        return import_module("turnbuckle.live.show").view(self, **options)  # above this layer: loaded when asked for

    def build(self, device: str = "cpu") -> tuple[Model, State]:
        """The model (constant) and its first state, on ``device`` ("cpu", "cuda:0").

        Raises `InputError` for what only shows when meshes are read and points are chosen.
        """
        return build(self.definition, self.folder, device)
