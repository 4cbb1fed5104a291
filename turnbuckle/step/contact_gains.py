"""Whether a step in contact made energy of nothing."""

from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.data.report import StepReport

if TYPE_CHECKING:
    from turnbuckle.step.contact_step import ContactStepper

GAINED = 0.01  # of the energy of motion and strain: more than solutions are good to

Balance = tuple[float, float]  # [J] work and dissipation before a step


def balance(stepper: "ContactStepper") -> Balance:
    """What was done and lost before a step, which begins now."""
    stepper.dynamics_of.started = None
    return stepper.state.work, stepper.state.dissipation


def gained(stepper: "ContactStepper", report: StepReport, before: Balance) -> float:
    """Energy [J] that the step made, from ``before`` on; it falls by friction, impacts and damping."""
    scheme, state, e = stepper.dynamics_of, stepper.state, report.energies
    if scheme.exact_balance:
        return before[1] - state.dissipation
    assert scheme.started is not None
    return e["kinetic"] + e["elastic"] + e["gravity"] - scheme.started - (state.work - before[0])


def gains(stepper: "ContactStepper", report: StepReport, before: Balance) -> bool:
    """Whether the step should be made again: it made more than solutions are good to."""
    scheme, dynamics, model = stepper.dynamics_of, stepper.dynamics, stepper.model
    if report.status == "failed" or not scheme.may_gain or not (scheme.exact_balance or report.contacts):
        return False
    mass = float(np.maximum(model.mass, 0.0).sum() + model.rigid.mass[dynamics.dynamic].sum())
    falls = 0.5 * mass * float(np.sum((stepper.state.gravity * report.dt) ** 2))
    there = report.energies["kinetic"] + report.energies["elastic"] + falls
    return gained(stepper, report, before) > GAINED * there
