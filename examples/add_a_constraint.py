"""A constraint of one's own, whole: rigid rods between pairs of mass points.

Two points keep their distance, |d| = L with d = x_b - x_a. Opposite forces act along n, the direction of the rod at the start of
the step (directions of the end would cost energy). With the response x_i = x_i* + c_i F_i of the scheme (Local, 1) and
c_i = c / m_i, a force f moves the ends so that

    d = d* + s n,   s = c f (1 / m_a + 1 / m_b),   and |d| = L where   s = -n.d* + sqrt((n.d*)^2 - d*.d* + L^2).

This lands exactly, in one pass, since rods share no points. The forces sum to zero and lie along the rod. The velocity takes its
part of the same force, and then a multiplier of its own: n . (v_b - v_a) = 0 at the place that was reached (as RATTLE).
"""

import numpy as np
import warp as wp

import turnbuckle
from turnbuckle.compute import Program
from turnbuckle.data.state import D_OVER_C, INVERSE_C, INVERSE_H, MEMORY, Kinematics
from turnbuckle.math.types import real, vec3


@wp.kernel
def land_rods(
    begin: int,
    ends: wp.array(dtype=wp.vec2i),
    length: wp.array(dtype=real),
    mass: wp.array(dtype=real),
    params: wp.array(dtype=real),
    x_now: wp.array(dtype=vec3),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    force_out: wp.array(dtype=real),
):
    """Move both ends of each rod to its length, take the rate along it, and write the force that did it [N]."""
    r = begin + wp.tid()
    a, b = ends[r][0], ends[r][1]
    share_a, share_b = real(1.0) / mass[a], real(1.0) / mass[b]
    n = wp.normalize(x_now[b] - x_now[a])
    d = x[b] - x[a]
    along = wp.dot(n, d)
    s = (
        wp.sqrt(along * along - wp.dot(d, d) + length[r] * length[r]) - along
    )  # not a number: turned by more than can land
    push = n * (s / (share_a + share_b))
    x[a] = x[a] - push * share_a
    x[b] = x[b] + push * share_b
    v[a] = v[a] - push * (params[D_OVER_C] * share_a)
    v[b] = v[b] + push * (params[D_OVER_C] * share_b)
    if params[MEMORY] != real(0.0):  # Verlet's w = (x+ - x) / h
        w[a] = w[a] - push * (params[INVERSE_H] * share_a)
        w[b] = w[b] + push * (params[INVERSE_H] * share_b)
    n = wp.normalize(x[b] - x[a])
    slip = n * (-wp.dot(n, v[b] - v[a]) / (share_a + share_b))
    v[a] = v[a] - slip * share_a
    v[b] = v[b] + slip * share_b
    force_out[r] = s / (share_a + share_b) * params[INVERSE_C]


@wp.kernel
def project_rods(
    begin: int,
    ends: wp.array(dtype=wp.vec2i),
    mass: wp.array(dtype=real),
    turns: real,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    y: wp.array(dtype=vec3),
):
    """Give a rate ``y`` what keeps the rod: nothing along it for velocities, -|v|^2 / L for accelerations (``turns`` = 1)."""
    r = begin + wp.tid()
    a, b = ends[r][0], ends[r][1]
    share_a, share_b = real(1.0) / mass[a], real(1.0) / mass[b]
    d = x[b] - x[a]
    n = wp.normalize(d)
    u = v[b] - v[a]
    wanted = -turns * wp.dot(u, u) / wp.length(d)
    push = n * ((wanted - wp.dot(n, y[b] - y[a])) / (share_a + share_b))
    y[a] = y[a] - push * share_a
    y[b] = y[b] + push * share_b


class Rods:
    """Rods between pairs of mass points, (n, 2) numbers in the state, at the lengths that they have in ``x`` (points, 3) [m]."""

    def __init__(self, name: str, ends: np.ndarray, x: np.ndarray) -> None:
        self.name, self.points = name, np.ravel(ends)
        self._a, self._b = np.asarray(ends).T
        self._rest = np.linalg.norm(x[self._b] - x[self._a], axis=1)
        self.ends = wp.array(ends, dtype=wp.vec2i, device="cpu")
        self.length = wp.array(self._rest, dtype=wp.float64, device="cpu")
        self.force = wp.zeros_like(self.length)  # [N] that landed the last step, positive where it pushes

    def land(self, program: Program, mass: wp.array, params: wp.array, now: Kinematics, on: Kinematics) -> None:
        given = [self.ends, self.length, mass, params, now.x]
        program.launch(land_rods, len(self.ends), [*given, on.x, on.v, on.memory, self.force])

    def project(self, program: Program, mass: wp.array, at: Kinematics, y: wp.array, what: str) -> None:
        turns = real(1.0 if what == "acceleration" else 0.0)
        program.launch(project_rods, len(self.ends), [self.ends, mass, turns, at.x, at.v, y])

    def residual(self, x: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        d, u = x[self._b] - x[self._a], v[self._b] - v[self._a]
        length = np.sqrt((d * d).sum(axis=1))
        return float(np.abs(length - self._rest).max()), float(np.abs((d * u).sum(axis=1) / length).max())


def main() -> None:
    """A dumbbell is thrown: its middle flies as a stone does, and the rod carries m w^2 L / 2 of pull."""
    scene = turnbuckle.Scene("dumbbell", dt=1e-3, integrator="velocity_verlet")
    scene.add_rope("dumbbell", points=[[0, 0, 0], [0.4, 0, 0]], stretch_stiffness=0, mass=2)
    simulation = turnbuckle.Simulation(scene)
    simulation.stepper.add(Rods("rod", [[0, 1]], simulation.state.positions()))
    simulation.state.set_velocities(np.array([[0, 0, 1.0], [0, 0, 5.0]]))  # 3 m/s up, turning with 10 rad/s
    for _ in range(4):
        report = simulation.run(0.05)
        x = simulation.positions("dumbbell")
        middle, pull = x.mean(axis=0), -float(simulation.stepper.scratch.own[0].force.numpy()[0])
        print(
            f"{report.time:.2f} s: {report.status}, rod off by {report.position_residual['rod']:.0e} m, pulls {pull:.2f} N, "
        )
        print(f"        middle at {middle[2]:.5f} m, a stone at {3 * report.time - 4.905 * report.time**2:.5f} m")


if __name__ == "__main__":
    main()
