"""A bead slides on a cloth without friction. It presses the cloth down, and the cloth carries it."""

import numpy as np

import turnbuckle


def main() -> None:
    scene = turnbuckle.Scene("bead", dt=1e-3)
    scene.add_cloth("cloth", size=[1, 1], cells=[12, 12], structural_stiffness=300, shear_stiffness=100, damping=0.05,
                    mass=0.3)  # fmt: skip
    scene.add_rope("bead", points=[[0.3, 0.5, 0], [0.3, 0.5, 0.05]], stretch_stiffness=500, damping=0.5, mass=0.05,
                   velocity=[0.8, 0, 0])  # fmt: skip
    scene.add_constraint("nail", "frame", points={"body": "cloth", "where": "min(x, y, 1 - x, 1 - y) < 1e-6"})
    scene.add_constraint("slide", "bead", points={"body": "bead", "index": 0}, on={"body": "cloth", "surface": True})

    simulation = turnbuckle.Simulation(scene)
    for _ in range(3):
        report = simulation.run(0.1)
        place, force = simulation.positions("bead")[0], simulation.forces("bead")[0]
        print(
            f"t = {simulation.time:.1f} s: the bead is at {np.round(place, 3)}, the cloth pushes it with {force[2]:.2f} N"
        )
    print("off the cloth by", report.position_residual["slide"], "m")


if __name__ == "__main__":
    main()
