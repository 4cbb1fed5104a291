"""Turnbuckle: exact constrained dynamics of deformable and rigid bodies.

`Scene` is what is simulated, `run_scene` simulates it with recordings and a report, `Simulation` step by step.
Contact on arrays, for time steppers of one's own: `turnbuckle.step.contact_tools`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnbuckle.contact.ccd_bulk import time_of_impact
    from turnbuckle.contact.intersections import intersections
    from turnbuckle.contact.surface import SurfacePart, make_surfaces
    from turnbuckle.data.contact import ContactProblem, Contacts, ContactSolution, Surfaces
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
    from turnbuckle.step.contact_tools import ContactDetector, contact_problem, refine_contacts, solve_contact
    from turnbuckle.step.simulation import Simulation
    from turnbuckle.step.step import Stepper
    from turnbuckle.sweeps.sweep import SweepResult, sweep

__version__ = "0.1.0"

# Where each public name lives. Loaded when first asked for, so that `turnbuckle --help` does not wait for Warp.
_HOMES = {
    "AssemblyReport": "run.assembly_report",
    "ConflictError": "data.errors",
    "ContactDetector": "step.contact_tools",
    "ContactProblem": "data.contact",
    "ContactSolution": "data.contact",
    "Contacts": "data.contact",
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
    "SurfacePart": "contact.surface",
    "Surfaces": "data.contact",
    "SweepResult": "sweeps.sweep",
    "TurnbuckleError": "data.errors",
    "assemble": "run.assemble",
    "export_recording": "run.export_recording",
    "export_scene": "io.usd_export",
    "import_scene": "io.importing",
    "contact_problem": "step.contact_tools",
    "intersections": "contact.intersections",
    "make_surfaces": "contact.surface",
    "pose": "run.pose",
    "refine_contacts": "step.contact_tools",
    "run_scene": "run.run",
    "solve_contact": "step.contact_tools",
    "sweep": "sweeps.sweep",
    "time_of_impact": "contact.ccd_bulk",
    "view": "live.show",
}

__all__ = [
    "AssemblyReport", "ConflictError", "ContactDetector", "ContactProblem", "ContactSolution", "Contacts", "Imported",
    "InputError", "Model", "RunReport", "Scene", "Simulation", "State", "StepError", "StepReport", "Stepper", "SurfacePart",
    "Surfaces", "SweepResult", "TurnbuckleError", "assemble", "contact_problem", "export_recording", "export_scene",
    "import_scene", "intersections", "make_surfaces", "pose", "refine_contacts", "run_scene", "solve_contact", "sweep",
    "time_of_impact", "view",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"turnbuckle.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'turnbuckle' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
