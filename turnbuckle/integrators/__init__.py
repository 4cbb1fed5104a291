"""Numerical integration schemes (Local, section 3), one a file."""

from turnbuckle.integrators.beeman import Beeman
from turnbuckle.integrators.euler_cromer import EulerCromer
from turnbuckle.integrators.explicit_euler import ExplicitEuler
from turnbuckle.integrators.implicit_euler import ImplicitEuler
from turnbuckle.integrators.midpoint import Midpoint
from turnbuckle.integrators.newmark import Newmark
from turnbuckle.integrators.rk2 import RK2
from turnbuckle.integrators.rk4 import RK4
from turnbuckle.integrators.scheme import Recorder, Scheme
from turnbuckle.integrators.velocity_verlet import VelocityVerlet
from turnbuckle.integrators.verlet import Verlet

SCHEMES: dict[str, type[Scheme]] = {
    scheme.name: scheme
    for scheme in (
        ExplicitEuler, EulerCromer, Midpoint, RK2, Verlet, VelocityVerlet, Beeman, ImplicitEuler, RK4, Newmark,
    )
}  # fmt: skip

__all__ = ["SCHEMES", "Recorder", "Scheme"]
