"""What joints beside contact are reported with: residuals by the certificate, mean reactions, what breaks."""

import numpy as np
import warp as wp

from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.rigid import ROWS
from turnbuckle.data.state import State
from turnbuckle.geometry.quaternions import cross, rotate
from turnbuckle.step.articulated import TOLERANCE, Articulated
from turnbuckle.step.contact_joints import ContactJoints
from turnbuckle.step.joint_certificate import measure_joints


class JointReports:
    """Measures the joints of the committed state with the code that measures joints without contact."""

    def __init__(self, model: Model, state: State, joints: ContactJoints) -> None:
        self.model, self.state, self.joints = model, state, joints
        self.articulated = Articulated(model, state)
        self._layout: tuple = ()

    def follow(self, dt: float) -> None:
        """Catch up with joints that were added, removed or switched, or whose window opens or closes."""
        if self.model.rigid.count < 2:
            return
        layout = (self.state.layout, id(self.state.parts), self.state.parts.count)
        if layout != self._layout and self.state.parts.count:
            self.articulated.follow()
            self._layout = layout
        self.articulated.update_windows(dt)
        self.joints.follow()

    def report(self, report: StepReport, size: float) -> None:
        """Residuals of the committed state. A joint that is open makes the step "degraded", and is named."""
        state = self.state
        count = sum(j.acting for j in state.joints.values())
        if not count:
            return
        report.energies["elastic"] = report.energies.get("elastic", 0.0) + self.joints.elastic_energy()
        system = self.articulated.system
        bodies = system.bodies(state.rigid, state.rigid, state.rigid)
        values = self.articulated.certificate.values
        wp.launch(
            measure_joints, state.parts.count, inputs=[0, system.acting, system.parts, bodies, *values],
            device=self.model.device,
        )  # fmt: skip
        measured = self.articulated.residuals()
        worst = measured.max(axis=1, initial=0.0)
        report.active["joint"] = count
        report.position_residual["joint"], report.position_residual["joint_rotation"] = map(float, worst[:2])
        report.rate_residual["joint"], report.rate_residual["joint_rotation"] = map(float, worst[2:])
        allowed = TOLERANCE + 64 * np.finfo(float).eps * size
        if not (worst[:2] <= allowed).all():
            self._name_worst(report, measured[:2], allowed)

    def _name_worst(self, report: StepReport, values: np.ndarray, allowed: float) -> None:
        names = {int(p): j.name for j in self.state.joints.values() for p in j.parts}
        score = np.nan_to_num(values.max(axis=0), nan=np.inf)
        worst = [p for p in np.argsort(-score, kind="stable")[:3] if score[p] > allowed]
        told = [f"'{names.get(int(p), '?')}' by {values[0, p]:.2e} m and {values[1, p]:.2e} rad" for p in worst]
        report.messages.append(f"joints that cannot be closed: {', '.join(told)}")

    def mean_reactions(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean force on body1 [N], and torque about the joint's place [N m], of each part in the last step (parts, 3)."""
        joints, parts = self.joints, self.state.parts
        if joints.impulse.shape != (parts.count * ROWS,) or not joints.impulse.any():
            return np.zeros((parts.count, 3)), np.zeros((parts.count, 3))
        mean = joints.impulse.reshape(-1, ROWS, 1) / joints.h
        rows = joints.last
        force = (mean * rows.force).sum(axis=1)
        place = joints.middle_x[parts.a] + rotate(joints.middle_q[parts.a], parts.p_a)
        return force, (mean * rows.turn).sum(axis=1) + cross(rows.at - place, force)

    def break_joints(self) -> list[str]:
        """Switch off for good joints whose mean force or torque of the step has passed their limit; their names."""
        limited = [
            j for j in self.state.joints.values() if j.acting and min(j.break_force, j.break_torque) < np.inf
        ]  # fmt: skip
        if not limited:
            return []
        force, torque = self.mean_reactions()
        broken = []
        for joint in limited:
            f, t = force[joint.parts].sum(axis=0), torque[joint.parts].sum(axis=0)
            if np.linalg.norm(f) > joint.break_force or np.linalg.norm(t) > joint.break_torque:
                joint.broken = True
                broken.append(joint.name)
        return broken
