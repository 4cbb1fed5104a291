"""The graph of a scene: objects, and what each constraint holds between two of them: a point, an angle, or both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from turnbuckle.scene.definitions import (
    AttachDef,
    BallDef,
    BodyPairDef,
    CoatingDef,
    ConstraintDef,
    DistanceDef,
    JointDef,
    NailDef,
    PointsToPointDef,
    PointToRingDef,
    SceneDef,
    SlideDef,
    VelocityDef,
)

WORLD = None  # the fixed world, as a node
POINT, BOTH, ANGLE = "point", "point and angle", "angle"
KINDS = (POINT, BOTH, ANGLE)
Node = str | None


@dataclass(frozen=True)
class Edge:
    """One constraint between two objects; `None` is the world."""

    ends: tuple[Node, Node]
    kind: str  # one of KINDS
    name: str


@dataclass(frozen=True)
class ConstraintGraph:
    """Objects that constraints tie, the world first where they tie to it, and the constraints between them."""

    nodes: list[Node]
    edges: list[Edge]
    free: list[str]  # objects that no constraint names

    def count(self, kind: str) -> int:
        """Constraints of one kind."""
        return sum(edge.kind == kind for edge in self.edges)


def constraint_graph(definition: SceneDef) -> ConstraintGraph:
    """The graph of a scene. A coating is one with its kernel. What is disabled is in it: it can be switched on."""
    kernel: dict[Node, Node] = {body.name: body.around for body in definition.bodies if isinstance(body, CoatingDef)}
    edges = []
    for item in definition.constraints:
        for a, b in ends_of(item):
            ends = kernel.get(a, a), kernel.get(b, b)
            edges.append(Edge(ends, kind_of(item), item.name))
    tied = {end for edge in edges for end in edge.ends}
    names: list[str] = [body.name for body in definition.bodies if body.name not in kernel]
    nodes: list[Node] = [WORLD] if WORLD in tied else []
    nodes += [name for name in names if name in tied]
    return ConstraintGraph(nodes, edges, [name for name in names if name not in tied])


def kind_of(item: ConstraintDef) -> str:
    """Whether a constraint holds a point, an angle or both. A limit counts as holding."""
    if isinstance(item, JointDef):
        turns = bool(item.given(("angle", "twist", "fixed_rotation")))
        place = bool(item.given(("axial", "planar", "curve", "surface", "sphere", "domain"))) or not item.has_no_place
        return BOTH if turns and place else ANGLE if turns else POINT
    if isinstance(item, BodyPairDef) and not isinstance(item, (BallDef, DistanceDef, PointToRingDef)):
        return BOTH
    return POINT


def ends_of(item: ConstraintDef) -> Iterator[tuple[Node, Node]]:
    """The pairs of objects that a constraint ties; several bodies in one knot are tied in a row."""
    if isinstance(item, BodyPairDef):
        yield item.body0, item.body1
    elif isinstance(item, (NailDef, VelocityDef)):
        for body in dict.fromkeys(points.body for points in item.points):
            yield WORLD, body
    elif isinstance(item, (AttachDef, SlideDef)):
        other = item.to.body if isinstance(item, AttachDef) else item.on.body
        for body in dict.fromkeys(points.body for points in item.points):
            yield other, body
    elif isinstance(item, PointsToPointDef):
        yield from pairwise(dict.fromkeys(bodies_joined(item)))


def bodies_joined(item: PointsToPointDef) -> Iterator[str]:
    """Bodies whose points become one."""
    for group in item.groups or ():
        yield from (ref.body for ref in group)
    yield from (points.body for points in (item.zip or item.join or ()))
    if item.coincident is not None:
        yield from item.coincident.bodies
