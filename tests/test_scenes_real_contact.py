"""The monocycle rolls on real ground and the otary's ball lies on its tray: contact and friction, joints exact beside it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle.contact.intersections import intersections
from turnbuckle.data.report import StepReport
from turnbuckle.scenes import REGISTRY
from turnbuckle.step.simulation import Simulation

CLOSED = 1e-10  # [m or rad]


def run(simulation: Simulation, seconds: float, each) -> None:
    """Steps that are all ok, with joints closed and nothing through anything; calls `each(report)`."""
    surfaces = simulation.model.surfaces
    assert surfaces is not None
    for _ in range(round(seconds / simulation.dt)):
        report: StepReport = simulation.step()
        assert report.status == "ok", report.messages
        assert report.halvings == report.last_resorts == 0
        assert max(report.position_residual["joint"], report.position_residual["joint_rotation"]) <= CLOSED
        each(report)
    assert len(intersections(surfaces, surfaces.positions(simulation.state.positions()))) == 0


@pytest.mark.parametrize("seconds", [0.4, pytest.param(2.5, marks=pytest.mark.slow)])
def test_the_wheel_rolls_on_the_ground_by_friction(seconds: float) -> None:
    """No joint ties it down: the ground carries 48 kg and turns the wheel as far as it goes."""
    radius, force = 0.8, 250.0 if seconds < 1.0 else 55.0
    scene = REGISTRY["monocycle"](contact=True, force=force, radius=radius, dt=1.0 / 120.0)
    assert not any(joint.type == "rolling" for joint in scene.definition.constraints)
    simulation = Simulation(scene)
    turned, rolled, touched, heights = [0.0], [0.0], [0], []
    before = [Rotation.from_quat(simulation.pose("wheel")[1])]

    def each(report: StepReport) -> None:
        x, q = simulation.pose("wheel")
        now = Rotation.from_quat(q)
        turned[0] += float((now * before[0].inv()).as_rotvec()[0])
        before[0] = now
        rolled[0] += float(simulation.velocity("wheel")[0][2]) * simulation.dt
        touched[0] += report.touching > 0
        heights.append(x[1])
        upright = Rotation.from_quat(simulation.pose("body")[1]).apply([0.0, 1.0, 0.0])
        assert np.arccos(upright[1]) <= 0.066 + 1e-9

    run(simulation, seconds, each)
    assert rolled[0] > 0.2
    assert rolled[0] == pytest.approx(radius * turned[0], rel=0.02, abs=2e-3)
    assert max(heights) < radius + 2e-3 and min(heights) > radius - 2e-3
    assert touched[0] > 0.5 * len(heights)


def test_without_friction_the_wheel_slips() -> None:
    """So it is friction that makes it roll: here the weight of the legs turns it on the spot."""
    simulation = Simulation(REGISTRY["monocycle"](contact=True, force=250.0, mu=0.0, dt=1.0 / 120.0))
    start = Rotation.from_quat(simulation.pose("wheel")[1])
    run(simulation, 0.2, lambda _: None)
    x, q = simulation.pose("wheel")
    turn = (Rotation.from_quat(q) * start.inv()).as_rotvec()[0]
    assert abs(0.8 * turn - x[2]) > 0.5 * max(0.8 * turn, x[2]) > 5e-3


@pytest.mark.parametrize(
    ("soft", "seconds"),
    [(False, 0.2), pytest.param(False, 3.0, marks=pytest.mark.slow), pytest.param(True, 0.3, marks=pytest.mark.slow)],
)
def test_the_ball_lies_and_rolls_on_the_tray(soft: bool, seconds: float) -> None:
    tray, ball, half = 0.38, 0.13, 0.015
    scene = REGISTRY["otary"](contact=True, soft=soft, dt=1.0 / 120.0)
    assert not any(joint.name == "on_tray" for joint in scene.definition.constraints)
    simulation = Simulation(scene)
    places, touched = [], [0]

    def each(report: StepReport) -> None:
        x, q = simulation.pose("tray")
        middle = simulation.positions("ball").mean(axis=0) if soft else simulation.pose("ball")[0]
        places.append(Rotation.from_quat(q).inv().apply(middle - x))
        touched[0] += report.touching > 0

    run(simulation, seconds, each)
    inside = np.array(places)
    away = np.hypot(inside[:, 0], inside[:, 2])
    assert away.max() < tray - 0.6 * ball, "the rim holds it"
    assert away.max() > (0.01 if seconds > 0.2 else 2e-3), "it rolls"
    height = np.abs(inside[:, 1] - (half + ball))
    assert height[away < 0.5 * tray].max() < (0.01 if soft else 3e-3), "it lies on the tray"
    assert height.max() < 0.02, "and rolls up the rim a little"
    assert touched[0] > 0.8 * len(places)
