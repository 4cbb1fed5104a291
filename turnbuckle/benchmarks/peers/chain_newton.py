"""The chain in Newton (Warp) with XPBD: `python -m turnbuckle.benchmarks.peers.chain_newton`.

The chain is open: its articulations are trees. As in the curtain, the steps are recorded once and replayed.
"""

import argparse
import sys
from typing import Any

import numpy as np
import warp as wp

from turnbuckle.benchmarks.peers.chain_protocol import (
    DT,
    GRAVITY,
    LENGTH,
    MASS,
    THICKNESS,
    ChainTask,
    simulate,
    task_from_arguments,
)

HOW = "open chain, ball joints, XPBD of {} iterations, joint relaxation 0.7 and 0.4 (its defaults), recorded graph, CPU"


def build(task: ChainTask) -> Any:
    """The model of the chain, free at its last end."""
    import newton

    ends, turns = task.start()
    middle = 0.5 * (ends[1:] + ends[:-1])
    across, along = MASS * 2.0 * THICKNESS**2 / 12.0, MASS * (LENGTH**2 + THICKNESS**2) / 12.0
    inertia = wp.mat33(across, 0.0, 0.0, 0.0, along, 0.0, 0.0, 0.0, along)
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, GRAVITY))
    links = [
        builder.add_link(
            xform=wp.transform(wp.vec3(*x), wp.quat(*q)),
            mass=MASS,
            inertia=inertia,
            com=wp.vec3(0.0),
            lock_inertia=True,
        )
        for x, q in zip(middle, turns, strict=True)
    ]
    left, right = wp.transform(wp.vec3(-0.5 * LENGTH, 0.0, 0.0)), wp.transform(wp.vec3(0.5 * LENGTH, 0.0, 0.0))
    joints = []
    for i, link in enumerate(links):
        before = {"parent": links[i - 1], "parent_xform": right}
        if i == 0:
            before = {"parent": -1, "parent_xform": wp.transform(wp.vec3(*ends[0]))}
        joints.append(builder.add_joint_ball(child=link, child_xform=left, **before))
    builder.add_articulation(joints)
    return builder.finalize(device="cpu")


def main() -> None:
    import newton

    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--iterations", type=int, default=40)
    own, sys.argv[1:] = parser.parse_known_args()
    task = task_from_arguments()
    wp.config.quiet = True
    model = build(task)
    solver = newton.solvers.SolverXPBD(model, iterations=own.iterations)
    states = [model.state(), model.state()]
    control = model.control()

    def two_steps() -> None:
        for old, new in (states, states[::-1]):
            old.clear_forces()
            solver.step(old, new, control, None, DT)

    two_steps()  # compiles
    with wp.ScopedCapture(device="cpu") as capture:
        two_steps()

    def poses() -> tuple[np.ndarray, np.ndarray]:
        q = states[0].body_q.numpy().astype(np.float64)
        return q[:, :3], q[:, 3:]

    def replay() -> None:
        wp.capture_launch(capture.graph)

    how = HOW.format(own.iterations)
    simulate(task, replay, poses, "newton xpbd", newton.__version__, how, closed=False, steps_a_call=2)


if __name__ == "__main__":
    main()
