"""How large a step an explicit scheme takes for the stiffness of a model.

Every energy here is E = k C^2 / 2 of a C with gradient g (corotational tetrahedra have seven of them, six strains and
their trace), so stiffness and damping matrices share rows: K = sum k g g^T and D = sum k_d g g^T (K without the part of
the stress, zero at rest). With the masses, the fastest vibration is omega^2 = lambda_max(M^-1/2 K M^-1/2) and the
strongest damping gamma = lambda_max(M^-1/2 D M^-1/2).

* Verlet and its kin on x'' = -omega^2 x - gamma x': z^2 - (2 - gamma h - omega^2 h^2) z + 1 - gamma h has its roots in
  the unit circle while omega^2 h^2 + 2 gamma h < 4.
* Explicit Euler turns each vibration up by (h omega)^2 / 2 a step, midpoint and Heun by (h omega)^4 / 8, damping turns
  it down by h gamma / 2.
* RK4 holds while h |lambda| is below 2.78 on the real axis and 2.83 on the imaginary one, lambda the rate of a mode:
  omega, or when gamma > 2 omega the real root (gamma + (gamma^2 - 4 omega^2)^(1/2)) / 2.
* Implicit Euler and Newmark (average acceleration) have no limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from turnbuckle.bodies.corotational_stiffness import corotational_rows
from turnbuckle.bodies.hinge_hessian import bends
from turnbuckle.data.model import Model

LEAPFROG = ("verlet", "velocity_verlet", "beeman", "euler_cromer")
GROWTH_LIMIT = 2.0  # factors of e that a vibration may grow in a run before we warn


@dataclass(frozen=True)
class Rows:
    """Mass-weighted gradients of all energies: `gradient` (rows, 3 points), with k [J] and k_d [J s] of each row."""

    gradient: sp.csr_array
    k: np.ndarray
    k_d: np.ndarray

    def largest(self, weights: np.ndarray) -> float:
        """Largest eigenvalue of sum weights g g^T, to about a percent; 0 where there is none above."""
        if len(weights) == 0 or not weights.any():
            return 0.0
        g, n = self.gradient, self.gradient.shape[1]
        transposed = g.T.tocsr()
        operator = LinearOperator((n, n), matvec=lambda u: transposed @ (weights * (g @ u.ravel())), dtype=np.float64)
        first = np.random.default_rng(0).standard_normal(n)  # seeded: the same answer every time
        try:
            found = eigsh(operator, k=1, which="LA", v0=first, tol=1e-2, maxiter=300, return_eigenvectors=False)
            return max(float(found[0]), 0.0)
        except ArpackNoConvergence:
            return 0.0


def energy_rows(model: Model, positions: np.ndarray) -> Rows:
    """The rows of a model at `positions` [m], shape (points, 3)."""
    springs, tets = model.springs, model.tetrahedra
    blocks, k, k_d = [], [], []
    held = model.mass <= 0.0  # points of rigid bodies: no energy moves them
    inverse_root = np.where(held, 0.0, 1.0 / np.sqrt(np.where(held, 1.0, model.mass)))

    def add(corners: np.ndarray, gradients: np.ndarray, stiffness: np.ndarray, damping: np.ndarray) -> None:
        count, size = corners.shape
        columns = (3 * corners[:, :, None].astype(np.int64) + np.arange(3)).reshape(count, 3 * size)
        starts = np.arange(0, 3 * size * count + 1, 3 * size)
        scaled = gradients * inverse_root[corners][:, :, None]
        shape = (count, 3 * len(model.mass))
        blocks.append(sp.csr_array((scaled.ravel(), columns.ravel(), starts), shape=shape))
        k.append(stiffness)
        k_d.append(damping)

    if len(springs.pairs):
        add(springs.pairs, _lengths(positions[springs.pairs], springs.length), springs.k, springs.k_d)
    if len(tets.corners):
        edge, face, cell = (tets.materials[m] for m in (tets.edge_material, tets.triangle_material, tets.material))
        add(tets.edges, _lengths(positions[tets.edges], tets.edge_length), edge[:, 0], edge[:, 3])
        add(tets.triangles, _areas(positions[tets.triangles], tets.triangle_area), face[:, 1], face[:, 4])
        add(tets.corners, _volumes(positions[tets.corners], tets.volume), cell[:, 2], cell[:, 5])
    if len(model.hinges.points):
        bent = bends(model.hinges, positions)
        add(bent.points, bent.g.reshape(-1, 4, 3), bent.k, bent.k_d)
    if len(model.corotational.corners):
        add(*corotational_rows(model.corotational, positions))
    if not blocks:
        return Rows(sp.csr_array((0, 3 * len(model.mass))), np.zeros(0), np.zeros(0))
    return Rows(sp.vstack(blocks, format="csr"), np.concatenate(k), np.concatenate(k_d))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def _lengths(x: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Gradient of (l - l0) / l0; x: (n, 2, 3)."""
    along = _unit(x[:, 1] - x[:, 0]) / rest[:, None]
    return np.stack([-along, along], axis=1)


