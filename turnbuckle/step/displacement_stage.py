"""The `displacement` solver in a step (Displacement, 2.2): free motion, corrections, speeds from what was reached.

Bodies fly freely (with all joints switched off in the kernels), the corrections of `turnbuckle.solvers.displacement` bring
them and the mass points tied to them onto their joints, and velocities follow the displacements. Under the default motion
("rotor") the correction's own speed, ``log(R_reached R_free^-1) / h``, is added to that of the free flight, so that a body
that nothing corrects keeps its exact free motion; under the paper's motion all of step 3 is as printed.
"""

from dataclasses import fields, replace

import numpy as np
import warp as wp

from turnbuckle.compute import host
from turnbuckle.data.model import Model
from turnbuckle.data.rigid import RigidState
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import conjugate, logarithm, multiply, rotate
from turnbuckle.solvers.displacement.displace import Displacement
from turnbuckle.solvers.displacement.options import DisplacementOptions, DisplacementResult
from turnbuckle.solvers.displacement.speeds import reached_speeds
from turnbuckle.solvers.displacement.ties import PointTies
from turnbuckle.step.articulated_system import System


class DisplacementStage:
    """Corrections of one layout of joints and ties."""

    def __init__(self, model: Model, state: State, system: System) -> None:
        self.model, self.state, self.system = model, state, system
        given = model.displacement
        self.options = DisplacementOptions(
            **{f.name: getattr(given, f.name) for f in fields(DisplacementOptions) if hasattr(given, f.name)}
        )
        self.speeds = given.speeds  # type: ignore[attr-defined]
        self.result: DisplacementResult | None = None
        self.prepare()

    def prepare(self) -> None:
        """Make ready for the joints that act now."""
        model, state, system = self.model, self.state, self.system
        joints = list(state.joints.values())
        number = np.full(
            state.parts.count, len(joints)
        )  # of each part's joint here; parts of removed joints have the last
        for i, joint in enumerate(joints):
            number[joint.parts] = i
        acting = np.array([*(j.acting for j in joints), False], dtype=bool)
        weights = system.ties.weights.tocsr()
        weights.sort_indices()
        e = system.entries
        names = {place: name for name, group in state.groups.items() for place in [(group.kind, r) for r in group.rows]}
        kinds = list(state.tables.by_kind())
        ties = PointTies(
            start=weights.indptr.astype(np.int64),
            weight=weights.data,
            body=e.body,
            point=np.where(e.body < 0, np.searchsorted(system.tied, e.point), 0),
            local=e.local,
            target=system.ties.target,
            names=[names.get((kinds[k], r), "tie") for k, r in zip(system.ties.kind, system.ties.row, strict=True)],
        )
        self.solver = Displacement(
            model.rigid, replace(state.parts, joint=number), joints, self.options, acting=acting, domains=state.domains, ties=ties,
            point_mass=model.mass[system.tied],
        )  # fmt: skip

    def aim(self, target: np.ndarray) -> None:
        """Goals of ties at the end of the step (rows, 3) [m]."""
        self.solver.ties.ties.target = target

    def correct(self, now: RigidState, ahead: RigidState, x: wp.array, v: wp.array, memory: wp.array, h: float) -> None:
        """Correct the free flight from ``now`` to ``ahead``, and the tied mass points in ``x``, ``v``.

        Raises FloatingPointError when joints stay open and the user chose to stop then.
        """
        model, options = self.model, self.options
        x0, q0 = host(now.x).copy(), host(now.q).copy()
        x1, q1 = host(ahead.x).copy(), host(ahead.q).copy()
        tied = self.system.tied
        free = x.numpy()[tied].copy()
        result = self.solver.solve(x1, q1, free, start=(x0, q0))
        self.result = result
        if not result.converged and options.on_limit == "stop":
            raise FloatingPointError(result.warning())
        v1, w1 = host(ahead.v).copy(), host(ahead.w).copy()
        moves = model.rigid.motion == 2
        if model.rigid_motion == "paper":
            v1[moves], w1[moves] = (a[moves] for a in reached_speeds(x0, q0, result.x, result.q, h, self.speeds))
        else:
            turned = logarithm(multiply(result.q, conjugate(q0))) - logarithm(multiply(q1, conjugate(q0)))
            v1[moves] += (result.x - x1)[moves] / h
            w1[moves] += turned[moves] / h
        for array, values in ((ahead.x, result.x), (ahead.q, result.q), (ahead.v, v1), (ahead.w, w1)):
            array.assign(values)
        spin = rotate(result.q, model.rigid.inertia * rotate(conjugate(result.q), w1))
        self.system.scratch["momentum"].assign(spin)
        if len(tied):
            shift = result.points - free
            for array, change in ((x, shift), (v, shift / h), (memory, shift / h)):
                values = array.numpy()
                values[tied] += change
                array.assign(values)
