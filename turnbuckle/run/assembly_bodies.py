"""What `assemble` moves: the rigid bodies of a scene, and each soft body as one more rigid body of its mass points.

Point constraints become ties between points of these bodies, slides become points on curves and surfaces of them.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.groups import Group
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import DYNAMIC, Joint, JointParts, RigidBodies
from turnbuckle.data.state import State
from turnbuckle.geometry.curve_domain import Curve
from turnbuckle.geometry.domains import Domain, Union
from turnbuckle.geometry.quaternions import conjugate, rotate
from turnbuckle.geometry.surface_domain import Surface
from turnbuckle.solvers.displacement.conditions import Poses
from turnbuckle.solvers.displacement.ties import PointTies

THIN = 1e-4  # of the largest moment: the least that a soft body has, so that straight ropes have an inertia
LEAST_WEIGHT = 1e-14  # of an attachment: points of less take no part


@dataclass
class Clumps:
    """All bodies, where they start, and what ties them."""

    bodies: RigidBodies  # rigid ones first, then soft ones
    poses: Poses
    owner: np.ndarray  # (points of the state,) the body of each point
    local: np.ndarray  # (points, 3) its place in the body's inertial frame [m]
    parts: JointParts
    joints: list[Joint]
    domains: list[Domain]
    ties: PointTies
    soft: dict[str, int]  # number of each soft body

    def positions(self, poses: Poses) -> np.ndarray:
        """All points of the state when the bodies are at ``poses``, (points, 3) [m]."""
        return poses.x[self.owner] + rotate(poses.q[self.owner], self.local)


def clumps(model: Model, state: State, carried: dict[str, str] | None = None) -> Clumps:
    """The bodies of a scene as built. ``carried``: soft bodies that are part of a rigid one, coatings of a kernel."""
    carried = carried or {}
    x_points, owner, local = state.positions(), model.body_of.copy(), np.array(model.rigid.local, dtype=float)
    x, q = state.rigid.x.numpy().copy(), state.rigid.q.numpy().copy()
    number = {name: i for i, name in enumerate(model.rigid.names)}
    soft: dict[str, int] = {}
    mass, inertia, centre, frame = [], [], [], []
    for shape in model.shapes:
        if shape.name in number:
            continue
        points = slice(shape.begin, shape.end)
        if shape.name in carried:
            body = number[carried[shape.name]]
            local[points] = rotate(
                conjugate(np.tile(q[body], (shape.end - shape.begin, 1))), x_points[points] - x[body]
            )
        else:
            body = soft[shape.name] = len(x) + len(mass)
            own = _clump(x_points[points], model.mass[points])
            for column, value in zip((mass, inertia, centre, frame), own[:4], strict=True):
                column.append(value)
            local[points] = own[4]
        owner[points] = body
    n = len(soft)
    if n:
        x, q = np.concatenate([x, np.array(centre)]), np.concatenate([q, np.array(frame)])
    bodies = _with_soft(model.rigid, list(soft), np.array(mass), np.array(inertia).reshape(n, 3))
    made = Clumps(
        bodies, Poses(x, q), owner, local, state.parts, list(state.joints.values()), list(state.domains),
        PointTies.none(), soft,
    )  # fmt: skip
    _add_point_constraints(made, state, x_points)
    return made


def _clump(x: np.ndarray, mass: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mass, principal moments, centre, frame (xyzw) of points held rigid, and where they lie in that frame."""
    total = float(mass.sum())
    centre = mass @ x / total
    r = x - centre
    tensor = (mass * (r * r).sum(axis=1)).sum() * np.eye(3) - np.einsum("n,ni,nj->ij", mass, r, r)
    # The frame stays that of the world: any will do, and a tensor that is nearly round has no clear axes. Only its
    # diagonal counts then, which is all that a choice of shortest steps needs.
    moments = np.diag(tensor)
    moments = np.maximum(moments, max(THIN * float(moments.max()), 1e-12 * total))
    return total, moments, centre, np.array([0.0, 0.0, 0.0, 1.0]), r


def _with_soft(bodies: RigidBodies, names: list[str], mass: np.ndarray, inertia: np.ndarray) -> RigidBodies:
    """The bodies with soft ones after them."""
    n = len(names)
    one = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    more = {
        "motion": np.full(n, DYNAMIC), "mass": mass, "inertia": inertia, "frame_x": np.zeros((n, 3)), "frame_q": one,
        "damping": np.zeros((n, 2)), "ability_to_rotate": np.full(n, np.nan), "begin": np.zeros(n, int),
        "end": np.zeros(n, int),
    }  # fmt: skip
    columns = {name: np.concatenate([getattr(bodies, name), value]) for name, value in more.items()}
    return replace(bodies, names=(*bodies.names, *names), **columns)


def _acts(item: Joint | Group) -> bool:
    """Whether it acts at the start."""
    return bool(item.enabled and item.start <= 0.0 < item.end)


