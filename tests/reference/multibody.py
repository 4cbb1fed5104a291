"""Rigid bodies and joints in maximal coordinates: Newton-Euler with Lagrange multipliers of accelerations, all dense.

Each joint is a function of the poses of two bodies (`joint_rows.py`) and nothing more. From it come, without any formula of
its own, the Jacobian by complex steps (J u = Im phi(q + i e u) / e) and the part of the acceleration that velocities make,
gamma = d^2 phi / ds^2 along q(s) with constant velocities, by Cauchy's integral on a circle of complex s. Then

    [M  -J^T] [a     ]   [f - gyroscopic]
    [J   0  ] [lambda] = [-gamma        ]

is solved by least squares, so that redundant rows do no harm, and integrated with DOP853 at 1e-12. Nothing pulls the joints
together: what they drift is a measure of the error.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

from reference.joint_rows import Rows

GRAVITY = np.array([0.0, 0.0, -9.81])
STEP = 1e-30
CIRCLE = np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16)


def skew(w: np.ndarray) -> np.ndarray:
    """[w]x of (..., 3), so that [w]x r = w x r."""
    w = np.asarray(w)
    out = np.zeros((*w.shape[:-1], 3, 3), dtype=w.dtype)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    return out


def turn(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector [rad], real or complex, shape (..., 3): Rodrigues' formula."""
    v = np.asarray(vector)
    angle = np.sqrt((v * v).sum(-1))[..., None, None]
    safe = np.where(np.abs(angle) < 1e-8, 1.0, angle)
    a = np.where(np.abs(angle) < 1e-8, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(np.abs(angle) < 1e-8, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    k = skew(v)
    return np.eye(3) + a * k + b * (k @ k)


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion xyzw of any length."""
    x, y, z, w = np.asarray(q, dtype=float) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def angle_between(r: np.ndarray, s: np.ndarray) -> float:
    """Angle of the rotation from one matrix to another [rad], exact also where it is tiny."""
    return float(2.0 * np.arcsin(min(np.linalg.norm(r - s) / np.sqrt(8.0), 1.0)))


@dataclass
class Body:
    """x [m], rotation R (3, 3), v [m/s] of the centre of mass, w [rad/s] in world axes; inertia (3, 3) in body axes.

    ``drive``: t -> (x, R, v, w, a, alpha) of a body that is led; it feels nothing.
    """

    mass: float
    inertia: np.ndarray
    x: np.ndarray
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    v: np.ndarray = field(default_factory=lambda: np.zeros(3))
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))
    drive: Callable | None = None


@dataclass(frozen=True)
class Joint:
    """Rows between body ``a`` (with the point) and body ``b`` (with the domain), None for the world.

    ``pa``, ``pb``: the point in each body, from its centre of mass [m]; ``fa``, ``fb``: a frame in each.
    """

    name: str
    a: int
    b: int | None
    rows: Rows
    pa: np.ndarray
    pb: np.ndarray
    fa: np.ndarray
    fb: np.ndarray
    rolling: bool = False  # rows are rates (of velocities) instead of places


Loads = Callable[[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


class System:
    """Bodies, joints, gravity, and further ``loads``: (t, x, R, v, w) -> forces (n, 3) and torques (n, 3) on bodies.

    ``rank``: singular values below this part of the largest count as zero. Loops in space that are redundant by their
    shape need it above the drift.
    """

    def __init__(self, bodies, joints=(), gravity=GRAVITY, loads: Loads | None = None, rank: float = 1e-9):
        self.bodies, self.joints = list(bodies), list(joints)
        self.gravity, self.loads, self.rank = np.asarray(gravity, dtype=float), loads, rank
        self.mass = np.array([b.mass for b in bodies])
        self.inertia = np.array([b.inertia for b in bodies], dtype=float)

    @property
    def count(self) -> int:
        return len(self.bodies)

    # State: y = x (3n), R (9n), v (3n), w (3n) ---------------------------------------------------------------------

    def pack(self) -> np.ndarray:
        parts = [[getattr(b, k).ravel() for b in self.bodies] for k in ("x", "R", "v", "w")]
        return np.concatenate([np.concatenate(p) for p in parts])

    def unpack(self, y: np.ndarray, t: float = 0.0):
        n = self.count
        x, r = y[: 3 * n].reshape(n, 3).copy(), y[3 * n : 12 * n].reshape(n, 3, 3).copy()
        v, w = y[12 * n : 15 * n].reshape(n, 3).copy(), y[15 * n :].reshape(n, 3).copy()
        for i, b in enumerate(self.bodies):
            if b.drive is not None:
                x[i], r[i], v[i], w[i] = b.drive(t)[:4]
        return x, r, v, w

    # Rows ----------------------------------------------------------------------------------------------------------

    def _samples(self, i: int | None, at: int, radius: float, x, r, v, w):
        """Poses of a body, complex: a step along each of the 12 directions of its joint, then the circle for gamma."""
        batch = 12 + len(CIRCLE)
        if i is None:
            return np.zeros((batch, 3), complex), np.tile(np.eye(3, dtype=complex), (batch, 1, 1))
        xs, rs = np.tile(x[i].astype(complex), (batch, 1)), np.tile(r[i].astype(complex), (batch, 1, 1))
        xs[at : at + 3] += 1j * STEP * np.eye(3)
        rs[at + 3 : at + 6] += 1j * STEP * (skew(np.eye(3)) @ r[i])
        s = CIRCLE[:, None] * radius
        xs[12:] = x[i] + s * v[i]
        rs[12:] = turn(s * w[i]) @ r[i]
        return xs, rs

    def _joint(self, joint: Joint, x, r, v, w):
        """phi (k,), Jacobian (k, 12) and gamma (k,) of one joint; phi of rolling is its rate."""
        a, b = joint.a, joint.b
        radius = 0.3 / max([1.0, *(np.linalg.norm(w[i]) for i in (a, b) if i is not None)])
        xa, ra = self._samples(a, 0, radius, x, r, v, w)
        xb, rb = self._samples(b, 6, radius, x, r, v, w)
        arms = ra @ joint.pa, rb @ joint.pb
        pose = xa + arms[0], ra @ joint.fa, xb + arms[1], rb @ joint.fb
        if not joint.rolling:
            phi = joint.rows(*pose)
            gamma = 2.0 * (phi[12:] / CIRCLE[:, None] ** 2).mean(0).real / radius**2
            return phi[0].real, phi[:12].imag.T / STEP, gamma
        unit = np.eye(12)
        speeds = np.concatenate([np.concatenate([v[i], w[i]]) if i is not None else np.zeros(6) for i in (a, b)])
        u = np.concatenate([unit, np.tile(speeds, (len(CIRCLE), 1))]).astype(complex)
        for k in range(4):  # the Jacobian is taken at the pose itself
            pose[k][:12] = pose[k][:12].real
        rate = joint.rows(
            *pose, u[:, :3] + np.cross(u[:, 3:6], arms[0]), u[:, 3:6], u[:, 6:9] + np.cross(u[:, 9:], arms[1]), u[:, 9:]
        )
        jac = rate[:12].real.T
        return jac @ speeds, jac, (rate[12:] / CIRCLE[:, None]).mean(0).real / radius

    def rows(self, x, r, v, w):
        """phi, J (rows, 6n) and gamma of all joints, and where each joint's rows begin."""
        n, begins = self.count, [0]
        values, jacobians, gammas = [np.zeros(0)], [np.zeros((0, 6 * n))], [np.zeros(0)]
        for joint in self.joints:
            phi, local, gamma = self._joint(joint, x, r, v, w)
            jac = np.zeros((len(phi), 6 * n))
            jac[:, 6 * joint.a : 6 * joint.a + 6] = local[:, :6]
            if joint.b is not None:
                jac[:, 6 * joint.b : 6 * joint.b + 6] = local[:, 6:]
            values.append(phi)
            jacobians.append(jac)
            gammas.append(gamma)
            begins.append(begins[-1] + len(phi))
        return np.concatenate(values), np.concatenate(jacobians), np.concatenate(gammas), begins

    def mass_matrix(self, r) -> np.ndarray:
        """(6n, 6n), velocities v, w of each body after each other."""
        out = np.zeros((6 * self.count, 6 * self.count))
        for i in range(self.count):
            out[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = self.mass[i] * np.eye(3)
            out[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = r[i] @ self.inertia[i] @ r[i].T
        return out

    # Motion --------------------------------------------------------------------------------------------------------

    def solve(self, t: float, x, r, v, w):
        """Accelerations (n, 6), multipliers, Jacobian, begins."""
        n = self.count
        _, jac, gamma, begins = self.rows(x, r, v, w)
        matrix = self.mass_matrix(r)
        force = np.zeros((n, 6))
        force[:, :3] = self.mass[:, None] * self.gravity
        if self.loads is not None:
            f, torque = self.loads(t, x, r, v, w)
            force[:, :3] += f
            force[:, 3:] += torque
        for i in range(n):
            spin = matrix[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] @ w[i]
            force[i, 3:] -= np.cross(w[i], spin)
        led = np.zeros(6 * n, dtype=bool)
        a = np.zeros(6 * n)
        for i, b in enumerate(self.bodies):
            if b.drive is not None:
                led[6 * i : 6 * i + 6] = True
                a[6 * i : 6 * i + 6] = np.concatenate(b.drive(t)[4:6])
        free = ~led
        gamma = gamma + jac @ a
        m, j, f = matrix[np.ix_(free, free)], jac[:, free], force.ravel()[free]
        # With M^-1 = W^T W and G = J W^T: a = M^-1 f + W^T z where G z = -gamma - J M^-1 f, and then G^T lambda = z.
        root = np.linalg.inv(np.linalg.cholesky(m))
        alone = np.linalg.solve(m, f)
        g = j @ root.T
        z = np.linalg.lstsq(g, -gamma - j @ alone, rcond=self.rank)[0]
        a[free] = alone + root.T @ z
        multipliers = np.linalg.lstsq(g.T, z, rcond=self.rank)[0]
        return a.reshape(n, 6), multipliers, jac, begins

    def derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        x, r, v, w = self.unpack(y, t)
        a, *_ = self.solve(t, x, r, v, w)
        return np.concatenate([v.ravel(), (skew(w) @ r).ravel(), a[:, :3].ravel(), a[:, 3:].ravel()])

    def simulate(self, times, rtol: float = 1e-12, atol: float = 1e-13) -> np.ndarray:
        """States (len(times), 18 n) at increasing times [s] from time 0."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        y0 = self.pack()
        out = solve_ivp(self.derivative, (0.0, times[-1]), y0, "DOP853", times, rtol=rtol, atol=atol)
        assert out.success, out.message
        return out.y.T

    # What is measured ----------------------------------------------------------------------------------------------

    def reactions(self, y: np.ndarray, t: float = 0.0) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Force [N] and torque [N m] on body a of each joint, about the joint's point in body a, world axes."""
        x, r, v, w = self.unpack(y, t)
        _, lam, jac, begins = self.solve(t, x, r, v, w)
        out = {}
        for k, joint in enumerate(self.joints):
            part = slice(begins[k], begins[k + 1])
            wrench = jac[part, 6 * joint.a : 6 * joint.a + 6].T @ lam[part]
            arm = r[joint.a] @ joint.pa
            out[joint.name] = wrench[:3], wrench[3:] - np.cross(arm, wrench[:3])
        return out

    def energy(self, y: np.ndarray, t: float = 0.0) -> float:
        """Kinetic and gravity energy of the bodies that are not led [J]."""
        x, r, v, w = self.unpack(y, t)
        total = 0.0
        for i, b in enumerate(self.bodies):
            if b.drive is None:
                body_w = r[i].T @ w[i]
                total += 0.5 * b.mass * v[i] @ v[i] + 0.5 * body_w @ b.inertia @ body_w - b.mass * self.gravity @ x[i]
        return float(total)

    def momentum(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linear [kg m/s] and angular [kg m^2/s] about the origin."""
        x, r, v, w = self.unpack(y)
        spin = [r[i] @ self.inertia[i] @ r[i].T @ w[i] for i in range(self.count)]
        p = self.mass[:, None] * v
        return p.sum(0), np.cross(x, p).sum(0) + np.sum(spin, axis=0)

    def residual(self, y: np.ndarray, t: float = 0.0) -> tuple[float, float]:
        """Largest |phi| and |J u| of all rows."""
        x, r, v, w = self.unpack(y, t)
        phi, jac, _, _ = self.rows(x, r, v, w)
        rate = jac @ np.concatenate([v, w], axis=1).ravel()
        return float(np.abs(phi).max(initial=0.0)), float(np.abs(rate).max(initial=0.0))

    def start_consistently(self) -> None:
        """Change the velocities of the bodies by the least (in kinetic energy) that the joints allow."""
        x, r, v, w = self.unpack(self.pack())
        _, jac, _, _ = self.rows(x, r, v, w)
        free = np.repeat([b.drive is None for b in self.bodies], 6)
        root = np.linalg.inv(np.linalg.cholesky(self.mass_matrix(r)[np.ix_(free, free)]))
        u = np.concatenate([v, w], axis=1).ravel()
        u[free] -= root.T @ np.linalg.lstsq(jac[:, free] @ root.T, jac @ u, rcond=self.rank)[0]
        for b, speed in zip(self.bodies, u.reshape(-1, 6), strict=True):
            if b.drive is None:
                b.v, b.w = speed[:3], speed[3:]
