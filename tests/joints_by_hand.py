"""Rigid bodies and joints as arrays, written by hand, for tests of solvers without a scene."""

from dataclasses import dataclass, field, fields

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data import rigid
from turnbuckle.data.rigid import DYNAMIC, FREE, IMMOBILE, Joint, JointParts, RigidBodies


@dataclass
class Mechanism:
    """Bodies and joints that grow by calls; body 0 is the world."""

    names: list[str] = field(default_factory=lambda: ["world"])
    motion: list[int] = field(default_factory=lambda: [IMMOBILE])
    mass: list[float] = field(default_factory=lambda: [0.0])
    inertia: list[np.ndarray] = field(default_factory=lambda: [np.zeros(3)])
    ability: list[float] = field(default_factory=lambda: [np.nan])
    x: list[np.ndarray] = field(default_factory=lambda: [np.zeros(3)])
    q: list[np.ndarray] = field(default_factory=lambda: [np.array([0.0, 0, 0, 1])])
    joints: list[Joint] = field(default_factory=list)
    rows: list[dict] = field(default_factory=list)

    def body(self, x, rotation=(0.0, 0, 0), mass=1.0, inertia=(0.1, 0.1, 0.1), motion=DYNAMIC, ability=np.nan) -> int:
        self.names.append(f"b{len(self.names)}")
        self.motion.append(motion)
        self.mass.append(mass)
        self.inertia.append(np.array(inertia, dtype=float))
        self.ability.append(ability)
        self.x.append(np.array(x, dtype=float))
        self.q.append(Rotation.from_rotvec(rotation).as_quat())
        return len(self.names) - 1

    def joint(self, a: int, b: int, *parts: dict, **more) -> Joint:
        joint = Joint(f"j{len(self.joints)}", "joint", a, b, np.arange(len(parts)) + len(self.rows), **more)
        for part in parts:
            self.rows.append({"joint": len(self.joints), "a": a, "b": b, **part})
        self.joints.append(joint)
        return joint

    def bodies(self) -> RigidBodies:
        n = len(self.names)
        columns = {
            "names": tuple(self.names), "motion": np.array(self.motion), "mass": np.array(self.mass),
            "inertia": np.array(self.inertia), "frame_x": np.zeros((n, 3)), "frame_q": np.tile([0.0, 0, 0, 1], (n, 1)),
            "damping": np.zeros((n, 2)), "ability_to_rotate": np.array(self.ability), "local": np.zeros((0, 3)),
            "begin": np.zeros(n, int), "end": np.zeros(n, int),
        }  # fmt: skip
        return RigidBodies(**{f.name: columns[f.name] for f in fields(RigidBodies) if f.name in columns})

    def parts(self) -> JointParts:
        def column(name: str, default) -> np.ndarray:
            return np.array([row.get(name, default) for row in self.rows])

        unit = (0.0, 0.0, 0.0, 1.0)
        return JointParts(
            kind=column("kind", 0), joint=column("joint", 0), a=column("a", 0), b=column("b", 0),
            p_a=column("p_a", (0.0, 0, 0)).reshape(-1, 3), p_b=column("p_b", (0.0, 0, 0)).reshape(-1, 3),
            q_a=column("q_a", unit).reshape(-1, 4), q_b=column("q_b", unit).reshape(-1, 4),
            lo=column("lo", -FREE).astype(float), hi=column("hi", FREE).astype(float),
            stiffness=column("stiffness", 0.0), damping=column("damping", 0.0), restitution=column("restitution", 0.0),
            target=column("target", 0.0), time_constant=column("time_constant", 0.0),
            max_force=column("max_force", FREE), domain=column("domain", -1),
        )  # fmt: skip

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.x), np.array(self.q)

    def place(self, x: np.ndarray, q: np.ndarray, body: int, local) -> np.ndarray:
        return x[body] + Rotation.from_quat(q[body]).apply(local)

    def inertias(self, q: np.ndarray) -> np.ndarray:
        r = Rotation.from_quat(q).as_matrix()
        return np.einsum("nij,nj,nkj->nik", r, np.array(self.inertia), r)


def ball(p_a=(0.0, 0, 0), p_b=(0.0, 0, 0)) -> dict:
    """Point to point."""
    return {"kind": rigid.POINT, "p_a": p_a, "p_b": p_b}


def along(z, x=None) -> np.ndarray:
    """The quaternion of a frame with the third axis along ``z`` (and the first along ``x``)."""
    z = np.asarray(z, float) / np.linalg.norm(z)
    x = np.eye(3)[np.argmin(np.abs(z))] if x is None else np.asarray(x, float)
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=1)).as_quat()


def rods(n: int, length: float = 1.0, thickness: float = 0.02, gap: float = 0.0, seed: int = 0) -> Mechanism:
    """A chain of rods along x on ball joints, thrown about by ``gap``; the first hangs on the world."""
    rng = np.random.default_rng(seed)
    m, half = Mechanism(), 0.5 * length
    thin, thick = thickness**2 / 6.0, (length**2 + thickness**2) / 12.0
    for i in range(n):
        place = [(i + 0.5) * length, 0, 0] + gap * rng.standard_normal(3)
        m.body(place, gap * rng.standard_normal(3), 1.0, (thin, thick, thick))
        m.joint(i + 1, i, ball((-half, 0, 0), (half if i else 0.0, 0, 0)))
    return m
