"""Models with one elastic body, and the assembled system taken apart, for tests of element forces and Jacobians."""

from dataclasses import dataclass

import numpy as np

import turnbuckle
from turnbuckle.bodies.implicit_system import ImplicitSystem
from turnbuckle.data.model import Model
from turnbuckle.meshes.shapes import box_tetrahedra, six_volumes


def model_of(body: dict, **scene) -> Model:
    """The model of a scene with one body."""
    fields = {"gravity": [0.0, 0.0, 0.0], "bodies": [{"name": "body", **body}], **scene}
    return turnbuckle.Simulation(turnbuckle.Scene("elastic", **fields)).model


def solid(vertices: np.ndarray, tetrahedra: np.ndarray, e: float = 100.0, nu: float = 0.3, **more) -> dict:
    """A corotational solid."""
    mesh = {"vertices": vertices, "tetrahedra": tetrahedra}
    return {"type": "solid", **mesh, "density": 1.0, "youngs_modulus": e, "poissons_ratio": nu, **more}


def wobbly_box(size: tuple, cells: tuple, amount: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """A box of tetrahedra whose inner points are off the grid by ``amount`` of a cell."""
    vertices, tetrahedra = box_tetrahedra(size, cells)
    cell = np.array(size) / np.array(cells)
    inner = ((vertices > 1e-9) & (vertices < np.array(size) - 1e-9)).all(axis=1)
    noise = np.random.default_rng(11).uniform(-1.0, 1.0, vertices.shape) * cell * amount
    vertices = vertices + np.where(inner[:, None], noise, 0.0)
    assert (six_volumes(vertices, tetrahedra) > 0).all()
    return vertices, tetrahedra


def random_rotation(seed: int) -> np.ndarray:
    """A rotation matrix."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


@dataclass
class Parts:
    """What the system says at (x, v). Matrices over points (3 n, 3 n)."""

    energy: float
    power: float
    elastic: np.ndarray  # (n, 3) force without damping
    damping: np.ndarray  # (n, 3) force of damping
    k: np.ndarray  # -dF/dx as assembled
    d: np.ndarray  # -dF/dv
    kv: np.ndarray  # (n, 3)


def take_apart(system: ImplicitSystem, x: np.ndarray, v: np.ndarray | None = None) -> Parts:
    """Forces and matrices, each alone."""
    n = len(x)
    v = np.zeros_like(x) if v is None else v
    mass = np.zeros((3 * n, 3 * n))
    np.fill_diagonal(mass, np.repeat(np.where(system.model.mass > 0.0, system.model.mass, 1.0), 3))
    k = system.assemble(x, v, 1.0, alpha=0.0, beta=1.0).toarray()[: 3 * n, : 3 * n] - mass
    force, kv = system.force[:n].copy(), system.push[:n].copy()
    energy, power = system.elastic_energy(), system.dissipation_power()
    d = system.assemble(x, np.zeros_like(v), 1.0, alpha=1.0, beta=0.0).toarray()[: 3 * n, : 3 * n] - mass
    elastic = system.force[:n].copy()
    return Parts(energy, power, elastic, force - elastic, k, d, kv)


def minus_gradient(system: ImplicitSystem, x: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """``-dE/dx`` by central differences (n, 3)."""
    out = np.zeros_like(x)
    for i in np.ndindex(*x.shape):
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * step
            system.assemble(moved, np.zeros_like(x), 1.0)
            ends.append(system.elastic_energy())
        out[i] = (ends[1] - ends[0]) / (2.0 * step)
    return out


def force_jacobian(system: ImplicitSystem, x: np.ndarray, v: np.ndarray, by: str, step: float = 1e-6) -> np.ndarray:
    """``-dF/dx`` or ``-dF/dv`` by central differences (3 n, 3 n)."""
    columns = []
    for i in np.ndindex(*x.shape):
        ends = []
        for sign in (1.0, -1.0):
            at, rate = x.copy(), v.copy()
            (at if by == "x" else rate)[i] += sign * step
            system.assemble(at, rate, 1.0)
            ends.append(system.force[: len(x)].ravel().copy())
        columns.append((ends[1] - ends[0]) / (2.0 * step))
    return np.array(columns).T
