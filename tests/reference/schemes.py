"""One step of each integrator as a plain function of arrays, for any force and any linear constraint.

``force(x, v, t)`` [N] takes and gives (n, 3) arrays, ``m`` [kg] is (n,), ``h`` [s] the step. Every scheme has the
signature ``scheme(x, v, memory, t, h, force, m) -> (x, v, memory)``; ``memory`` is None at the start.

A constraint is ``J x = g`` with constant ``J`` (rows, n) for each coordinate alike: a nail, points to point and an
attached point are all of this form. From a start that fulfils it, a constrained scheme is the scheme applied to the
forces plus those constraint forces that give ``J a = 0``: `constrained_force`. The implicit schemes solve ``J`` and
``A`` together instead.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reference.energies import Force, jacobians

State = tuple[np.ndarray, np.ndarray, object]


def explicit_euler(x, v, memory, t, h, force, m, rows=None) -> State:
    a = force(x, v, t) / m[:, None]
    return x + h * v, v + h * a, None


def euler_cromer(x, v, memory, t, h, force, m, rows=None) -> State:
    v = v + h * force(x, v, t) / m[:, None]
    return x + h * v, v, None


def midpoint(x, v, memory, t, h, force, m, rows=None) -> State:
    xm = x + h / 2 * v
    vm = v + h / 2 * force(x, v, t) / m[:, None]
    return x + h * vm, v + h * force(xm, vm, t + h / 2) / m[:, None], None


def rk2(x, v, memory, t, h, force, m, rows=None) -> State:
    a1 = force(x, v, t) / m[:, None]
    x1, v1 = x + h * v, v + h * a1
    a2 = force(x1, v1, t + h) / m[:, None]
    return x + h / 2 * (v + v1), v + h / 2 * (a1 + a2), None


def rk4(x, v, memory, t, h, force, m, rows=None) -> State:
    def rate(time, y, u):
        return u, force(y, u, time) / m[:, None]

    x1, v1 = rate(t, x, v)
    x2, v2 = rate(t + h / 2, x + h / 2 * x1, v + h / 2 * v1)
    x3, v3 = rate(t + h / 2, x + h / 2 * x2, v + h / 2 * v2)
    x4, v4 = rate(t + h, x + h * x3, v + h * v3)
    return x + h / 6 * (x1 + 2 * x2 + 2 * x3 + x4), v + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), None


@dataclass(frozen=True)
class VerletMemory:
    x_prev: np.ndarray
    h: float


def verlet(x, v, memory, t, h, force, m, rows=None) -> State:
    """Local (2), (3) as printed; the start and a change of h make a new x_prev from the velocity at t."""
    a = force(x, v, t) / m[:, None]
    if memory is None:
        x_prev = x - h * v + h**2 / 2 * a
    elif memory.h != h:
        speed = (x - memory.x_prev) / memory.h + memory.h / 2 * a
        x_prev = x - h * speed + h**2 / 2 * a
    else:
        x_prev = memory.x_prev
    x_new = 2 * x - x_prev + h**2 * a
    return x_new, (x_new - x_prev) / (2 * h), VerletMemory(x, h)


def velocity_verlet(x, v, memory, t, h, force, m, rows=None) -> State:
    a = force(x, v, t) / m[:, None]
    x_new = x + h * v + h**2 / 2 * a
    a_new = force(x_new, v + h * a, t + h) / m[:, None]
    return x_new, v + h / 2 * (a + a_new), None


@dataclass(frozen=True)
class BeemanMemory:
    a_prev: np.ndarray
    h: float


def beeman(x, v, memory, t, h, force, m, rows=None) -> State:
    a = force(x, v, t) / m[:, None]
    a_prev = memory.a_prev if memory is not None and memory.h == h else a
    x_new = x + h * v + h**2 / 6 * (4 * a - a_prev)
    a_new = force(x_new, v + h * (3 * a - a_prev) / 2, t + h) / m[:, None]
    return x_new, v + h / 6 * (2 * a_new + 5 * a - a_prev), BeemanMemory(a, h)


def solve_with_rows(a: np.ndarray, b: np.ndarray, rows: np.ndarray | None, wanted: np.ndarray | None) -> np.ndarray:
    """u of ``A u = b + J^T l`` and ``J u = wanted``; A is (3n, 3n), b (n, 3), J (r, n), wanted (r, 3)."""
    if rows is None or len(rows) == 0:
        return np.linalg.solve(a, b.ravel()).reshape(b.shape)
    j = np.kron(rows, np.eye(3))
    kkt = np.block([[a, -j.T], [j, np.zeros((len(j), len(j)))]])
    return np.linalg.solve(kkt, np.concatenate([b.ravel(), wanted.ravel()]))[: b.size].reshape(b.shape)


def implicit_euler(x, v, memory, t, h, force, m, rows=None) -> State:
    k, d = jacobians(force, x, v, t)
    a = np.diag(np.repeat(m, 3)) - h * d - h**2 * k
    b = h * (force(x, v, t) + h * (k @ v.ravel()).reshape(v.shape))
    dv = solve_with_rows(a, b, rows, None if rows is None else -rows @ v)
    return x + h * (v + dv), v + dv, None


def newmark(x, v, memory, t, h, force, m, rows=None) -> State:
    """beta = 1/4, gamma = 1/2, by Newton's method; the acceleration remembered is that of (x, v)."""
    a = memory
    if a is None:
        a = constrained_force(force, m, rows)(x, v, t) / m[:, None]
    xp, vp = x + h * v + h**2 / 4 * a, v + h / 2 * a
    x, v, a_new = xp, vp, np.zeros_like(xp)
    for _ in range(12):
        k, d = jacobians(force, x, v, t + h)
        matrix = np.diag(np.repeat(m, 3)) - h / 2 * d - h**2 / 4 * k
        wanted = None if rows is None else -rows @ a_new
        a_new = a_new + solve_with_rows(matrix, force(x, v, t + h) - m[:, None] * a_new, rows, wanted)
        x, v = xp + h**2 / 4 * a_new, vp + h / 2 * a_new
    return x, v, constrained_force(force, m, rows)(x, v, t + h) / m[:, None]


