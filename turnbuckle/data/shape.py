"""What is drawn and recorded of a body: static topology over the points of the state."""

from dataclasses import dataclass, field

import numpy as np


def _empty(columns: int) -> np.ndarray:
    return np.zeros((0, columns), dtype=np.int32)


@dataclass(frozen=True)
class Skin:
    """A triangle surface that moves with coarser bodies.

    A skin vertex is ``sum_k weights[i, k] * x[points[i, k]]``: its barycentric coordinates in a tetrahedron (Local,
    section 5), or a place on a spline surface over several bodies (Displacement, 5.1).
    """

    points: np.ndarray  # (n, k) int32, indices into the points of the state
    weights: np.ndarray  # (n, k) float64, rows sum to 1
    triangles: np.ndarray  # (m, 3) int32, indices into the n skin vertices

    def positions(self, x: np.ndarray) -> np.ndarray:
        """Skin vertices [m], shape (n, 3), for the positions ``x`` of all points [m], shape (points, 3)."""
        return np.einsum("nk,nkd->nd", self.weights, x[self.points])


@dataclass(frozen=True)
class Shape:
    """One body as a person looks at it. Indices are local: point 0 is ``x[begin]`` of the state."""

    name: str
    begin: int  # the body's points are x[begin:end]
    end: int
    lines: np.ndarray = field(default_factory=lambda: _empty(2))  # (n, 2) int32, ropes and nets
    triangles: np.ndarray = field(default_factory=lambda: _empty(3))  # (n, 3) int32, cloth; the boundary of a solid
    tetrahedra: np.ndarray = field(default_factory=lambda: _empty(4))  # (n, 4) int32
    skin: Skin | None = None  # drawn instead of `triangles` when there
    color: tuple[float, float, float] | None = None  # RGB in [0, 1]
    local: np.ndarray | None = None  # (end - begin, 3) of a rigid body: its points in its own frame [m]
    still: bool = False  # never moves: the camera need not show all of it
    drawn: bool = True  # False for what a skin covers; its points are recorded all the same
