"""One kilogram hangs on a nail under each scheme: what the letter of the paper reports, and the default.

The letter has one multiplier, for the position. Where the scheme answers a force with d / c other than 1 / h, landing
does not stop the point, and the reported force is not the weight. The default gives the velocity a multiplier of its own.
"""

import numpy as np

import turnbuckle

SCHEMES = ("euler_cromer", "verlet", "velocity_verlet", "beeman", "midpoint", "rk2")


def nail_force(integrator: str, response: str) -> float:
    """Force of the nail on 1 kg in 10 m/s^2 after 100 steps [N]."""
    scene = turnbuckle.Scene("weight", dt=0.01, gravity=[0, 0, -10], integrator=integrator, response=response)
    scene.add_rope("rope", points=[[0, 0, 0], [1, 0, 0]], stretch_stiffness=0, mass=2)
    scene.add_constraint("nail", "nail", points={"body": "rope", "index": 0})
    simulation = turnbuckle.Simulation(scene)
    velocities = np.zeros((2, 3))
    velocities[0, 2] = 1.0  # the point starts with 1 m/s upwards
    simulation.state.set_velocities(velocities)
    simulation.run(1.0)
    return float(simulation.forces("nail")[0, 2])


def main() -> None:
    for integrator in SCHEMES:
        paper, default = (nail_force(integrator, response) for response in ("paper", "exact"))
        print(f"{integrator:<16} paper {paper:9.3f} N    default {default:9.3f} N")


if __name__ == "__main__":
    main()