Scheme = Callable[..., State]
EXPLICIT: dict[str, Scheme] = {
    f.__name__: f for f in (explicit_euler, euler_cromer, midpoint, rk2, verlet, velocity_verlet, beeman, rk4)
}
IMPLICIT: dict[str, Scheme] = {f.__name__: f for f in (implicit_euler, newmark)}
SCHEMES: dict[str, Scheme] = EXPLICIT | IMPLICIT
ORDER = {
    "explicit_euler": 1,
    "euler_cromer": 1,
    "midpoint": 2,
    "rk2": 2,
    "verlet": 2,  # of positions; the velocity of (2) is that of the step before, so of first order
    "velocity_verlet": 2,
    "beeman": 2,
    "implicit_euler": 1,
    "rk4": 4,
    "newmark": 2,
}


def constrained_force(force: Force, m: np.ndarray, rows: np.ndarray | None) -> Force:
    """``force`` plus J^T l with J a = 0, where M a is the sum: J M^-1 J^T l = -J M^-1 F."""
    if rows is None or len(rows) == 0:
        return force
    weighted = rows / m
    schur = weighted @ rows.T

    def total(x, v, t):
        f = force(x, v, t)
        return f - rows.T @ np.linalg.solve(schur, weighted @ f)

    return total


def run(name: str, x, v, force: Force, m, steps, rows: np.ndarray | None = None, t: float = 0.0):
    """(x, v) after the step sizes ``steps`` [s]; with ``rows`` J, from a start that fulfils J x = g and J v = 0."""
    memory = None
    if name in EXPLICIT:
        force = constrained_force(force, m, rows)
    for h in steps:
        x, v, memory = SCHEMES[name](x, v, memory, t, h, force, m, rows)
        t += h
    return x, v
