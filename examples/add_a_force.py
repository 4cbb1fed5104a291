"""A force of one's own, whole: points attract each other as stars do, with a softened 1/r potential.

    E = -G sum_{i<j} m_i m_j / sqrt(|x_j - x_i|^2 + s^2),   F_i = -dE/dx_i

A force field is a Python function of positions (n, 3) [m], velocities (n, 3) [m/s], time [s] and masses (n,) [kg] that returns
forces (n, 3) [N]. It is part of the scene, acts in every stage of every explicit scheme, and its work is in the report. Forces
that are always opposite in pairs keep both momenta.
"""

import numpy as np

import turnbuckle

G, SOFT = 1.0, 0.05  # [m^3/(kg s^2)], [m]


def potential(x: np.ndarray, mass: np.ndarray) -> complex:
    """The energy [J] of places x (n, 3) [m]; of complex places too, for the check below."""
    i, j = np.triu_indices(len(x), 1)
    d = x[j] - x[i]
    return -G * (mass[i] * mass[j] / np.sqrt((d * d).sum(axis=1) + SOFT**2)).sum()


def attraction(x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
    """Forces (n, 3) [N]."""
    d = x[None] - x[:, None]  # from i to j
    weight = G * mass[:, None] * mass[None] / ((d * d).sum(axis=2) + SOFT**2) ** 1.5
    return np.einsum("ij,ijd->id", weight, d)


def gradient_error(x: np.ndarray, mass: np.ndarray) -> float:
    """How far the force is from the gradient of the energy, by complex step: exact to round-off, no difference is taken."""
    force, worst, tiny = attraction(x, np.zeros_like(x), 0.0, mass), 0.0, 1e-200
    for i, d in np.ndindex(x.shape):
        moved = x.astype(complex)
        moved[i, d] += 1j * tiny
        worst = max(worst, abs(force[i, d] + potential(moved, mass).imag / tiny))
    return worst / float(np.abs(force).max())


def main() -> None:
    """Two stars on a circle about each other: a turn takes 2 pi sqrt((R^2 + s^2)^(3/2) / (G M))."""
    apart, mass = 1.0, 1.0
    scene = turnbuckle.Scene("stars", gravity=[0, 0, 0], dt=1e-3, integrator="velocity_verlet")
    scene.add_rope("stars", points=[[0, 0, 0], [apart, 0, 0]], stretch_stiffness=0, mass=2 * mass)
    scene.add_force("attraction", body="stars", callable=attraction)
    simulation = turnbuckle.Simulation(scene)
    turn = 2 * np.pi * np.sqrt((apart**2 + SOFT**2) ** 1.5 / (G * 2 * mass))
    speed = np.pi * apart / turn
    simulation.state.set_velocities(np.array([[0, -speed, 0], [0, speed, 0]]))
    x = simulation.positions("stars").copy()
    print(f"the force is minus the gradient of the energy to {gradient_error(x + 0.1 * np.eye(2, 3), np.ones(2)):.0e}")
    report = simulation.run(turn)
    back = np.abs(simulation.positions("stars") - x).max()
    energy = report.energies["kinetic"] - report.energies["work"]
    print(f"after a turn of {turn:.4f} s back within {back:.1e} m, energy kept to {abs(energy - speed**2):.1e} J")


if __name__ == "__main__":
    main()
