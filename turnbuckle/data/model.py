"""Model: what is constant in a run. Arrays of points come body after body."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import warp as wp

from turnbuckle.data.contact import ContactOptions, Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.data.rigid import ForceField, RigidBodies, RigidField
from turnbuckle.data.shape import Shape


@dataclass(frozen=True)
class Springs:
    """Distance energies on pairs of points (:mod:`turnbuckle.bodies.springs`)."""

    pairs: np.ndarray  # (n, 2) int32
    length: np.ndarray  # (n,) rest length [m]
    k: np.ndarray  # (n,) [J]; stiffness [N/m] times length^2
    k_d: np.ndarray  # (n,) [J s]


@dataclass(frozen=True)
class Tetrahedra:
    """Solids (:mod:`turnbuckle.bodies.tetrahedra`). Unique edges and triangles carry one energy each."""

    corners: np.ndarray  # (n, 4) int32, det > 0
    material: np.ndarray  # (n,) int32, row of `materials`
    materials: np.ndarray  # (bodies, 6): k_distance, k_area, k_volume [J], and their k_d [J s]
    volume: np.ndarray  # (n,) rest volume [m^3]
    edges: np.ndarray  # (e, 2) int32, unique
    edge_length: np.ndarray  # (e,) rest length [m]
    edge_material: np.ndarray  # (e,) int32
    triangles: np.ndarray  # (f, 3) int32, unique, inner ones included
    triangle_area: np.ndarray  # (f,) rest area [m^2]
    triangle_material: np.ndarray  # (f,) int32


@dataclass(frozen=True)
class Hinges:
    """Dihedral bending of cloth: ``E = k (theta - theta_0)^2 / 2`` across inner edges (:mod:`turnbuckle.bodies.bending`)."""

    points: np.ndarray  # (n, 4) int32: the shared edge's two points, then the opposite ones
    angle: np.ndarray  # (n,) rest angle [rad], 0 when flat
    k: np.ndarray  # (n,) [N m / rad]
    k_d: np.ndarray  # (n,) [N m s / rad]


@dataclass(frozen=True)
class Corotational:
    """Linear tetrahedra in the frame of their rotation, Mueller and Gross 2004 (:mod:`turnbuckle.bodies.corotational`)."""

    corners: np.ndarray  # (n, 4) int32, det > 0
    youngs_modulus: np.ndarray  # (n,) [Pa]
    poissons_ratio: np.ndarray  # (n,) [1]
    damping: np.ndarray  # (n,) [s], times the stiffness matrix: viscous forces in the same frame
    rest: np.ndarray  # (n, 4, 3) corners at rest [m]


@dataclass(frozen=True)
class StrainLimits:
    """Springs that may not stretch beyond a bound, kept as rows of the contact problem (Provot 1995 asks the same)."""

    pairs: np.ndarray  # (n, 2) int32
    length: np.ndarray  # (n,) the longest allowed [m]


@dataclass(frozen=True)
class Scripted:
    """Points that go where a function says: obstacles and animated characters."""

    name: str
    begin: int  # its points are x[begin:end] of the state
    end: int
    positions: Callable[[float], np.ndarray]  # t [s] -> (end - begin, 3) [m]
    moves: bool  # False for what stays where it is


@dataclass(frozen=True)
class Field:
    """A force field on some points."""

    name: str
    points: np.ndarray  # (n,) int32
    force: ForceField


@dataclass(frozen=True)
class Model:
    """All that is constant. Masses in kg, lengths in m."""

    name: str
    device: str
    up_axis: str
    integrator: str
    response: str  # "exact" | "paper"
    conflicts: str  # "error" | "solve"
    mass: np.ndarray  # (points,) [kg]
    rest: np.ndarray  # (points, 3), where the points start [m]
    size: float  # diagonal of the box around all points at the start [m]; residuals are judged against it
    springs: Springs
    tetrahedra: Tetrahedra
    fields: tuple[Field, ...]
    shapes: tuple[Shape, ...]
    rigid: RigidBodies
    rigid_fields: tuple[RigidField, ...]
    solver: str  # "equality" | "displacement"
    displacement: object  # options of the displacement solver
    rigid_motion: str  # "rotor" | "paper"
    max_rotation: float  # [rad] a step
    hinges: Hinges
    corotational: Corotational
    strain_limits: StrainLimits
    scripted: tuple[Scripted, ...] = ()
    surfaces: Surfaces | None = None  # None where contact is off
    contact: ContactOptions = ContactOptions()
    repairs: tuple[str, ...] = ()  # what was mended in the user's meshes, one line each
    device_arrays: dict[str, wp.array] = field(default_factory=dict)  # uploaded once by build()

    @property
    def points(self) -> int:
        """Number of mass points."""
        return len(self.mass)

    @cached_property
    def body_of(self) -> np.ndarray:
        """The rigid body of each point (points,), -1 for mass points."""
        out = np.full(self.points, -1, dtype=np.int64)
        for b in range(1, self.rigid.count):
            out[self.rigid.begin[b] : self.rigid.end[b]] = b
        return out

    @property
    def damped(self) -> bool:
        """Whether any element dissipates."""
        dampings = (self.springs.k_d, self.tetrahedra.materials[:, 3:], self.hinges.k_d, self.corotational.damping)
        return any(bool((values > 0).any()) for values in dampings)

    def shape(self, name: str) -> Shape:
        """The body called ``name``. Raises `InputError` when there is none."""
        for shape in self.shapes:
            if shape.name == name:
                return shape
        known = ", ".join(f"'{s.name}'" for s in self.shapes)
        raise InputError(f"there is no body '{name}'; there are {known}")
