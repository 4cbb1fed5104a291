"""Rigid bodies and joints once, for the library and for the reference of `reference/multibody.py`."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from reference import joint_rows
from reference.multibody import GRAVITY, Body, Joint, System, angle_between, matrix_of, turn

import turnbuckle

ZERO = np.zeros(3)
X, Y, Z = np.eye(3)


def frame_of(axis: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
    """A right-handed frame with z along ``axis``; x along ``x`` where given."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    if x is None:
        x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


@dataclass
class Part:
    """A body as the test sees it: own frame (position, rotation matrix), centre of mass in it."""

    name: str
    mass: float
    inertia: np.ndarray
    position: np.ndarray
    R: np.ndarray
    center: np.ndarray
    v: np.ndarray
    w: np.ndarray
    rotation: np.ndarray
    extra: dict = field(default_factory=dict)
    drive: Any = None

    @property
    def x(self) -> np.ndarray:
        return self.position + self.R @ self.center


@dataclass
class Link:
    """A joint: the library's type and fields, and the reference's."""

    type: str
    fields: dict
    joint: Joint
    known: bool  # to the reference; limits, springs and motors are not


class Mechanism:
    """Grows by `body` and `joint`; places and axes are given in the world, as all is at the start."""

    def __init__(self, gravity=GRAVITY, loads=None):
        self.gravity, self.loads = np.asarray(gravity, dtype=float), loads
        self.parts: list[Part] = []
        self.links: list[Link] = []

    def body(
        self, name, position, rotation=ZERO, mass=1.0, inertia=(0.02, 0.03, 0.04), center=ZERO, v=ZERO, w=ZERO,
        drive=None, **extra,
    ):  # fmt: skip
        """``v`` [m/s] of the centre of mass and ``w`` [rad/s] are changed to what the joints allow."""
        inertia = np.asarray(inertia, dtype=float)
        inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        arrays = [np.asarray(a, dtype=float) for a in (position, turn(np.asarray(rotation, dtype=float)), center, v, w)]
        self.parts.append(Part(name, mass, inertia, *arrays, np.asarray(rotation, dtype=float), extra, drive))

    def number(self, name: str | None) -> int | None:
        return None if name is None else [p.name for p in self.parts].index(name)

    def local(self, name: str | None, place: np.ndarray) -> np.ndarray:
        """A place of the world in the body's own frame."""
        if name is None:
            return np.asarray(place, dtype=float)
        part = self.parts[self.number(name)]
        return part.R.T @ (np.asarray(place) - part.position)

    def direction(self, name: str | None, axis: np.ndarray) -> np.ndarray:
        return np.asarray(axis, dtype=float) if name is None else self.parts[self.number(name)].R.T @ axis

    def joint(
        self, type, name, a, b=None, at=ZERO, rows=None, axis=Z, axis_a=None, at_b=None, rolling=False, x_a=None,
        known=True, **fields,
    ):  # fmt: skip
        """Body ``a`` is body1, ``b`` body0 (None: the world); ``at`` (on b: ``at_b``), ``axis`` of b, ``axis_a`` of a.

        ``fields`` go to the library as they are; the place, and the axis of the named joints, are filled in here.
        A joint that is not ``known`` to the reference is no joint there.
        """
        at = np.asarray(at, dtype=float)
        at_b = at if at_b is None else np.asarray(at_b, dtype=float)
        fields = {"body1": a, "local_pos0": self.local(b, at_b), "local_pos1": self.local(a, at), **fields}
        if b is not None:
            fields["body0"] = b
        if type in ("revolute", "prismatic", "cylindrical", "planar", "cone_twist", "point_to_ring"):
            fields["axis"] = self.direction(b, axis)
        axis_a = axis if axis_a is None else axis_a
        if type == "universal":
            fields |= {"axis0": self.direction(b, axis), "axis1": self.direction(a, axis_a)}
        if rows is None:
            rows = getattr(joint_rows, type)
        i, j = self.number(a), self.number(b)
        pa, pb = self.local(a, at), self.local(b, at_b)
        fa, fb = frame_of(axis_a, x_a), frame_of(axis)
        pa = pa - self.parts[i].center
        fa = self.parts[i].R.T @ fa
        if j is not None:
            pb, fb = pb - self.parts[j].center, self.parts[j].R.T @ fb
        self.links.append(Link(type, fields, Joint(name, i, j, rows, pa, pb, fa, fb, rolling), known))

    def system(self, rank: float = 1e-9) -> System:
        """The reference; it also makes the velocities of the parts consistent."""
        bodies = [Body(p.mass, p.inertia, p.x, p.R, p.v, p.w, p.drive) for p in self.parts]
        system = System(bodies, [link.joint for link in self.links if link.known], self.gravity, self.loads, rank)
        system.start_consistently()
        for part, body in zip(self.parts, system.bodies, strict=True):
            part.v, part.w = body.v, body.w
        return system

    def scene(self, **fields) -> turnbuckle.Scene:
        """The library's scene."""
        self.system()
        scene = turnbuckle.Scene("mechanism", gravity=self.gravity, **fields)
        for p in self.parts:
            motion = {} if p.drive is not None else {"velocity": p.v, "angular_velocity": p.w}
            mass = {"mass": p.mass, "inertia": p.inertia, "center": p.center}
            shape = {} if any(s in p.extra for s in ("sphere", "box", "cylinder")) else {"box": [0.1, 0.1, 0.1]}
            given = {"position": p.position, "rotation": p.rotation, **shape, **mass, **motion, **p.extra}
            scene.add_rigid(p.name, **given)
        for link in self.links:
            scene.add_joint(link.type, link.joint.name, **link.fields)
        return scene

    def simulation(self, **fields) -> turnbuckle.Simulation:
        return turnbuckle.Simulation(self.scene(**fields))

    # Comparing -----------------------------------------------------------------------------------------------------

    def places(self, simulation) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Centre of mass, rotation matrix, v, w of each body in the library."""
        out = []
        for p in self.parts:
            position, q = simulation.pose(p.name)
            r = matrix_of(q)
            v, w = simulation.velocity(p.name)
            out.append((np.asarray(position) + r @ p.center, r, np.asarray(v), np.asarray(w)))
        return out

    def errors(self, simulation, y: np.ndarray, t: float, system: System, size: float = 1.0) -> dict[str, float]:
        """Largest differences from a state of the reference: place [m or rad], speed, force [N], torque [N m].

        ``size`` [m] turns radians into metres.
        """
        x, r, v, w = system.unpack(y, t)
        out = {"place": 0.0, "speed": 0.0, "force": 0.0, "torque": 0.0}
        for i, (xs, rs, vs, ws) in enumerate(self.places(simulation)):
            out["place"] = max(out["place"], float(np.linalg.norm(xs - x[i])), size * angle_between(rs, r[i]))
            out["speed"] = max(out["speed"], float(np.linalg.norm(vs - v[i])), size * float(np.linalg.norm(ws - w[i])))
        for name, (force, torque) in system.reactions(y, t).items():
            f, m = simulation.reaction(name)
            out["force"] = max(out["force"], float(np.linalg.norm(f - force)))
            out["torque"] = max(out["torque"], float(np.linalg.norm(m - torque)))
        return out

    def state_of(self, simulation) -> np.ndarray:
        """The library's state in the layout of the reference, to measure with the reference."""
        places = self.places(simulation)
        return np.concatenate([np.concatenate([np.ravel(p[k]) for p in places]) for k in range(4)])


def run(simulation, duration: float, n: int, each=None) -> None:
    """``n`` equal steps; ``each(report)`` after every one. A degraded or failed step is an error."""
    h = duration / n
    for _ in range(n):
        report = simulation.step(h)
        assert report.status == "ok", report.messages
        if each is not None:
            each(report)