def acting(joints: list[Joint]) -> np.ndarray:
    """Which joints act at the start, bool."""
    return np.array([_acts(joint) and not joint.broken for joint in joints], dtype=bool)


def _add_point_constraints(made: Clumps, state: State, x: np.ndarray) -> None:
    """Ties and sliding points of all groups that act at the start. Wanted velocities place nothing."""
    rows: list[tuple[np.ndarray, np.ndarray, np.ndarray, str]] = []  # points, weights, target, name
    zero = np.zeros(3)
    for group in state.groups.values():
        if not _acts(group):
            continue
        if group.kind == "nail":
            assert group.goal is not None
            goals = np.broadcast_to(group.goal.position(0.0), (len(group.points), 3))
            rows += [(np.array([p]), np.ones(1), g, group.name) for p, g in zip(group.points, goals, strict=True)]
        elif group.kind == "points_to_point":
            for r in range(len(group.rows)):
                points = group.points[group.offsets[r] : group.offsets[r + 1]]
                rows += [(points[[k, 0]], np.array([1.0, -1.0]), zero, group.name) for k in range(1, len(points))]
        elif group.kind == "attach":
            table = state.tables.attach
            count, points, weights = (c.numpy()[group.rows] for c in (table.count, table.points, table.weights))
            rows += [(points[r, :k], weights[r, :k], zero, group.name) for r, k in enumerate(count)]
        elif group.kind == "slide":
            _add_slides(made, state, group, x)
    kept = []
    for points, weights, target, name in rows:
        used = np.abs(weights) > LEAST_WEIGHT
        if len(np.unique(made.owner[points[used]])) > 1 or target is not zero:  # within one body nothing can be moved
            kept.append((points[used], weights[used], target, name))
    if kept:
        points = np.concatenate([row[0] for row in kept])
        made.ties = PointTies(
            np.r_[0, np.cumsum([len(row[0]) for row in kept])], np.concatenate([row[1] for row in kept]),
            made.owner[points], np.zeros(len(points), int), made.local[points], np.array([row[2] for row in kept]),
            names=[row[3] for row in kept],
        )  # fmt: skip


def _add_slides(made: Clumps, state: State, group: Group, x: np.ndarray) -> None:
    """Each sliding point as a joint: the point in a curve or surface of the other body."""
    elements = state.tables.domains[group.domain].elements
    body = int(made.owner[elements[0, 0]])
    used, index = np.unique(elements, return_inverse=True)
    corners, index = made.local[used], index.reshape(elements.shape)
    made.domains.append(Surface(corners, index, group.name) if elements.shape[1] == 3 else _path(corners, index))
    kind = rigid.SURFACE if elements.shape[1] == 3 else rigid.CURVE
    one = np.array([0.0, 0.0, 0.0, 1.0])
    rows = []
    for k, point in enumerate(group.points):
        a = int(made.owner[point])
        if a == body:
            continue
        name = group.name if len(group.points) == 1 else f"{group.name}[{k}]"
        made.joints.append(Joint(name, "slide", a, body, np.array([made.parts.count + len(rows)])))
        rows.append({
            "kind": kind, "joint": len(made.joints) - 1, "a": a, "b": body, "p_a": made.local[point],
            "p_b": np.zeros(3), "q_a": one, "q_b": one, "lo": -rigid.FREE, "hi": rigid.FREE, "max_force": rigid.FREE,
            "domain": len(made.domains) - 1,
        })  # fmt: skip
    if rows:
        made.parts = _longer(made.parts, rows)


def _longer(parts: JointParts, rows: list[dict]) -> JointParts:
    """The parts and more rows; columns that a row leaves out are 0."""
    columns = {}
    for f in fields(JointParts):
        old = getattr(parts, f.name)
        new = np.array([row.get(f.name, 0.0) for row in rows], dtype=old.dtype).reshape(-1, *old.shape[1:])
        columns[f.name] = np.concatenate([old, new])
    return JointParts(**columns)


def _path(points: np.ndarray, lines: np.ndarray) -> Domain:
    """Lines (m, 2) as one curve where they are one path, else one by one."""
    ends = [tuple(map(int, line)) for line in lines]
    near: dict[int, list[int]] = {}
    for a, b in ends:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    tips = [p for p, others in near.items() if len(others) == 1]
    if all(len(others) <= 2 for others in near.values()) and len(tips) in (0, 2):
        path, last = [min(tips or near)], -1
        while True:
            ahead = [p for p in near[path[-1]] if p != last and (len(path) < 3 or p != path[0])]
            if not ahead or ahead[0] in path:
                break
            last = path[-1]
            path.append(ahead[0])
        if len(path) == len(near):
            return Curve(points[path], closed=not tips)
    return Union([Curve(points[list(line)]) for line in ends])
