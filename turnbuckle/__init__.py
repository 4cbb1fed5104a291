"""Turnbuckle: exact constrained dynamics of deformable and rigid bodies."""

from turnbuckle.data.errors import ConflictError, InputError, StepError, TurnbuckleError
from turnbuckle.data.model import Model
from turnbuckle.data.report import StepReport
from turnbuckle.data.state import State
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation
from turnbuckle.step.step import Stepper

__version__ = "0.1.0"

__all__ = [
    "ConflictError", "InputError", "Model", "Scene", "Simulation", "State", "StepError", "StepReport", "Stepper",
    "TurnbuckleError",
]  # fmt: skip
