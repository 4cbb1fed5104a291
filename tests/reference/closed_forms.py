"""Solutions that need no time stepping: hanging chains, a spring and a mass, a pendulum."""

import math

import numpy as np


def hanging_rope(masses: np.ndarray, rests: np.ndarray, stiffness: np.ndarray, gravity: float) -> np.ndarray:
    """Depth [m] of each point below the upper end, which is held; spring k joins points k and k + 1.

    Spring k carries all that hangs below it: stretch = gravity * sum(masses[k + 1:]) / stiffness[k].
    """
    below = np.cumsum(masses[::-1])[::-1][1:]
    return np.concatenate([[0.0], np.cumsum(rests + gravity * below / stiffness)])


def hanging_chain(
    span: np.ndarray, masses: np.ndarray, rests: np.ndarray, stiffness: np.ndarray, gravity: float
) -> np.ndarray:
    """Discrete catenary: points (n, 2) of a chain of n - 1 springs from (0, 0) to ``span``, y up, both ends held.

    Statics, not energies: the horizontal tension H is the same in every link and the vertical one falls by the weight
    of each point passed, so link k points along (H, V_k) and is rests[k] + |(H, V_k)| / stiffness[k] long. Two
    unknowns (H, V_0) are found such that the links end at ``span``, by Newton with a halved step.
    """
    weights = gravity * np.asarray(masses)

    def points(h: float, v0: float) -> np.ndarray:
        vertical = v0 + np.concatenate([[0.0], np.cumsum(weights[1:-1])])
        tension = np.hypot(h, vertical)
        size = (rests + tension / stiffness) / tension
        return np.concatenate([[[0.0, 0.0]], np.cumsum(np.stack([size * h, size * vertical], axis=1), axis=0)])

    unknown = np.array([0.5 * weights[1:-1].sum(), -0.5 * weights[1:-1].sum()])
    for _ in range(200):
        gap = points(*unknown)[-1] - span
        if np.linalg.norm(gap) < 1e-14 * np.linalg.norm(span):
            break
        jacobian = np.zeros((2, 2))
        for column in range(2):
            step = 1e-6 * max(1.0, np.abs(unknown).max())
            shift = step * np.eye(2)[column]
            jacobian[:, column] = (points(*(unknown + shift))[-1] - points(*(unknown - shift))[-1]) / (2 * step)
        full = np.linalg.solve(jacobian, -gap)
        size = 1.0
        while size > 1e-10 and (
            unknown[0] + size * full[0] <= 0.0
            or np.linalg.norm(points(*(unknown + size * full))[-1] - span) > np.linalg.norm(gap)
        ):
            size *= 0.5
        if size <= 1e-10:
            break
        unknown = unknown + size * full
    return points(*unknown)


def equilibrium(
    x: np.ndarray,
    held: list[int],
    springs: list[tuple[int, int]],
    rests: np.ndarray,
    stiffness: np.ndarray,
    weights: np.ndarray,
    iterations: int = 500,
) -> np.ndarray:
    """Static positions (n, d) of points and springs under the forces ``weights`` (n, d) [N], by Newton on the energy.

    The Hessian of a compressed spring is not positive; its negative part is left out, and the step is halved until
    the energy falls.
    """
    x = np.array(x, dtype=float)
    n, dim = x.shape
    free = np.setdiff1d(np.arange(n), held)
    index = (free[:, None] * dim + np.arange(dim)).ravel()

    def energy(y: np.ndarray) -> float:
        total = -np.sum(weights * y)
        for (i, j), rest, s in zip(springs, rests, stiffness, strict=True):
            total += 0.5 * s * (np.linalg.norm(y[j] - y[i]) - rest) ** 2
        return total

    for _ in range(iterations):
        gradient, hessian = -weights.copy(), np.zeros((n * dim, n * dim))
        for (i, j), rest, s in zip(springs, rests, stiffness, strict=True):
            size = np.linalg.norm(x[j] - x[i])
            u = (x[j] - x[i]) / size
            gradient[j] += s * (size - rest) * u
            gradient[i] -= s * (size - rest) * u
            block = s * np.outer(u, u) + s * max(0.0, 1.0 - rest / size) * (np.eye(dim) - np.outer(u, u))
            for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                hessian[a * dim : (a + 1) * dim, b * dim : (b + 1) * dim] += sign * block
        g = gradient.ravel()[index]
        if np.abs(g).max() < 1e-13 * np.abs(weights).sum():
            break
        step = np.zeros(n * dim)
        step[index] = np.linalg.solve(hessian[np.ix_(index, index)] + 1e-12 * np.eye(len(index)), -g)
        step, size, start = step.reshape(n, dim), 1.0, energy(x)
        while size > 1e-8 and energy(x + size * step) > start + 1e-14 * abs(start):
            size *= 0.5
        x = x + size * step
    return x


def damped_oscillator(x0: float, v0: float, omega2: float, gamma: float, t: float) -> tuple[float, float]:
    """(x, v) at time t of x'' = -omega2 x - gamma v, below critical damping."""
    decay, w = gamma / 2, math.sqrt(omega2 - gamma**2 / 4)
    a, b = x0, (v0 + decay * x0) / w
    fade, c, s = math.exp(-decay * t), math.cos(w * t), math.sin(w * t)
    x = fade * (a * c + b * s)
    return x, -decay * x + fade * w * (b * c - a * s)


def pendulum_period(length: float, gravity: float, amplitude: float) -> float:
    """Period [s] of a rigid pendulum with ``amplitude`` [rad] < pi, by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(amplitude / 2)
    while abs(a - b) > 1e-16 * a:
        a, b = (a + b) / 2, math.sqrt(a * b)
        if abs(a - b) <= 4e-16 * a:
            break
    return 2 * math.pi * math.sqrt(length / gravity) / a


def kinetic_energy(v: np.ndarray, m: np.ndarray) -> float:
    """[J]"""
    return float(0.5 * np.sum(m[:, None] * v * v))


def gravity_energy(x: np.ndarray, m: np.ndarray, gravity: np.ndarray) -> float:
    """[J], zero at the origin; ``gravity`` is the acceleration vector [m/s^2]."""
    return float(-np.sum(m[:, None] * x * np.asarray(gravity)))
