"""`Simulation`: a scene that runs, step by step, and may be changed between two steps."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnbuckle.constraints.activation import find_group, remove, retarget, switch
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.rigid import Joint
from turnbuckle.data.state import State
from turnbuckle.data.tables import Joins
from turnbuckle.scene.build_constraints import add_constraint, goal_of
from turnbuckle.scene.build_joints import add_joints, remove_joint
from turnbuckle.scene.definitions import BodyPairDef, KeyframesDef
from turnbuckle.scene.scene import CONSTRAINTS, Scene
from turnbuckle.scene.validation import validate
from turnbuckle.step.contact_step import ContactStepper
from turnbuckle.step.reactions import reactions
from turnbuckle.step.rigid_access import (
    read_coordinates,
    read_pose,
    write_pose,
    write_push,
    write_target,
    write_velocity,
)
from turnbuckle.step.step import Stepper


class Simulation:
    """Model, state and stepper of a scene. ``model`` and ``state`` may be read at any time."""

    def __init__(self, scene: Scene, device: str = "cpu") -> None:
        """Build ``scene`` on ``device``. Raises `InputError`."""
        if not isinstance(scene, Scene):
            raise InputError(f"expected a Scene, got {type(scene).__name__}; read a scene file with Scene.load(path)")
        self.scene = scene
        self.dt = scene.definition.dt
        self.model: Model
        self.state: State
        self.model, self.state = scene.build(device)
        touches = self.model.surfaces is not None
        self.stepper: Stepper | ContactStepper = (ContactStepper if touches else Stepper)(self.model, self.state)

    def step(self, dt: float | None = None) -> StepReport:
        """Advance by ``dt`` [s], the scene's step when left out. A failed step leaves the state as it was."""
        return self.stepper.step(self.dt if dt is None else dt)

    def run(self, duration: float, dt: float | None = None) -> StepReport:
        """Steps until ``duration`` [s] has passed; the last report. Raises `StepError` when a step fails."""
        dt = self.dt if dt is None else dt
        if not (math.isfinite(duration) and duration > 0.0 and math.isfinite(dt) and dt > 0.0):
            raise InputError(f"duration and dt must be positive numbers of seconds, got {duration} and {dt}")
        steps = max(round(duration / dt), 1)
        report = StepReport()
        for _ in range(steps):
            report = self.step(dt)
            if report.status == "failed":
                raise StepError(f"at t = {report.time:.6g} s: {report.messages[0]}")
        return report

    # Reading -------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.state.time

    def positions(self, body: str | None = None) -> np.ndarray:
        """Positions [m] of a body's points, of all points when left out, shape (n, 3), read-only."""
        return self._part(self.state.positions(), body)

    def velocities(self, body: str | None = None) -> np.ndarray:
        """Velocities [m/s] of a body's points, of all points when left out, shape (n, 3), read-only."""
        return self._part(self.state.velocities(), body)

    # Rigid bodies --------------------------------------------------------------------------------------------------

    def pose(self, body: str) -> tuple[np.ndarray, np.ndarray]:
        """Origin (3,) [m] of a rigid body's own frame, and its quaternion xyzw (4,)."""
        return read_pose(self.model, self.state, self._rigid(body))

    def center(self, body: str) -> np.ndarray:
        """Centre of mass (3,) [m] of a rigid body."""
        return self.state.rigid.x.numpy()[self._rigid(body)].copy()

    def velocity(self, body: str) -> tuple[np.ndarray, np.ndarray]:
        """Velocity (3,) [m/s] of a rigid body's centre of mass, and its angular velocity (3,) [rad/s] in world axes."""
        b = self._rigid(body)
        return self.state.rigid.v.numpy()[b].copy(), self.state.rigid.w.numpy()[b].copy()

    def set_pose(self, body: str, position: Any, quaternion: Any) -> None:
        """Put a rigid body's own frame at ``position`` (3,) [m], turned by ``quaternion`` (4,) xyzw; speeds stay."""
        write_pose(self.model, self.state, self._rigid(body), position, quaternion)
        self.stepper.articulated.place_points()

    def set_velocity(self, body: str, velocity: Any, angular: Any) -> None:
        """Give a rigid body's centre of mass a velocity (3,) [m/s], and the body an angular one (3,) [rad/s], world axes."""
        write_velocity(self.model, self.state, self._rigid(body), velocity, angular)
        self.stepper.articulated.place_points()

    def push(self, body: str, force: Any = None, torque: Any = None, at: Any = None) -> None:
        """Load a rigid body with a force [N] and torque [N m] in world axes until told otherwise.

        ``at``: where the force acts, in the body's own frame [m]; its centre of mass when left out. A force or torque left out
        is zero; a force of zero alone ends the push.
        """
        write_push(self.model, self.state, self._rigid(body), force, torque, at)

    def reaction(self, joint: str) -> tuple[np.ndarray, np.ndarray]:
        """Force (3,) [N] and torque (3,) [N m] of a joint on its body1, about the joint's place, world axes.

        At the committed state, from the accelerations that keep all joints closed. Where joints repeat each other (two hinges
        of a door) the least of all possible reactions. With contact the mean over the last step, zero before the first.
        """
        found = self._joint(joint)
        if isinstance(self.stepper, ContactStepper):
            force, torque = self.stepper.joint_reports.mean_reactions()
        else:
            force, torque = reactions(self.model, self.state, self.stepper.articulated)
        return force[found.parts].sum(axis=0), torque[found.parts].sum(axis=0)

    def coordinate(self, joint: str) -> dict[str, float]:
        """Where a joint is: "place" [m], "distance" [m], "angle" [rad], "twist" [rad], those that it has."""
        return read_coordinates(self.state, self._joint(joint))

    def joint_residual(self, joint: str) -> tuple[float, float]:
        """What a joint misses by after the last step [m], [rad]."""
        values = self.stepper.articulated.residuals()[:2, self._joint(joint).parts]
        return float(values[0].max(initial=0.0)), float(values[1].max(initial=0.0))

    def _rigid(self, body: str) -> int:
        names = self.model.rigid.names
        if body not in names[1:]:
            self.model.shape(body)
            raise InputError(f"body '{body}' is not rigid; rigid are: {', '.join(names[1:]) or 'none'}")
        return names.index(body, 1)

    def _joint(self, name: str) -> Joint:
        if name not in self.state.joints:
            raise InputError(f"there is no joint '{name}'; known are: {', '.join(sorted(self.state.joints)) or 'none'}")
        return self.state.joints[name]

    # Constraints ---------------------------------------------------------------------------------------------------

    def forces(self, constraint: str) -> np.ndarray:
        """Constraint forces of the last step [N].

        The force belongs to the step as its scheme has it: to its start (velocity Verlet), its middle (Verlet, midpoint) or
        its end (RK4, Newmark); between them lies a difference of order dt.

        Shape (rows, 3): on the point of a nail or velocity goal, on the point that is attached or slides (its element
        takes the opposite). For points to point (points, 3): on every point, row after row. For a joint (1, 3): the
        force of `reaction`, on its body1, which belongs to the committed state.
        """
        if constraint in self.state.joints:
            return self.reaction(constraint)[0][None]
        group = find_group(self.state, constraint)
        table = getattr(self.state.tables, group.kind)
        if isinstance(table, Joins):
            first = int(table.offsets.numpy()[group.rows[0]])
            return table.point_force.numpy()[first : first + len(group.points)].copy()
        return table.force.numpy()[group.rows].copy()

    def residuals(self, constraint: str) -> np.ndarray:
        """Position residuals [m] of the rows of a constraint after the last step, shape (rows,).

        For a joint (2,), those of `joint_residual`: [m] and [rad].
        """
        if constraint in self.state.joints:
            return np.array(self.joint_residual(constraint))
        group = find_group(self.state, constraint)
        return np.sqrt(getattr(self.state.tables, group.kind).position_residual.numpy()[group.rows])

    # Changing between two steps -----------------------------------------------------------------------------------

    def switch(self, constraint: str, on: bool) -> None:
        """Switch a constraint or joint on or off from the next step; what has broken stays off.

        Raises `ConflictError` when one of its points is taken.
        """
        if constraint in self.state.joints:
            self.state.joints[constraint].enabled = on
            return
        switch(self.model, self.state, constraint, on)

    def retarget(self, constraint: str, goal: Any) -> None:
        """Give a nail or velocity goal another goal, written as in `Scene.add_constraint`. A ramp starts anew.

        For a joint with a motor the goal is one number: the wanted rate [m/s or rad/s], or the wanted place or angle
        [m or rad], whichever its motor was defined with.
        """
        if constraint in self.state.joints:
            write_target(self.state, self.state.joints[constraint], goal)
            self.stepper.articulated.drive()
            return
        group = find_group(self.state, constraint)
        if isinstance(goal, Mapping):
            goal = validate(KeyframesDef, goal, f"goal of '{constraint}'", {"folder": self.scene.folder})
        if (
            not callable(goal)
            and not isinstance(goal, KeyframesDef)
            and goal is not None
            and not np.isfinite(goal).all()
        ):
            raise InputError(f"constraint '{constraint}': the goal has numbers that are not finite: {goal}")
        new = goal_of(goal, group, self.state)
        retarget(self.state, constraint, new, new.moves)

    def add_constraint(self, type: str, name: str, **fields: Any) -> None:
        """Add a constraint, written as in `Scene.add_constraint`; places mean where points are now."""
        if type not in CONSTRAINTS:
            raise InputError(f"constraint '{name}': unknown type '{type}'; known are {', '.join(CONSTRAINTS)}")
        item = validate(CONSTRAINTS[type], {"name": name, **fields}, f"{type} '{name}'", {"folder": self.scene.folder})
        if isinstance(item, BodyPairDef):
            add_joints(self.model, self.state, [item], self.scene.folder)
            self.state.joints[name].live = True
        else:
            add_constraint(self.model, self.state, item)

    def remove_constraint(self, name: str) -> None:
        """Forget a constraint."""
        if name in self.state.joints:
            remove_joint(self.state, name)
        else:
            remove(self.model, self.state, name)

    def _part(self, values: np.ndarray, body: str | None) -> np.ndarray:
        if body is None:
            return values
        shape = self.model.shape(body)
        return values[shape.begin : shape.end]
