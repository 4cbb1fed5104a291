"""Rolling without slip: balls and wheels on slopes against g sin(a) / (1 + k), a coin against the reference."""

import itertools
import math

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference import joint_rows, rigid_forms

RADIUS, MASS = 0.2, 1.7


def on_slope(share: float, slope: float, wheel: bool) -> Mechanism:
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    mechanism = Mechanism()
    inertia = share * MASS * RADIUS**2 * np.array([1.0, 1.0, 1.0])
    mechanism.body("wheel", RADIUS * normal, mass=MASS, inertia=inertia)
    rows = (joint_rows.rolling_wheel if wheel else joint_rows.rolling_ball)(RADIUS)
    more = {"axis": Y} if wheel else {}
    mechanism.joint(
        "rolling", "floor", "wheel", at=RADIUS * normal, at_b=ZERO, rows=rows, axis=normal, axis_a=Y, rolling=True,
    )  # fmt: skip
    mechanism.links[0].fields |= {"normal": normal, "radius": RADIUS, **more}
    return mechanism


@pytest.mark.parametrize("share, wheel", [(0.4, False), (0.5, True)])
def test_down_a_slope(share, wheel):
    slope, end = 0.3, 0.8
    mechanism = on_slope(share, slope, wheel)
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    simulation = mechanism.simulation()
    start = mechanism.parts[0].x
    run(simulation, end, 160)
    x, _, v, w = mechanism.places(simulation)[0]
    a = rigid_forms.rolling_acceleration(slope, share, 9.81)
    assert x == pytest.approx(start + 0.5 * a * end**2 * down, abs=1e-8)
    assert v == pytest.approx(a * end * down, abs=1e-8)
    assert w == pytest.approx([0.0, a * end / RADIUS, 0.0], abs=1e-7)
    force, _ = simulation.reaction("floor")
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    friction = MASS * (9.81 * np.sin(slope) - a)
    assert force == pytest.approx(MASS * 9.81 * np.cos(slope) * normal - friction * down, abs=1e-6)


def test_leaning_coin_follows_the_reference():
    """A thin wheel that leans, rolls and turns: holonomic in height only."""
    lean = 0.3
    axle = np.array([0.0, np.cos(lean), np.sin(lean)])
    up = Z - (Z @ axle) * axle
    up = up / np.linalg.norm(up)
    mechanism = Mechanism()
    inertia = MASS * RADIUS**2 * np.array([0.25, 0.25, 0.5])
    rotation = -(np.pi / 2 - lean) * X  # z of the body onto the axle
    place = RADIUS * up
    mechanism.body("coin", place, rotation, MASS, inertia, w=8.0 * axle + 1.0 * Z, v=[1.6, 0.0, 0.0])
    mechanism.joint(
        "rolling", "floor", "coin", at=place, at_b=ZERO, rows=joint_rows.rolling_wheel(RADIUS), axis=Z, axis_a=axle,
        rolling=True,
    )  # fmt: skip
    mechanism.links[0].fields |= {"normal": Z, "radius": RADIUS, "axis": Z}
    system = mechanism.system()
    assert system.bodies[0].R @ Z == pytest.approx(axle, abs=1e-12)
    end = 0.5
    truth = system.simulate([end], 1e-10, 1e-11)[-1]
    errors = []
    for n in (60, 120, 240):
        simulation = mechanism.simulation()
        run(simulation, end, n)
        errors.append(mechanism.errors(simulation, truth, end, system, RADIUS))
    for what in ("place", "speed", "force"):
        for coarse, fine in itertools.pairwise([e[what] for e in errors]):
            assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.4), (what, errors)
