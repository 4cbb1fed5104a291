"""`Simulation`: a scene that runs, step by step, and may be changed between two steps."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnbuckle.constraints.activation import find_group, remove, retarget, switch
from turnbuckle.data.errors import InputError, StepError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.state import State
from turnbuckle.data.tables import Joins
from turnbuckle.scene.build_constraints import add_constraint, goal_of
from turnbuckle.scene.definitions import KeyframesDef
from turnbuckle.scene.scene import CONSTRAINTS, Scene
from turnbuckle.scene.validation import validate
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
        self.stepper = Stepper(self.model, self.state)

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

    def forces(self, constraint: str) -> np.ndarray:
        """Constraint forces of the last step [N].

        The force belongs to the step as its scheme has it: to its start (velocity Verlet), its middle (Verlet, midpoint) or
        its end (RK4, Newmark); between them lies a difference of order dt.

        Shape (rows, 3): on the point of a nail or velocity goal, on the point that is attached or slides (its element
        takes the opposite). For points to point (points, 3): on every point, row after row.
        """
        group = find_group(self.state, constraint)
        table = getattr(self.state.tables, group.kind)
        if isinstance(table, Joins):
            first = int(table.offsets.numpy()[group.rows[0]])
            return table.point_force.numpy()[first : first + len(group.points)].copy()
        return table.force.numpy()[group.rows].copy()

    def residuals(self, constraint: str) -> np.ndarray:
        """Position residuals [m] of the rows of a constraint after the last step, shape (rows,)."""
        group = find_group(self.state, constraint)
        return np.sqrt(getattr(self.state.tables, group.kind).position_residual.numpy()[group.rows])

    # Changing between two steps -----------------------------------------------------------------------------------

    def switch(self, constraint: str, on: bool) -> None:
        """Switch a constraint on or off from the next step. Raises `ConflictError` when one of its points is taken."""
        switch(self.model, self.state, constraint, on)

    def retarget(self, constraint: str, goal: Any) -> None:
        """Give a nail or velocity goal another goal, written as in `Scene.add_constraint`. A ramp starts anew."""
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
        add_constraint(self.model, self.state, item)

    def remove_constraint(self, name: str) -> None:
        """Forget a constraint."""
        remove(self.model, self.state, name)

    def _part(self, values: np.ndarray, body: str | None) -> np.ndarray:
        if body is None:
            return values
        shape = self.model.shape(body)
        return values[shape.begin : shape.end]
