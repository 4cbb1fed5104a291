"""Contact as plain data: surfaces that must not cross, pairs of their features, and the problem that a solver is given.

A *surface vertex* is a weighted sum of points of the state: a mass point, a place in a tetrahedron (embedded surfaces),
a point of a rigid body or of an obstacle. Numbers of vertices, edges and faces below are those of the surfaces.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

# Kinds of pairs.
VERTEX_FACE = 0
EDGE_EDGE = 1

# Shapes of the friction cone's section (solver option `friction`).
FRICTION_SHAPES = ("cone", "pyramid4", "pyramid8", "pyramid16")


@dataclass(frozen=True)
class Surfaces:
    """All that may touch, of all bodies in one numbering. Constant in a run."""

    support: np.ndarray  # (s, 4) int32, points of the state that carry each vertex
    weights: np.ndarray  # (s, 4) of them, rows sum to 1
    faces: np.ndarray  # (f, 3) int32, vertices; outside is counter-clockwise where a surface is closed
    edges: np.ndarray  # (e, 2) int32, lower number first, sorted; edges of faces, and those of ropes
    edge_faces: np.ndarray  # (e, 2) int32, faces at each edge, -1 where there is none (more than two: the first two)
    shape: np.ndarray  # (s,) int32, which of `Model.shapes` each vertex belongs to
    delta: np.ndarray  # (s,) [m] distance that contact keeps; of a pair, the mean of its two sides
    collides: np.ndarray  # (shapes, shapes) bool, symmetric; the diagonal: a body with itself
    friction: np.ndarray  # (shapes, shapes, 2) static and dynamic coefficients of Coulomb friction [1]

    @property
    def vertices(self) -> int:
        """Number of surface vertices."""
        return len(self.support)

    def positions(self, x: np.ndarray) -> np.ndarray:
        """Vertices (s, 3) [m] for positions ``x`` (points, 3) of the points of the state."""
        shape = (len(self.support), int(self.support.max(initial=-1)) + 1)
        return self._carriers(shape) @ x[: shape[1]]

    def _carriers(self, shape: tuple[int, int]) -> sp.csr_array:
        """The weights as a sparse matrix, made once."""
        made = self.__dict__.get("_matrix")
        if made is None:
            starts = np.arange(0, 4 * shape[0] + 1, 4)
            made = sp.csr_array((self.weights.ravel(), self.support.ravel(), starts), shape=shape)
            self.__dict__["_matrix"] = made
        return made


@dataclass
class Pairs:
    """Pairs of features, sorted by kind, then a, then b."""

    kind: np.ndarray  # (n,) int32, VERTEX_FACE or EDGE_EDGE
    a: np.ndarray  # (n,) int32, vertex; or the edge with the lower number
    b: np.ndarray  # (n,) int32, face; or the other edge

    @property
    def count(self) -> int:
        """Pairs."""
        return len(self.kind)

    def part(self, which: np.ndarray) -> "Pairs":
        """Some of them: numbers, or (n,) bool."""
        return Pairs(self.kind[which], self.a[which], self.b[which])


@dataclass
class Contacts:
    """Places where two surfaces are near, or met: what a row of non-penetration needs.

    With ``p = sum_k coefficients[:, k] * x[vertices[:, k]]`` the vector from the place on b to that on a, a row asks
    ``normal . p >= target`` at the end of the step.
    """

    kind: np.ndarray  # (n,) int32
    a: np.ndarray  # (n,) int32, as in Pairs
    b: np.ndarray  # (n,) int32
    vertices: np.ndarray  # (n, 4) int32: vertex and the face's three; or both ends of a, then of b
    coefficients: np.ndarray  # (n, 4): 1, -w0, -w1, -w2; or 1 - s, s, -(1 - t), -t
    normal: np.ndarray  # (n, 3) unit, from b to a
    distance: np.ndarray  # (n,) [m] at the start of the step
    time: np.ndarray  # (n,) of the impact as part of the step, in [0, 1]; 0 for those found near at the start

    @property
    def count(self) -> int:
        """Contacts."""
        return len(self.kind)

    def part(self, which: np.ndarray) -> "Contacts":
        """Some of them: numbers, or (n,) bool."""
        return Contacts(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


@dataclass
class ContactProblem:
    """A velocity problem with frictional contact (Contact, (6), (7)), any time stepper's.

    Unknown v (3 n,): n blocks of three, of points, and two in a row (velocity, angular velocity) of rigid bodies.

        A (v - v*) = load + J^T r + E^T l,    E v = wanted,
        normal part of r >= 0  complementary to  J_n v >= floor,    tangential part of r in the friction cone.
    """

    a: sp.bsr_array  # (3 n, 3 n), 3 x 3 blocks, symmetric and positive definite [kg]
    free: np.ndarray  # (3 n,) v*, velocities without contact [m/s]; need not fulfil E v = wanted
    j: sp.bsr_array  # (3 m, 3 n), 3 x 3 blocks: for each contact the rows n, t1, t2, an orthonormal frame
    floor: np.ndarray  # (m,) [m/s] lower bound of J_n v
    friction: np.ndarray  # (m,) coefficient, 0 for rows without friction
    e: sp.csr_array | None = None  # (k, 3 n) equality rows
    wanted: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (k,)
    pairs: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # first blocks of rigid bodies
    groups: np.ndarray | None = None  # (n,) int32, the body that each block belongs to; A has no entries between bodies
    fixed: np.ndarray | None = None  # (n,) bool, blocks that keep v* whatever happens
    load: np.ndarray | None = None  # (3 n,) [N s], zero when left out; where given, v* need not be free motion

    @property
    def count(self) -> int:
        """Contacts m."""
        return len(self.floor)


@dataclass
class ContactSolution:
    """What a solver found. Residuals are measured by `turnbuckle.solvers.contact.residuals`."""

    velocity: np.ndarray  # (3 n,) [m/s]
    impulse: np.ndarray  # (m, 3) normal and two tangential parts in the frames of the rows [N s]
    equality: np.ndarray  # (k,) impulses of equality rows
    iterations: dict[str, int]  # by loop, "outer", "inner", ...
    residual: float  # [m/s] the largest of all conditions
    converged: bool
    message: str = ""


@dataclass(frozen=True)
class ContactOptions:
    """How contact is kept (scene field `contact`)."""

    solver: str = "newton"  # "newton" | "ica" | "anticipation"
    friction_shape: str = "cone"  # one of FRICTION_SHAPES
    broad_phase: str = "bvh"  # "bvh" | "hash"
    rounds: int = 5  # of constraint manifold refinement before the step is halved
    halvings: int = 2  # depth, before the last resort
    proximity: bool = True  # start with pairs nearer than the tolerance (Contact, 4)
    rows: str = "position"  # "position" | "velocity": non-approaching velocities, as the paper compares
    tolerance: float = 1e-2  # of what gravity or a quarter of delta do in a step: what velocities may miss by [1]
    max_iterations: int = 500
    recovery: float = 0.05  # [m/s] the fastest at which contacts that are too near are let apart
    newton: int = 1  # Newton iterations of the implicit scheme a step
    on_intersection: str = "refuse"  # "refuse" | "grow"
    on_impossible: str = "fail"  # "fail" | "stall"
