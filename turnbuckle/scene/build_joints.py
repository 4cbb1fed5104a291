"""From the definition of a joint to its elementary parts, in the inertial frames of its bodies."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from turnbuckle.data import rigid
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import FREE, Joint, JointParts, RigidBodies
from turnbuckle.data.state import State
from turnbuckle.geometry.curve_domain import Curve
from turnbuckle.geometry.domains import CallableDomain, Domain
from turnbuckle.geometry.surface_domain import Surface
from turnbuckle.meshes.read import SurfaceMesh, read_mesh
from turnbuckle.scene.definitions import BodyPairDef, JointDef, NamedJointDef, RollingDef
from turnbuckle.scene.joint_definitions import AngleDef, CurveDef, SoftDef, SurfaceDef, TwistDef
from turnbuckle.scene.joint_problems import NOT_FREE, NOT_RIGID
from turnbuckle.scene.named_joints import perpendicular
from turnbuckle.scene.suggestion import did_you_mean

Row = dict[str, object]
STRAIGHT = 1e-12  # [rad], an angle this near to 0 or pi is that


def empty_parts() -> JointParts:
    """No parts."""
    shapes = {"p_a": (0, 3), "p_b": (0, 3), "q_a": (0, 4), "q_b": (0, 4)}
    whole = ("kind", "joint", "a", "b", "domain")
    return JointParts(
        **{f.name: np.zeros(shapes.get(f.name, 0), np.int32 if f.name in whole else float) for f in fields(JointParts)}
    )


def add_joints(model: Model, state: State, definitions: Sequence[BodyPairDef], folder: Path) -> None:
    """Add joints between bodies as they are now. Raises `InputError`."""
    for d in definitions:
        if d.name in state.joints or d.name in state.groups:
            raise InputError(f"there is a constraint '{d.name}' already; remove it or take another name")
    known = [shape.name for shape in model.shapes]
    builder = JointBuilder(model.rigid, state.rigid.x.numpy(), state.rigid.q.numpy(), folder, known)
    state.parts = builder.add(definitions, state.joints, state.parts, state.domains)
    state.layout += 1


def remove_joint(state: State, name: str) -> None:
    """Forget a joint; its parts stay, switched off."""
    del state.joints[name]
    state.layout += 1


class JointBuilder:
    """Makes joints for bodies as they are now: ``x`` (n, 3), ``q`` (n, 4 xyzw) of the inertial frames."""

    def __init__(
        self, bodies: RigidBodies, x: np.ndarray, q: np.ndarray, folder: Path, known: Sequence[str] = ()
    ) -> None:
        """``known``: names of all bodies of the scene, for messages."""
        self.bodies, self.x, self.q, self.folder, self.known = bodies, x, q, folder, known
        self.number = {name: i for i, name in enumerate(bodies.names) if i > 0}

    def add(
        self, definitions: Sequence[BodyPairDef], joints: dict[str, Joint], parts: JointParts, domains: list[Domain]
    ):
        """Append joints, their parts and domains in place of columns; returns the longer `JointParts`. Raises InputError."""
        rows: list[Row] = []
        first = parts.count
        number = max(int(parts.joint.max(initial=-1)), len(joints) - 1)
        for d in definitions:
            try:
                own = self._parts(d, domains)
            except InputError as error:
                raise InputError(f"joint '{d.name}': {error}") from None
            number += 1
            numbers = np.arange(first + len(rows), first + len(rows) + len(own))
            for row in own:
                row["joint"] = number
            rows += own
            joints[d.name] = Joint(
                name=d.name, kind=d.type, a=self._body(d.body1), b=self._body(d.body0), parts=numbers, enabled=d.enabled,
                start=d.start, end=np.inf if d.end is None else d.end,
                break_force=np.inf if d.break_force is None else d.break_force,
                break_torque=np.inf if d.break_torque is None else d.break_torque,
                mu=np.nan if d.mu is None else d.mu, alpha=np.nan if d.alpha is None else d.alpha, definition=d,
            )  # fmt: skip
        if not rows:
            return parts
        columns = {}
        for f in fields(JointParts):
            old = getattr(parts, f.name)
            new = np.array([row[f.name] for row in rows], dtype=old.dtype).reshape(-1, *old.shape[1:])
            columns[f.name] = np.concatenate([old, new])
        return JointParts(**columns)

    def _body(self, name: str | None) -> int:
        if name is None:
            return 0
        if name not in self.number:
            if name in self.known:
                raise InputError(f"'{name}' {NOT_RIGID}")
            raise InputError(f"there is no body '{name}'{did_you_mean(name, self.known or self.number)}")
        return self.number[name]

    # Frames --------------------------------------------------------------------------------------------------------

    def _frame(self, b: int) -> tuple[np.ndarray, Rotation]:
        """The user's frame of body ``b`` in the world now."""
        to_world = Rotation.from_quat(self.q[b])
        return self.x[b] + to_world.apply(self.bodies.frame_x[b]), to_world * Rotation.from_quat(self.bodies.frame_q[b])

    def _place(self, b: int, local: np.ndarray) -> np.ndarray:
        """A point of the user's frame in the inertial frame."""
        return self.bodies.frame_x[b] + Rotation.from_quat(self.bodies.frame_q[b]).apply(np.array(local))

    def _axes(self, b: int, z: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
        """The frame with axis ``z`` (and ``x``), given in the user's frame, as xyzw in the inertial frame."""
        z = z / np.linalg.norm(z)
        x = perpendicular(z) if x is None else x - (x @ z) * z
        x = x / np.linalg.norm(x)
        own = Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=1))
        return (Rotation.from_quat(self.bodies.frame_q[b]) * own).as_quat()

    # Parts ---------------------------------------------------------------------------------------------------------

    def _parts(self, d: BodyPairDef, domains: list[Domain]) -> list[Row]:
        a, b = self._body(d.body1), self._body(d.body0)
        if self.bodies.motion[a] != rigid.DYNAMIC and self.bodies.motion[b] != rigid.DYNAMIC:
            raise InputError(NOT_FREE)
        x_a, to_a = self._frame(a)
        x_b, to_b = self._frame(b)
        if isinstance(d, RollingDef):
            return [self._rolling(d, a, b)]
        try:
            general = d.as_general(to_a.inv() * to_b) if isinstance(d, NamedJointDef) else d.as_joint()
        except ValidationError as error:  # limits and motors that contradict each other
            raise InputError("; ".join(found["msg"] for found in error.errors(include_url=False))) from None
        if d.anchor is not None:
            local_a, local_b = to_a.inv().apply(d.anchor - x_a), to_b.inv().apply(d.anchor - x_b)
            if general.given(("curve", "surface", "domain")):  # these lie in body0's frame as they are
                local_b = np.zeros(3)
        else:
            zero = np.zeros(3)
            local_a = zero if d.local_pos1 is None else d.local_pos1
            local_b = zero if d.local_pos0 is None else d.local_pos0
        base = self._row(a, b, d, self._place(a, local_a), self._place(b, local_b))
        return [*self._translation(general, base, domains), *self._rotation(general, base), *self._motor(general, base)]

    def _row(self, a: int, b: int, d: BodyPairDef, p_a: np.ndarray, p_b: np.ndarray) -> Row:
        one = np.array([0.0, 0.0, 0.0, 1.0])
        return {
            "kind": -1, "joint": -1, "a": a, "b": b, "p_a": p_a, "p_b": p_b, "q_a": one, "q_b": one,
            "lo": -FREE, "hi": FREE, "stiffness": 0.0, "damping": 0.0, "restitution": d.restitution, "target": 0.0,
            "time_constant": 0.0, "max_force": FREE, "domain": -1,
        }  # fmt: skip

    def _translation(self, d: JointDef, base: Row, domains: list[Domain]) -> list[Row]:
        b = int(base["b"])  # type: ignore[call-overload]
        if d.axial is not None:
            limits = {"lo": _bound(d.axial.min, -FREE), "hi": _bound(d.axial.max, FREE)}
            row = {**base, **limits, **_soft(d.axial), "q_b": self._axes(b, d.axial.axis)}
            if limits["lo"] == limits["hi"] == 0.0 and not d.axial.soft:
                return [{**base, "kind": rigid.POINT}]
            return [{**row, "kind": rigid.SEGMENT}]
        if d.planar is not None:
            hi = _bound(d.planar.max, FREE)
            lo = d.planar.min if d.planar.min > 0.0 else -FREE
            if hi == 0.0 and not d.planar.soft:
                return [{**base, "kind": rigid.POINT}]
            row = {**base, "lo": hi if d.planar.min == hi else lo, "hi": hi, **_soft(d.planar)}
            return [{**row, "q_b": self._axes(b, d.planar.normal), "kind": rigid.RING}]
        if d.sphere is not None:
            hi = _bound(d.sphere.max, FREE)
            lo = d.sphere.min if d.sphere.min > 0.0 or hi == 0.0 else -FREE
            if hi == 0.0 and not d.sphere.soft:
                return [{**base, "kind": rigid.POINT}]
            return [{**base, "lo": lo, "hi": hi, **_soft(d.sphere), "kind": rigid.SPHERE}]
        domain = self._domain(d)
        if domain is not None:
            domains.append(domain[1])
            # the domain's coordinates are those of the user's frame of b, seen from P_b
            return [{**base, "q_b": self.bodies.frame_q[b], "kind": domain[0], "domain": len(domains) - 1}]
        return [] if d.has_no_place else [{**base, "kind": rigid.POINT}]

    def _domain(self, d: JointDef) -> tuple[int, Domain] | None:
        if d.curve is not None:
            return rigid.CURVE, _curve(d.curve)
        if d.surface is not None:
            return rigid.SURFACE, _surface(d.surface, self.folder)
        if d.domain is not None:
            return rigid.CALLABLE, CallableDomain(d.domain)
        return None

    def _rotation(self, d: JointDef, base: Row) -> list[Row]:
        a, b = int(base["a"]), int(base["b"])  # type: ignore[call-overload]
        if d.fixed_rotation:
            frame_b = self.bodies.frame_q[b]
            world = Rotation.from_quat(self.q[b]) * Rotation.from_quat(frame_b)
            return [
                {
                    **base,
                    "kind": rigid.FIXED,
                    "q_b": frame_b,
                    "q_a": (Rotation.from_quat(self.q[a]).inv() * world).as_quat(),
                }
            ]
        rows = []
        if d.angle is not None:
            rows += self._angle(d.angle, base, a, b)
        if d.twist is not None:
            lo, hi = _bound(d.twist.min, -FREE), _bound(d.twist.max, FREE)
            lo, hi = (-FREE if lo <= -np.pi else lo), (FREE if hi >= np.pi else hi)
            if lo > -FREE or hi < FREE:
                rows.append(
                    {**base, **self._twist_axes(d, a, b), "lo": lo, "hi": hi, **_soft(d.twist), "kind": rigid.TWIST}
                )
        return rows

    def _angle(self, d: AngleDef, base: Row, a: int, b: int) -> list[Row]:
        lo, hi = d.min, _bound(d.max, FREE)
        if lo <= 0.0 and hi >= np.pi:
            return []
        z_a = d.axis1
        if lo == hi and abs(lo - np.pi) < STRAIGHT:
            z_a, lo, hi = -z_a, 0.0, 0.0
        row = {**base, "lo": lo if lo > 0.0 or hi == 0.0 else -FREE, "hi": hi if hi < np.pi else FREE, **_soft(d)}
        return [{**row, "q_a": self._axes(a, z_a), "q_b": self._axes(b, d.axis0), "kind": rigid.ANGLE}]

    def _twist_axes(self, d: JointDef, a: int, b: int) -> Row:
        t = d.twist
        assert isinstance(t, TwistDef)
        z_a = t.axis1 if t.axis1 is not None else d.angle.axis1  # type: ignore[union-attr]
        z_b = t.axis0 if t.axis0 is not None else d.angle.axis0  # type: ignore[union-attr]
        return {"q_a": self._axes(a, z_a, t.vector1), "q_b": self._axes(b, z_b, t.vector0)}

    def _motor(self, d: JointDef, base: Row) -> list[Row]:
        m = d.motor
        if m is None:
            return []
        a, b = int(base["a"]), int(base["b"])  # type: ignore[call-overload]
        row = {**base, "max_force": _bound(m.max_force, FREE)}
        if m.target_velocity is not None:
            row["target"] = m.target_velocity
        else:
            row["target"], row["time_constant"] = m.target_position, m.time_constant
        if m.on == "twist":
            return [{**row, **self._twist_axes(d, a, b), "kind": rigid.MOTOR_TWIST}]
        return [{**row, "q_b": self._axes(b, d.axial.axis), "kind": rigid.MOTOR_AXIAL}]  # type: ignore[union-attr]

    def _rolling(self, d: RollingDef, a: int, b: int) -> Row:
        n = d.normal / np.linalg.norm(d.normal)
        if d.anchor is not None:  # the centre of the wheel
            x_a, to_a = self._frame(a)
            x_b, to_b = self._frame(b)
            p_a = to_a.inv().apply(d.anchor - x_a)
            p_b = to_b.inv().apply(d.anchor - x_b) - d.radius * n
        else:
            p_a, p_b = d.local_pos1, d.local_pos0
        row = self._row(a, b, d, self._place(a, p_a), self._place(b, p_b))
        axle = np.array([0.0, 0.0, 1.0]) if d.axis is None else d.axis
        frames = {"q_a": self._axes(a, axle), "q_b": self._axes(b, n)}
        return {**row, **frames, "lo": float(d.axis is None), "hi": d.radius, "kind": rigid.ROLLING}


def _bound(value: float | None, free: float) -> float:
    return free if value is None else float(value)


def _soft(d: SoftDef) -> Row:
    return {"stiffness": d.stiffness or 0.0, "damping": d.damping or 0.0}


def _curve(d: CurveDef) -> Domain:
    return Curve(np.array(d.points), closed=d.closed, spline=d.interpolation == "spline")


def _surface(d: SurfaceDef, folder: Path) -> Domain:
    if d.mesh is None:
        return Surface(np.array(d.vertices), np.array(d.triangles))
    mesh = read_mesh(folder / d.mesh)
    if not isinstance(mesh, SurfaceMesh):
        raise InputError(f"surface.mesh '{d.mesh}' is no triangle surface")
    return Surface(mesh.vertices, mesh.triangles)
