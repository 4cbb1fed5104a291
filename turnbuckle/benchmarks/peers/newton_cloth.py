"""A ready scene of cloth in Newton (Warp) with VBD and self-contact: `python -m turnbuckle.benchmarks.peers.newton_cloth TASK`."""

import numpy as np
import warp as wp

from turnbuckle.benchmarks.contact_protocol import simulate, task_from_arguments
from turnbuckle.benchmarks.peers.newton_cloth_scene import NewtonScene
from turnbuckle.scenes import REGISTRY

HOW = (
    "VBD, {iterations} iterations, {substeps} substep(s) of {ms:.3g} ms, {surface}; "
    "self-contact penalty {stiffness:.3g} N/m, margin {margin:.2g} mm and gap {gap:.2g} mm, CPU"
)


def main(surface: str = "the same springs and hinges") -> None:
    """Simulate the task's scene; ``surface`` says what of ours it is made of."""
    import newton

    task = task_from_arguments()
    wp.config.quiet = True
    scene = REGISTRY[task.scene](**task.parameters)
    model, state = scene.build()
    dt = scene.definition.dt
    peer = NewtonScene(model, state, **task.options)
    how = HOW.format(
        iterations=peer.solver.iterations, substeps=peer.substeps, ms=1e3 * dt / peer.substeps, surface=surface,
        stiffness=peer.newton.soft_contact_ke, margin=1e3 * peer.radius, gap=1e3 * peer.gap * peer.radius,
    )  # fmt: skip

    def positions() -> np.ndarray:
        return peer.positions(peer.steps * dt)

    moves = model.mass > 0.0
    version = newton.__version__
    simulate(task, dt, lambda: peer.step(dt), positions, moves, peer.surfaces, "newton vbd", version, how)


if __name__ == "__main__":
    main()
