"""The ready scenes of articulated bodies: they start closed, move as their stories say, and stay closed on the way."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle.data.report import StepReport
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes import REGISTRY
from turnbuckle.scenes.closed_chain import hanging_slopes
from turnbuckle.step.simulation import Simulation

G = 9.81


def run(simulation: Simulation, seconds: float, each=None) -> None:
    """Steps for `seconds`, all `ok`, every joint closed; calls `each(report)` after each step."""
    for _ in range(round(seconds / simulation.dt)):
        report = simulation.step()
        assert report.status == "ok", report.messages
        assert report.position_residual["joint"] <= 1e-10
        assert report.position_residual["joint_rotation"] <= 1e-10
        if each is not None:
            each(report)


def point(simulation: Simulation, body: str, local: object) -> np.ndarray:
    """Where a point of a body is [m]."""
    x, q = simulation.pose(body)
    return x + Rotation.from_quat(q).apply(np.asarray(local, dtype=float))


def start_gaps(scene: Scene) -> tuple[float, float]:
    """Worst distance [m] of points that a joint holds together and worst excess of an angle [rad], from the definition."""
    bodies = {body.name: body for body in scene.definition.bodies}

    def frame(name: str | None) -> tuple[np.ndarray, Rotation]:
        if name is None:
            return np.zeros(3), Rotation.identity()
        return np.array(bodies[name].position), Rotation.from_rotvec(np.array(bodies[name].rotation))

    gap = excess = 0.0
    for joint in scene.definition.constraints:
        if not hasattr(joint, "body1"):
            continue
        (x0, q0), (x1, q1) = frame(joint.body0), frame(joint.body1)
        domain = any(getattr(joint, name, None) is not None for name in ("axial", "planar", "normal"))
        if joint.local_pos0 is not None and not domain:
            places = x0 + q0.apply(np.array(joint.local_pos0)), x1 + q1.apply(np.array(joint.local_pos1))
            gap = max(gap, float(np.linalg.norm(places[0] - places[1])))
        angle = getattr(joint, "angle", None)
        if angle is not None:
            a, b = q0.apply(np.array(angle.axis0)), q1.apply(np.array(angle.axis1))
            found = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
            excess = max(excess, found - (np.pi if angle.max is None else angle.max), angle.min - found)
    return gap, excess


def kinds(scene: Scene) -> dict[str, int]:
    """Bodies and constraints by type."""
    items = [*scene.definition.bodies, *scene.definition.constraints]
    return {kind: sum(item.type == kind for item in items) for kind in {item.type for item in items}}


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("closed_chain", {}),
        ("closed_chain", {"n": 7, "span": 0.3, "tilt": -2.0}),
        ("four_bars", {"n": 5}),
        ("bricard", {}),
        ("monocycle", {}),
        ("monocycle", {"crank": 4.0, "radius": 0.65}),
        ("snake", {}),
        ("otary", {}),
        ("puppet", {}),
    ],
)
def test_every_joint_is_closed_at_the_start(name: str, options: dict) -> None:
    gap, excess = start_gaps(REGISTRY[name](**options))
    assert gap <= 1e-14 and excess <= 1e-12


def test_counts() -> None:
    assert kinds(REGISTRY["closed_chain"]()) == {"rigid": 100, "ball": 101}
    assert kinds(REGISTRY["four_bars"](n=40)) == {"rigid": 81, "revolute": 121}
    assert kinds(REGISTRY["bricard"]()) == {"rigid": 5, "joint": 6}
    assert kinds(REGISTRY["snake"]()) == {"rigid": 7, "coating": 6, "ball": 5, "joint": 1}  # the rod is the seventh
    assert kinds(REGISTRY["monocycle"]()) == {"rigid": 8, "joint": 12, "rolling": 1}
    # Appendix A prints seven points to point with an angle, two alone, and three angles alone, one of them to the world.
    # The angle of the right ankle, 9, limits nothing, which leaves the six of section 5.3.
    joints = [c for c in REGISTRY["monocycle"]().definition.constraints if c.type == "joint"]
    both = [c for c in joints if c.angle is not None and c.local_pos0 is not None]
    assert (len(both), sum(c.angle is None for c in joints), sum(c.local_pos0 is None for c in joints)) == (7, 2, 3)
    assert sum(c.angle.max < np.pi for c in both) == 6


def test_chain_at_rest_stays_and_pulls_as_statics_says() -> None:
    n = 20
    simulation = Simulation(REGISTRY["closed_chain"](n=n, tilt=0.0))
    start = simulation.pose("box_10")[0]
    run(simulation, 0.5)
    assert np.abs(simulation.pose("box_10")[0] - start).max() < 1e-9
    _, pull = hanging_slopes(n, 0.7)
    # On box_0 at the left end: half the weight up, the pull to the left.
    force, torque = simulation.reaction("joint_0")
    assert force == pytest.approx([-pull * G, 0.0, 0.5 * n * G], rel=1e-6, abs=1e-6)
    assert torque == pytest.approx(np.zeros(3), abs=1e-9)


def test_chain_swings_and_stays_closed() -> None:
    simulation = Simulation(REGISTRY["closed_chain"](n=100))
    start = simulation.pose("box_50")[0]
    run(simulation, 1.5)
    assert np.linalg.norm(simulation.pose("box_50")[0] - start) > 3.0
    report = simulation.step()
    assert report.position_residual["joint"] <= 1e-10


def test_four_bars_go_around_through_their_singular_position() -> None:
    simulation = Simulation(REGISTRY["four_bars"](n=2))
    report = simulation.step()
    energy = report.energies["kinetic"] + report.energies["gravity"]
    lowest = [1.0]

    def each(_: StepReport) -> None:
        feet = [point(simulation, f"upright_{i}", [0.0, 0.5, 0.0]) - [i, 0.0, 0.0] for i in range(3)]
        assert np.ptp(feet, axis=0).max() < 1e-8  # the windows stay parallel through the singular position
        lowest[0] = min(lowest[0], feet[0][1])

    run(simulation, 1.8, each)
    assert lowest[0] < -0.999  # it passed level twice at least: down on one side, up on the other
    report = simulation.step()
    assert report.energies["kinetic"] + report.energies["gravity"] == pytest.approx(energy, abs=0.02)


def test_bricard_moves_though_it_should_not() -> None:
    simulation = Simulation(REGISTRY["bricard"]())
    energies = []

    def each(report: StepReport) -> None:
        energies.append(report.energies["kinetic"] + report.energies["gravity"])

    start = point(simulation, "rod_2", [0.0, 0.0, 0.5])
    run(simulation, 1.0, each)
    assert np.linalg.norm(point(simulation, "rod_2", [0.0, 0.0, 0.5]) - start) > 0.5
    assert np.ptp(energies) < 1e-3


def test_snake_slides_right_swings_and_flies_back() -> None:
    simulation = Simulation(REGISTRY["snake"](flesh=0.0, dt=1.0 / 480.0))
    tail = []
    run(simulation, 1.6, lambda _: tail.append(simulation.coordinate("rod_slide")["place"]))
    path, seconds = np.array(tail), np.arange(1, len(tail) + 1) / 480.0
    assert np.abs(path).max() <= 0.55 + 1e-9
    right = seconds[path > 0.55 - 1e-6]
    left = seconds[path < -0.55 + 1e-6]
    assert abs(path[seconds < 0.15]).max() < 0.05  # it falls before it slides
    assert 0.3 < right[0] < 0.8 and 1.1 < left[0] < 1.6  # stopped on the right, then on the left
    assert simulation.pose("head")[0][0] < 0.0


def test_monocycle_turns_its_crank_without_slip() -> None:
    radius = 0.8
    simulation = Simulation(REGISTRY["monocycle"](radius=radius))

    def crank() -> Rotation:
        body, wheel = (Rotation.from_quat(simulation.pose(name)[1]) for name in ("body", "wheel"))
        return body.inv() * wheel

    turned, slipped, rolled, before = [0.0], [0.0], [0.0], [crank()]

    def each(_: StepReport) -> None:
        now = crank()
        turned[0] += float((now * before[0].inv()).as_rotvec()[0])
        before[0] = now
        # The point of the wheel that touches the floor does not move.
        axle = Rotation.from_quat(simulation.pose("wheel")[1]).apply([1.0, 0.0, 0.0])
        up = np.array([0.0, 1.0, 0.0]) - axle[1] * axle
        v, w = simulation.velocity("wheel")
        slipped[0] += float(np.linalg.norm(v - radius * np.cross(w, up / np.linalg.norm(up)))) * simulation.dt
        rolled[0] += float(np.linalg.norm(v)) * simulation.dt
        upright = Rotation.from_quat(simulation.pose("body")[1]).apply([0.0, 1.0, 0.0])
        assert np.arccos(upright[1]) <= 0.066 + 1e-9

    start = simulation.pose("wheel")[0]
    run(simulation, simulation.scene.definition.duration, each)
    assert turned[0] > 5 * 2.0 * np.pi
    assert slipped[0] < 1e-9 * rolled[0]
    assert rolled[0] == pytest.approx(radius * turned[0], rel=0.01)
    assert (simulation.pose("wheel")[0] - start)[2] > 25.0


def test_ball_stays_on_the_tray() -> None:
    simulation = Simulation(REGISTRY["otary"](soft=False, dt=1.0 / 240.0))
    places, heads = [], []

    def each(_: StepReport) -> None:
        x, q = simulation.pose("tray")
        turn = Rotation.from_quat(q)
        places.append(turn.inv().apply(simulation.pose("ball")[0] - x))
        heads.append(simulation.pose("head")[0])
        assert np.arccos(np.clip(turn.apply([0.0, 1.0, 0.0])[1], -1.0, 1.0)) <= 0.06 + 1e-9

    run(simulation, 4.0, each)
    inside = np.array(places)
    assert np.abs(inside[:, 1] - (0.015 + 0.13)).max() < 1e-9
    away = np.hypot(inside[:, 0], inside[:, 2])
    assert away.max() <= 0.38 - 0.065 + 1e-9 and away.max() > 0.1  # it rolls about
    assert np.ptp(heads, axis=0).max() > 0.1  # the otary moves


@pytest.mark.parametrize("name", ["snake", "otary", "puppet"])
def test_coats_hold_on_their_kernels(name: str) -> None:
    simulation = Simulation(REGISTRY[name]())
    start = simulation.positions().copy()
    run(simulation, 60 * simulation.dt)
    assert np.linalg.norm(simulation.positions() - start, axis=1).max() > 1e-3
