"""An integrator of one's own, whole: leapfrog in the order drift, kick, drift.

    x_m = x + h/2 v,   v+ = v + h F(x_m) / m,   x+ = x_m + h/2 v+

Symplectic, of order 2 where forces do not depend on velocity, with one evaluation a step. A force F during the step changes the
velocity by h F / m and, through the second drift, the position by h^2/2 F / m: that is the response (c, d) of Local, equation (1),
and all that constraints need to know of a scheme.
"""

import dataclasses
import math

import numpy as np
import warp as wp

import turnbuckle
from turnbuckle.data.state import H
from turnbuckle.integrators import SCHEMES, Recorder, Scheme
from turnbuckle.integrators.scheme import accelerations, advance
from turnbuckle.math.types import real, vec3


@wp.kernel
def kick_and_drift(
    begin: int,
    params: wp.array(dtype=real),
    x_mid: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    a: wp.array(dtype=vec3),
    x_out: wp.array(dtype=vec3),
    v_out: wp.array(dtype=vec3),
):
    """The kick in the middle, and the second half of the way."""
    i = begin + wp.tid()
    h = params[H]
    v_new = v[i] + a[i] * h
    v_out[i] = v_new
    x_out[i] = x_mid[i] + v_new * (real(0.5) * h)


class Leapfrog(Scheme):
    name = "leapfrog"
    order = 2
    adds_landing = True  # the accelerations of the middle have constraint forces already

    def response(self, h: float) -> tuple[float, float]:
        return 0.5 * h * h, h

    def predict(self, r: Recorder) -> None:
        x_mid = advance(r, r.now.x, r.now.v, 0.5, r.scratch("x_mid"))
        r.forces(x_mid, r.now.v, r.ahead.force, 0.5)
        a = accelerations(r, r.ahead.force, "a")  # F / m, projected on the constraints
        r.launch(kick_and_drift, [r.params, x_mid, r.now.v, a, r.ahead.x, r.ahead.v])


SCHEMES[Leapfrog.name] = Leapfrog


def simulate(scene: turnbuckle.Scene, scheme: str) -> turnbuckle.Simulation:
    """A simulation under a scheme that scene files do not know."""
    simulation = turnbuckle.Simulation(scene)
    simulation.model = dataclasses.replace(simulation.model, integrator=scheme)
    simulation.stepper = turnbuckle.Stepper(simulation.model, simulation.state)
    return simulation


def swing(steps: int, scheme: str = "leapfrog") -> tuple[np.ndarray, float]:
    """A weight on a soft rope, nailed at its top, after 0.4 s: its place [m], and the change of energy on the way [J]."""
    scene = turnbuckle.Scene("swing", dt=0.4 / steps)
    scene.add_rope("rope", points=[[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], stretch_stiffness=80, mass=1)
    scene.add_constraint("nail", "hook", points={"body": "rope", "index": 0})
    simulation = simulate(scene, scheme)
    energy = []
    for _ in range(steps):
        report = simulation.step()
        assert report.status == "ok", report.messages
        energy.append(sum(report.energies[name] for name in ("kinetic", "elastic", "gravity")))
    return simulation.positions("rope")[2].copy(), energy[-1] - energy[0]


def main() -> None:
    """The order, by halving the step against a fine Runge-Kutta run."""
    truth, _ = swing(1600, "rk4")
    errors = []
    for steps in (50, 100, 200):
        place, gained = swing(steps)
        errors.append(float(np.abs(place - truth).max()))
        print(f"{steps:>4} steps: off by {errors[-1]:.2e} m, energy changed by {gained:.1e} J")
    print(f"order {math.log2(errors[-2] / errors[-1]):.2f}, declared {Leapfrog.order}")


if __name__ == "__main__":
    main()