def _areas(x: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Gradient of (A - A0) / A0 with A = n . (a x b) / 2; x: (n, 3, 3)."""
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    normal = _unit(np.cross(a, b))
    second, third = np.cross(b, normal), np.cross(normal, a)
    return np.stack([-second - third, second, third], axis=1) / (2.0 * rest[:, None, None])


def _volumes(x: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Gradient of (V - V0) / V0 with V = (a x b) . c / 6; x: (n, 4, 3)."""
    a, b, c = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
    second, third, fourth = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    return np.stack([-second - third - fourth, second, third, fourth], axis=1) / (6.0 * rest[:, None, None])


def step_warning(model: Model, positions: np.ndarray, dt: float, duration: float) -> str | None:
    """A sentence where `dt` [s] is too large for the model's scheme in a run of `duration` [s], else None."""
    scheme = model.integrator
    if scheme in ("implicit_euler", "newmark"):
        return None
    rows = energy_rows(model, positions)
    if scheme in LEAPFROG and rows.largest(dt * dt * rows.k + 2.0 * dt * rows.k_d) < 4.0:
        return None
    omega2, gamma = rows.largest(rows.k), rows.largest(rows.k_d)
    if omega2 == 0.0 and gamma == 0.0:
        return None
    if scheme in LEAPFROG:
        limit = _leapfrog_limit(omega2, gamma)
    elif scheme == "rk4":
        limit = 2.78 / max(_decay(omega2, gamma), omega2**0.5 if gamma * gamma < 4.0 * omega2 else 0.0)
    else:
        growth = _growth(scheme, rows, omega2, dt) * duration / dt
        if growth > GROWTH_LIMIT:
            return (
                f"dt = {dt:g} s is too large for the stiffness: {scheme} lets the fastest vibration "
                f"({omega2**0.5 / (2 * np.pi):.4g} Hz) grow by a factor of e^{growth:.3g} in {duration:g} s; "
                "take a smaller step, more damping, or another integrator"
            )
        decay = _decay(omega2, gamma)
        limit = 2.0 / decay if decay > 0.0 else np.inf
    if dt < limit:
        return None
    return (
        f"dt = {dt:g} s is too large for the stiffness: {scheme} holds up to about {limit:.3g} s "
        f"(fastest vibration {omega2**0.5 / (2 * np.pi):.4g} Hz, strongest damping {gamma:.4g} 1/s)"
    )


def _leapfrog_limit(omega2: float, gamma: float) -> float:
    """The h of omega^2 h^2 + 2 gamma h = 4."""
    return 4.0 / (gamma + (gamma * gamma + 4.0 * omega2) ** 0.5)


def _decay(omega2: float, gamma: float) -> float:
    """The faster real root of s^2 - gamma s + omega^2 [1/s]; 0 where the motion vibrates."""
    inside = gamma * gamma - 4.0 * omega2
    return 0.5 * (gamma + inside**0.5) if inside >= 0.0 else 0.0


def _growth(scheme: str, rows: Rows, omega2: float, dt: float) -> float:
    """Factors of e a step by which the fastest vibration grows; damping counts as far as every row has it."""
    stiff = rows.k > 0
    ratio = float(np.min(rows.k_d[stiff] / rows.k[stiff])) if stiff.any() else 0.0
    z2 = dt * dt * omega2
    grown = z2 / 2.0 if scheme == "explicit_euler" else z2 * z2 / 8.0
    return grown - dt * ratio * omega2 / 2.0
