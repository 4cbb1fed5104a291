"""Turnbuckle: exact constrained dynamics of deformable and rigid bodies.

`Scene` is what is simulated, `run_scene` simulates it with recordings and a report, `Simulation` step by step.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnbuckle.data.errors import ConflictError, InputError, StepError, TurnbuckleError
    from turnbuckle.data.model import Model
    from turnbuckle.data.report import RunReport, StepReport
    from turnbuckle.data.state import State
    from turnbuckle.io.imported import Imported
    from turnbuckle.io.importing import import_scene
    from turnbuckle.io.usd_export import export_scene
    from turnbuckle.run.assemble import assemble
    from turnbuckle.run.assembly_report import AssemblyReport
    from turnbuckle.run.export_recording import export_recording
    from turnbuckle.run.pose import pose
    from turnbuckle.run.run import run_scene
    from turnbuckle.scene.scene import Scene
    from turnbuckle.step.simulation import Simulation
    from turnbuckle.step.step import Stepper
    from turnbuckle.sweeps.sweep import SweepResult, sweep

__version__ = "0.1.0"

# Where each public name lives. Loaded when first asked for, so that `turnbuckle --help` does not wait for Warp.
_HOMES = {
    "AssemblyReport": "run.assembly_report",
    "ConflictError": "data.errors",
    "Imported": "io.imported",
    "InputError": "data.errors",
    "Model": "data.model",
    "RunReport": "data.report",
    "Scene": "scene.scene",
    "Simulation": "step.simulation",
    "State": "data.state",
    "StepError": "data.errors",
    "StepReport": "data.report",
    "Stepper": "step.step",
    "SweepResult": "sweeps.sweep",
    "TurnbuckleError": "data.errors",
    "assemble": "run.assemble",
    "export_recording": "run.export_recording",
    "export_scene": "io.usd_export",
    "import_scene": "io.importing",
    "pose": "run.pose",
    "run_scene": "run.run",
    "sweep": "sweeps.sweep",
}

__all__ = [
    "AssemblyReport", "ConflictError", "Imported", "InputError", "Model", "RunReport", "Scene", "Simulation", "State", "StepError",
    "StepReport", "Stepper", "SweepResult", "TurnbuckleError", "assemble", "export_recording", "export_scene", "import_scene", "pose", "run_scene", "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"turnbuckle.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'turnbuckle' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
