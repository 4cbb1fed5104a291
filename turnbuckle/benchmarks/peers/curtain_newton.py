"""The curtain in Newton (Warp): `python -m turnbuckle.benchmarks.peers.curtain_newton --solver vbd` (or `xpbd`).

Joints are springs. Settings are the best found at steps of 2 ms and 10 iterations, and not ours to be proud of: VBD with
1e7 N/m closes the gaps ten times better, but then the curtain sinks faster than it would in free fall; XPBD (Jacobi)
falls apart with every stiffness from 1e3 to 1e7 N/m and relaxation from 0.1 to 0.9, least with these.
"""

import argparse
import sys
from typing import Any

import numpy as np
import warp as wp

from turnbuckle.benchmarks.peers.protocol import GRAVITY, Task, lumped_masses, simulate, task_from_arguments

LAME = 3e5  # [Pa], both parameters of the tetrahedra
HOW = {
    "vbd": "neo-Hookean tetrahedra; nails: mass 0; joints: springs of rest length 0 and {:.0e} N/m; recorded graph, CPU",
    "xpbd": "neo-Hookean tetrahedra; nails: mass 0; joints: springs of rest length 0 and {:.0e} N/m; recorded graph, CPU",
}


def build(task: Task, joint_stiffness: float) -> Any:
    """The model of the curtain, with `joint_stiffness` [N/m] at the joints."""
    import newton

    curtain = task.geometry()
    masses = lumped_masses(curtain)
    masses[curtain.nails] = 0.0
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, GRAVITY, 0.0))
    builder.add_particles(
        pos=[wp.vec3(*x) for x in curtain.vertices],
        vel=[wp.vec3(0.0)] * len(masses),
        mass=masses.tolist(),
    )
    for tetrahedron in curtain.tetrahedra.tolist():
        builder.add_tetrahedron(*tetrahedron, k_mu=LAME, k_lambda=LAME, k_damp=0.0)
    for a, b in curtain.pairs.tolist():
        builder.add_spring(a, b, joint_stiffness, 0.0, control=0.0)
    builder.color()
    return builder.finalize(device="cpu")


def main() -> None:
    import newton

    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--solver", choices=sorted(HOW), default="vbd")
    parser.add_argument("--joint-stiffness", type=float, default=1e6, help="[N/m]")
    parser.add_argument("--relaxation", type=float, default=0.1, help="of xpbd")
    own, sys.argv[1:] = parser.parse_known_args()
    task = task_from_arguments()
    wp.config.quiet = True

    model = build(task, own.joint_stiffness)
    if own.solver == "vbd":
        solver = newton.solvers.SolverVBD(
            model, iterations=task.iterations, particle_enable_self_contact=False, particle_enable_tile_solve=False
        )
    else:
        solver = newton.solvers.SolverXPBD(model, iterations=task.iterations, soft_body_relaxation=own.relaxation)
    states = [model.state(), model.state()]
    control = model.control()

    def two_steps() -> None:
        for old, new in (states, states[::-1]):
            old.clear_forces()
            solver.step(old, new, control, None, task.dt)

    two_steps()  # compiles
    with wp.ScopedCapture(device="cpu") as capture:
        two_steps()

    def replay() -> None:
        wp.capture_launch(capture.graph)

    def positions() -> np.ndarray:
        return states[0].particle_q.numpy().astype(np.float64)

    name, how = f"newton {own.solver}", HOW[own.solver].format(own.joint_stiffness)
    simulate(task, replay, positions, name, newton.__version__, how, steps_a_call=2)


if __name__ == "__main__":
    main()
