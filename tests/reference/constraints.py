"""Constraint forces of Local, section 4, by solving the printed equations literally, and dense global solves.

The free positions ``x_free`` [m] are those of a step without constraint forces, (n, 3); ``c`` [m/N], (n,), is the
response of the scheme: a force F on point i in this step moves its next position by ``c_i F``.
"""

import numpy as np


def position_response(scheme: str, m: np.ndarray, h: float) -> np.ndarray:
    """c_i [m/N] by scheme, derived in `test_reference_self.py` by a perturbation of the force (explicit schemes)."""
    factor = {
        "explicit_euler": 1.0,  # of the position one step later
        "euler_cromer": 1.0,
        "verlet": 1.0,
        "midpoint": 0.5,
        "rk2": 0.5,
        "rk4": 0.5,
        "velocity_verlet": 0.5,
        "beeman": 2.0 / 3.0,
    }[scheme]
    return factor * h**2 / np.asarray(m)


def nail_force(x_free: np.ndarray, c: np.ndarray, point: int, goal: np.ndarray) -> np.ndarray:
    """(12): goal = x_free + c F, unknown F, shape (3,)."""
    return np.linalg.solve(c[point] * np.eye(3), goal - x_free[point])


def points_to_point_forces(x_free: np.ndarray, c: np.ndarray, points: list[int]) -> np.ndarray:
    """(19) and (20): the forces add to zero, and all n points land at one place; shape (n, 3).

    Row 0 is (19), row i is ``c_0 F_0 - c_i F_i = x_i - x_0`` with the free positions of the next step.
    """
    n = len(points)
    matrix, right = np.zeros((n, n)), np.zeros((n, 3))
    scale = c[points[0]]
    matrix[0] = scale  # scaled like the other rows
    for row in range(1, n):
        matrix[row, 0] = c[points[0]]
        matrix[row, row] = -c[points[row]]
        right[row] = x_free[points[row]] - x_free[points[0]]
    return np.linalg.solve(matrix, right)


def attach_forces(x_free: np.ndarray, c: np.ndarray, point: int, hosts: list[int], weights: np.ndarray) -> np.ndarray:
    """(26) and (27): F_0 and the forces -alpha_i F_0 on the hosts as unknowns of one system; shape (1 + n, 3)."""
    n = 1 + len(hosts)
    matrix, right = np.zeros((n, n)), np.zeros((n, 3))
    matrix[0, 0] = c[point]  # x_0 + c_0 F_0 = sum_i alpha_i (x_i + c_i F_i)
    right[0] = -x_free[point]
    for row, (host, weight) in enumerate(zip(hosts, weights, strict=True), start=1):
        matrix[0, row] = -weight * c[host]
        right[0] += weight * x_free[host]
        matrix[row, 0] = weight  # F_i + alpha_i F_0 = 0
        matrix[row, row] = 1.0
    return np.linalg.solve(matrix, right)


def velocity_goal_force(v_free: np.ndarray, d: np.ndarray, point: int, goal: np.ndarray) -> np.ndarray:
    """goal = v_free + d F with the velocity response d_i [m/(N s)]."""
    return np.linalg.solve(d[point] * np.eye(3), goal - v_free[point])


def gradual(force: np.ndarray, j: int, n: int) -> np.ndarray:
    """Local, 4.5: in step j of n the part j / n of the force that would land; all of it afterwards."""
    return force * min(j, n) / n


def gradual_approach(n: int, steps: int) -> list[float]:
    """Offset from the goal of one free point after each step under (4.5), from 1 and at rest, Euler-Cromer or Verlet.

    With y = x - goal: y_free = y + h v, F = -(m / h^2) y_free, y+ = y_free - (j / n) y_free = (1 - j / n)(y + h v).
    """
    y, y_prev, out = 1.0, 1.0, []
    for j in range(1, steps + 1):
        y, y_prev = (1.0 - min(j, n) / n) * (2.0 * y - y_prev), y
        out.append(y)
    return out


def nail_row(n: int, point: int) -> np.ndarray:
    """Row of J of a nail, shape (1, n)."""
    return np.eye(n)[[point]]


def points_to_point_rows(n: int, points: list[int]) -> np.ndarray:
    """Rows of J of points to point, shape (len(points) - 1, n): each other point less the first."""
    return np.eye(n)[points[1:]] - np.eye(n)[[points[0]]]


def attach_row(n: int, point: int, hosts: list[int], weights: np.ndarray) -> np.ndarray:
    """Row of J of an attached point, shape (1, n)."""
    row = np.eye(n)[[point]]
    for host, weight in zip(hosts, weights, strict=True):
        row[0, host] -= weight
    return row


def multipliers(rows: np.ndarray, response: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """l of ``J diag(response) J^T l = wanted``, shape (r, 3): all rows together, dense."""
    return np.linalg.solve((rows * response) @ rows.T, wanted)


def land(x_free: np.ndarray, c: np.ndarray, rows: np.ndarray, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(x, constraint forces) with J x = goal, goal (r, 3)."""
    f = rows.T @ multipliers(rows, c, goal - rows @ x_free)
    return x_free + c[:, None] * f, f


def project_velocity(v: np.ndarray, m: np.ndarray, rows: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The velocity stage of RATTLE: the v nearest in kinetic energy with J v = rate."""
    return v + (rows.T @ multipliers(rows, 1.0 / m, rate - rows @ v)) / m[:, None]


def constrained_acceleration(f: np.ndarray, m: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(a, constraint forces) with J a = 0 from (J M^-1 J^T) l = -J M^-1 F."""
    reaction = rows.T @ multipliers(rows, 1.0 / m, -rows @ (f / m[:, None]))
    return (f + reaction) / m[:, None], reaction


def implicit_euler_step(
    x: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    k: np.ndarray,
    d: np.ndarray,
    m: np.ndarray,
    h: float,
    rows: np.ndarray,
    goal: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x, v, constraint forces) of (M - h D - h^2 K) dv = h (F + h K v) + h J^T l with J (x + h (v + dv)) = goal.

    Solved by a basis of the null space of J (where the rows put no force), not by a KKT matrix.
    """
    j = np.kron(rows, np.eye(3))
    a = np.diag(np.repeat(m, 3)) - h * d - h**2 * k
    b = h * (f.ravel() + h * k @ v.ravel())
    particular = np.linalg.lstsq(j, (goal.ravel() - j @ (x + h * v).ravel()) / h, rcond=None)[0]
    _, s, vt = np.linalg.svd(j)
    null = vt[len(s) :].T
    dv = particular + null @ np.linalg.solve(null.T @ a @ null, null.T @ (b - a @ particular))
    reaction = (a @ dv - b) / h
    v_new = v + dv.reshape(v.shape)
    return x + h * v_new, v_new, reaction.reshape(x.shape)
