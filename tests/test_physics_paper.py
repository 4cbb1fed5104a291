"""``response="paper"``: one multiplier, to the letter, with the flaws it is known for; the default has none of them."""

import numpy as np
import pytest
from laboratory import Run, nail, rope
from reference import constraints, schemes

H, WEIGHT = 0.01, 10.0  # 1 kg in 10 m/s^2


def nailed(name: str, speed: float, response: str) -> Run:
    """A point of 1 kg that a nail holds at the origin; it starts with ``speed`` [m/s] upwards."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    scene = {
        "integrator": name,
        "response": response,
        "gravity": [0, 0, -WEIGHT],
        "bodies": [rope("rope", points, 2.0, 0.0)],
        "constraints": [nail("nail", "rope", 0)],
    }
    return Run(scene, v=np.array([[0.0, 0.0, speed], [0.0, 0.0, 0.0]]))


def test_midpoint_keeps_a_speed_that_jumps_and_a_force_with_it():
    """x + h v + h^2/2 (a + f) = x gives f = -a - 2 v / h, and v + h (a + f) = -v."""
    run = nailed("midpoint", 1.0, "paper")
    for k in range(40):
        run.step(H)
        sign = -1.0 if k % 2 == 0 else 1.0
        assert run.v[0, 2] == pytest.approx(sign, abs=1e-10)
        assert run.force("nail")[0, 2] == pytest.approx(WEIGHT + sign * 2.0 / H, rel=1e-10)
        assert run.x[0] == pytest.approx([0, 0, 0], abs=1e-15)


@pytest.mark.parametrize("name, force", [("velocity_verlet", 20.0), ("beeman", 15.0), ("verlet", 10.0)])
def test_forces_the_letter_reports_for_ten_newtons(name, force):
    run = nailed(name, 0.0, "paper")
    run.steps([H] * 200)
    assert run.force("nail")[0, 2] == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_the_default_stops_the_point_and_reports_its_weight(name):
    run = nailed(name, 1.0, "exact")
    run.steps([H] * 4)  # the first force takes the speed away; two-step schemes remember it for one more
    for _ in range(20):
        run.step(H)
        assert run.force("nail")[0, 2] == pytest.approx(WEIGHT, rel=1e-9)
        assert np.abs(run.v[0]).max() < 1e-13 and np.abs(run.x[0]).max() < 1e-15


@pytest.mark.parametrize("name", ["euler_cromer", "verlet"])
def test_gradual_force_grows_as_printed(name):
    """(4.5): j / n of the force that would land. Under these two d / c = 1 / h, and the way is known."""
    n, distance = 50, 0.3
    points = np.array([[0.0, 0.0, distance], [5.0, 0.0, 0.0]])
    ramp = {"steps": n, "mode": "paper"}
    scene = {
        "integrator": name,
        "response": "paper",
        "bodies": [rope("rope", points, 2.0, 0.0)],
        "constraints": [nail("nail", "rope", 0, goal=[0.0, 0.0, 0.0], ramp=ramp)],
    }
    run = Run(scene)
    for offset in constraints.gradual_approach(n, n + 5):
        run.step(H)
        assert run.x[0, 2] == pytest.approx(distance * offset, abs=1e-12)
