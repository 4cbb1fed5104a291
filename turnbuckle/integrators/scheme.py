"""What an integrator is: a name, an order, a response, and three recipes recorded once per run.

In the generic form (1) of Local, a force F on point i at time t moves it by ``c_i F`` and changes its velocity by
``d_i F`` within the step. Every scheme here has ``c_i = c / m_i`` and ``d_i = d / m_i``.
"""

from abc import ABC, abstractmethod
from typing import ClassVar, Protocol

import warp as wp

from turnbuckle.data.state import Kinematics
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})


class Recorder(Protocol):
    """What a scheme may use to record its recipes."""

    now: Kinematics  # at the start of the step
    ahead: Kinematics  # at its end; the scheme writes x, v and memory
    mass: wp.array
    params: wp.array
    paper: bool  # response="paper"

    def launch(self, kernel: wp.Kernel, inputs: list) -> None:
        """Record a kernel over all points, and wait for it."""

    def scratch(self, name: str) -> wp.array:
        """A vector for each point, kept between recipes by name."""

    def forces(self, x: wp.array, v: wp.array, force_out: wp.array, time: float) -> None:
        """Record the evaluation of all forces at ``(x, v, t + time h)``."""

    def constrain(self, acceleration: wp.array) -> None:
        """Record the projection of accelerations on all active constraints (nothing under ``response="paper"``)."""

    def solve(
        self,
        alpha: float,
        beta: float,
        push: float,
        at: tuple[wp.array, wp.array],
        free: wp.array,
        force: wp.array,
        a_out: wp.array,
        iteration: int,
        last: int | None,
    ) -> None:
        """Record ``(M - alpha h D - beta h^2 K) da = F + push h K v - M a``, ``a += da``, with constraints, for implicit schemes.

        K and D are taken at ``at = (x, v)``. ``free`` are the positions at the end of the step before ``da``, which moves
        them by ``beta h^2 da``. Iteration 0 starts with ``a = 0``; later ones do nothing once ``da`` moves no point, and
        the step fails when it still does in the ``last`` (None: one iteration is the scheme).
        """


class Scheme(ABC):
    """An integrator. `predict` goes from ``now`` to ``ahead`` without constraints; then constraints are met; then
    `finish` completes the velocities and `remember` what the next step needs of the committed state."""

    name: ClassVar[str]
    order: ClassVar[int]  # of positions and velocities, unconstrained and constrained
    velocity_memory: ClassVar[bool] = False  # memory is a velocity, constrained like v
    adds_landing: ClassVar[bool] = False  # the first stage has a constraint force already; landing adds to it
    lands_later: ClassVar[bool] = False  # c = 0: constrains x at t + 2h (explicit Euler)
    implicit: ClassVar[bool] = False
    finishes_velocity: ClassVar[bool] = False  # `finish` makes the velocity, which is then projected once more
    goal_rate: ClassVar[str] = "derivative"  # of moving goals at t + h: "derivative", or "backward" difference

    @abstractmethod
    def response(self, h: float) -> tuple[float, float]:
        """``(c, d)`` [s^2], [s] with ``c_i = c / m_i``, ``d_i = d / m_i``."""

    def restart(self, r: Recorder) -> None:  # noqa: B027
        """Make the memory that belongs to ``now`` (first step, or the user moved something)."""

    def change_dt(self, r: Recorder) -> None:  # noqa: B027
        """Carry the memory over to another step size; ``params[PREVIOUS_H]`` holds the old one."""

    @abstractmethod
    def predict(self, r: Recorder) -> None:
        """Positions, velocities and memory at the end of the step, without constraints."""

    def landing(self, r: Recorder) -> Kinematics:
        """What constraints land on: positions ``x`` with velocities and memory to correct."""
        return r.ahead

    def finish(self, r: Recorder) -> None:  # noqa: B027
        """Complete ``ahead.v`` once the constrained positions are known."""

    def remember(self, r: Recorder) -> None:  # noqa: B027
        """Make ``ahead.memory`` once the forces at the committed state are known."""


@wp.kernel
def accelerate(begin: int, mass: wp.array(dtype=real), force: wp.array(dtype=vec3), a_out: wp.array(dtype=vec3)):
    """``a = F / m``."""
    i = known(begin + wp.tid())
    a_out[i] = force[i] / mass[i]


@wp.kernel
def step_along(
    begin: int,
    y: wp.array(dtype=vec3),
    rate: wp.array(dtype=vec3),
    factor: real,
    params: wp.array(dtype=real),
    y_out: wp.array(dtype=vec3),
):
    """``y_out = y + factor h rate``."""
    i = known(begin + wp.tid())
    y_out[i] = y[i] + rate[i] * (factor * params[0])


@wp.kernel
def copy(begin: int, y: wp.array(dtype=vec3), y_out: wp.array(dtype=vec3)):
    """``y_out = y``."""
    i = known(begin + wp.tid())
    y_out[i] = y[i]


def accelerations(r: Recorder, force: wp.array, name: str) -> wp.array:
    """Record ``a = F / m``, constrained, in the scratch vector ``name``."""
    a = r.scratch(name)
    r.launch(accelerate, [r.mass, force, a])
    r.constrain(a)
    return a


def advance(r: Recorder, y: wp.array, rate: wp.array, factor: float, y_out: wp.array) -> wp.array:
    """Record ``y_out = y + factor h rate``."""
    r.launch(step_along, [y, rate, wp.float64(factor), r.params, y_out])
    return y_out
