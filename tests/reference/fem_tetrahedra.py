"""Linear tetrahedra by the book, slow and obvious: shape functions from a 4 x 4 inverse, B, K_e = V B^T D B, loops."""

import numpy as np


def rotation(f: np.ndarray) -> np.ndarray:
    """The nearest rotation to ``f`` by the singular value decomposition, determinant 1."""
    u, _, vt = np.linalg.svd(f)
    return u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt


def shape_gradients(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Gradients (4, 3) of the shape functions ``N_i(x_j) = delta_ij``, and the volume."""
    system = np.hstack([np.ones((4, 1)), corners])
    return np.linalg.inv(system)[1:].T, float(np.linalg.det(system)) / 6.0


def stiffness(corners: np.ndarray, e: float, nu: float) -> np.ndarray:
    """K_e (12, 12) in Voigt notation (xx, yy, zz, xy, yz, zx)."""
    gradients, volume = shape_gradients(corners)
    b = np.zeros((6, 12))
    for i, (x, y, z) in enumerate(gradients):
        b[:, 3 * i : 3 * i + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]]
    d = np.zeros((6, 6))
    d[:3, :3] = nu
    d[np.arange(3), np.arange(3)] = 1.0 - nu
    d[np.arange(3, 6), np.arange(3, 6)] = 0.5 - nu
    return volume * b.T @ (d * e / ((1.0 + nu) * (1.0 - 2.0 * nu))) @ b


def element(rest: np.ndarray, x: np.ndarray, e: float, nu: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Energy ``u^T K_e u / 2`` with ``u = R^T x - X``, forces (4, 3) ``-R K_e u``, and ``R K_e R^T``."""
    gradients, _ = shape_gradients(rest)
    r = rotation(x.T @ gradients)
    big = np.kron(np.eye(4), r)
    k = stiffness(rest, e, nu)
    u = big.T @ x.ravel() - rest.ravel()
    return 0.5 * u @ k @ u, -(big @ k @ u).reshape(4, 3), big @ k @ big.T


def assembled(rest: np.ndarray, corners: np.ndarray, x: np.ndarray, e: float, nu: float):
    """Energy, forces (points, 3) and stiffness (3 points, 3 points) of a mesh with rest positions ``rest``."""
    energy, force, k = 0.0, np.zeros_like(x), np.zeros((x.size, x.size))
    for t in corners:
        energy_t, force_t, k_t = element(rest[t], x[t], e, nu)
        energy += energy_t
        force[t] += force_t
        where = (3 * t[:, None] + np.arange(3)).ravel()
        k[np.ix_(where, where)] += k_t
    return energy, force, k


def lumped_mass(rest: np.ndarray, corners: np.ndarray, density: float) -> np.ndarray:
    """A quarter of each element's mass to each of its corners."""
    mass = np.zeros(len(rest))
    for t in corners:
        mass[t] += density * shape_gradients(rest[t])[1] / 4.0
    return mass
