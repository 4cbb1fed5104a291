"""The curtain in pyPBD (position-based dynamics, C++): `python -m turnbuckle.benchmarks.peers.curtain_pypbd`."""

import importlib.metadata

import numpy as np

from turnbuckle.benchmarks.peers.protocol import lumped_masses, simulate, task_from_arguments

HOW = (
    "one tetrahedral model with a distance constraint an edge and a volume constraint a tetrahedron (stiffness 1); "
    "nails: mass 0; joints: a distance constraint of rest length 0 (stiffness 1); Gauss-Seidel by colour groups"
)


def main() -> None:
    import pypbd

    task = task_from_arguments()
    curtain = task.geometry()
    simulation = pypbd.Simulation.getCurrent()
    simulation.initDefault()  # with gravity (0, -9.81, 0)
    pypbd.TimeManager.getCurrent().setTimeStepSize(task.dt)

    model = simulation.getModel()
    tetrahedra = model.addTetModel(list(curtain.vertices), curtain.tetrahedra.ravel().tolist(), testMesh=False)
    particles = model.getParticles()
    for point, mass in enumerate(lumped_masses(curtain)):
        particles.setMass(point, mass)
    for point in curtain.nails:
        particles.setMass(int(point), 0.0)
    model.addSolidConstraints(tetrahedra, 1, 1.0, 0.3, 1.0, False, False)
    for a, b in curtain.pairs:
        model.addDistanceConstraint(int(a), int(b), 1.0)

    controller = simulation.getTimeStep()
    controller.setValueUInt(pypbd.TimeStepController.MAX_ITERATIONS, task.iterations)
    controller.setValueUInt(pypbd.TimeStepController.NUM_SUB_STEPS, 1)

    def positions() -> np.ndarray:
        return np.array(particles.getVertices(), copy=True).reshape(-1, 3)

    simulate(task, lambda: controller.step(model), positions, "pypbd", importlib.metadata.version("pypbd"), HOW)


if __name__ == "__main__":
    main()
