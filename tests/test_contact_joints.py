"""Joints beside contact: closed to round-off in every step, alone and where bodies hit each other."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import turnbuckle

GAP = 1e-10  # [m or rad]
GRAVITY = [0.5, 0.3, -9.81]

CURVE = {"points": [[0, 0, 0], [0.3, 0, -0.2], [0.7, 0, -0.1], [1.0, 0.2, 0.2]], "interpolation": "spline"}
PLATE = {
    "vertices": [[-2, -2, 0.25], [2, -2, -0.25], [2, 2, -0.25], [-2, 2, 0.25]],
    "triangles": [[0, 1, 2], [0, 2, 3]],
}
END = {"local_pos1": [-0.3, 0, 0]}
UP = {"local_pos0": [0, 0, 0.4], **END}
CENTRE = {"local_pos0": [0, 0, 0], "local_pos1": [0.2, 0, 0]}
CONE = {"anchor": [0, 0, 0], "axis": [1, 0, 0], "cone": 0.3}
HINGE = {"anchor": [0, 0, 0], "axis": [0, 1, 0]}


def _in_ball(p: np.ndarray) -> np.ndarray:
    """A ball of 0.5 m."""
    size = float(np.linalg.norm(p))
    return p if size <= 0.5 else 0.5 * p / size


FREE: dict[str, tuple[str, dict[str, Any]]] = {  # nothing drives them: energy cannot grow
    "ball": ("ball", {"anchor": [0, 0, 0]}),
    "revolute": ("revolute", {"anchor": [0, 0, 0], "axis": [0, 1, 0.3]}),
    "universal": ("universal", {"anchor": [0, 0, 0], "axis0": [1, 0, 0], "axis1": [0, 1, 0]}),
    "prismatic": ("prismatic", {"anchor": [0, 0, 0], "axis": [1, 0, -1]}),
    "cylindrical": ("cylindrical", {"anchor": [0, 0, 0], "axis": [1, 0, -1]}),
    "planar": ("planar", {"anchor": [0, 0, 0], "axis": [1, 0, 1]}),
    "rod": ("distance", {**UP, "min": 0.4, "max": 0.4}),
    "rope that gets tight": ("distance", {**UP, "max": 0.6}),
    "cone with its limits hit": ("cone_twist", {**CONE, "lower_limit": -0.1, "upper_limit": 0.1}),
    "ring": ("point_to_ring", {**CENTRE, "axis": [0, 1, 0.4], "min": 0.2, "max": 0.5}),
    "rolling": ("rolling", {"radius": 0.5, "axis": [0, 1, 0], "normal": [0, 0, 1], "anchor": [0.3, 0, 0]}),
    "curve": ("joint", {"curve": CURVE, **END}),
    "surface": ("joint", {"surface": PLATE, **END}),
    "domain": ("joint", {"domain": _in_ball, **END}),
}  # fmt: skip


def one(
    joint: tuple[str, dict],
    dt: float,
    contact: bool = True,
    w: list[float] | None = None,
    gravity: list[float] = GRAVITY,
) -> turnbuckle.Simulation:
    """A box of 1 kg on a joint of the world, another one far away."""
    scene = turnbuckle.Scene("one", dt=dt, gravity=gravity, **({"contact": {}} if contact else {}))
    scene.add_rigid("a", box=[0.4, 0.1, 0.2], mass=1.0, position=[0.3, 0, 0], angular_velocity=w or [0, 0, 0])
    scene.add_rigid("far", box=[0.4, 0.1, 0.2], mass=1.0, position=[0, 30, 0], motion="immobile")
    scene.add_joint(joint[0], "j", body1="a", **joint[1])
    return turnbuckle.Simulation(scene)


def closed(
    simulation: turnbuckle.Simulation, duration: float, watch: Callable | None = None
) -> list[turnbuckle.StepReport]:
    """Steps of which each is "ok" with all joints closed."""
    reports = []
    for _ in range(round(duration / simulation.dt)):
        report = simulation.step()
        assert report.status == "ok", report.messages
        assert max(report.position_residual.values(), default=0.0) < GAP
        reports.append(report)
        if watch:
            watch()
    return reports


def energies(reports: list[turnbuckle.StepReport]) -> np.ndarray:
    return np.array([sum(r.energies.values()) for r in reports])


@pytest.mark.parametrize("kind", FREE)
def test_every_kind_is_exact_and_of_order_one(kind):
    """Gaps stay closed, energy does not grow, and half the step halves the error."""
    reference = one(FREE[kind], 1 / 960, contact=False, w=[1.0, 0.5, 0.3])
    reference.run(0.1)
    errors = []
    for dt in (1 / 80, 1 / 160):
        simulation = one(FREE[kind], dt, w=[1.0, 0.5, 0.3])
        total = energies(closed(simulation, 0.1))
        assert np.diff(total).max() < 1e-9
        errors.append(float(np.linalg.norm(simulation.center("a") - reference.center("a"))))
    assert errors[0] < 0.02
    assert errors[1] < 0.7 * errors[0]


def test_rates_are_on_the_joints_too():
    """Velocities of the committed state do not lead out of a joint that turns."""
    simulation = one(FREE["ball"], 1 / 100, w=[3.0, 5.0, 2.0])
    assert max(r.rate_residual["joint"] for r in closed(simulation, 0.1)) < 1e-12


def test_a_spring_is_that_of_backward_euler_and_a_stiff_one_is_a_rod():
    """(m + h c + h^2 k) v1 = m v0 + h m g - h k z0, to round-off; 5e7 N/m stretches by the weight over k."""
    h, k, c, g = 1 / 100, 400.0, 3.0, -9.81
    simulation = one(("prismatic", {"anchor": [0, 0, 0], "axis": [0, 0, 1]}), h)
    spring = {"local_pos0": [0.3, 0, 2], "local_pos1": [0, 0, 0], "min": 2, "max": 2, "stiffness": k, "damping": c}
    simulation.add_constraint("distance", "s", body1="a", **spring)
    z = v = 0.0
    for _ in range(20):
        assert simulation.step().status == "ok"
        v = (v + h * g - h * k * z) / (1.0 + h * c + h * h * k)
        z += h * v
        assert simulation.center("a")[2] == pytest.approx(z, abs=1e-9)
    assert simulation.state.energies["elastic"] == pytest.approx(0.5 * k * z * z, rel=1e-6)
    stiff = one(("distance", {**UP, "min": 0.4, "max": 0.4, "stiffness": 5e7, "damping": 2.0}), h, w=[1.0, 0.5, 0.3])
    assert np.diff(energies(closed(stiff, 0.1))).max() < 1e-9
    assert stiff.coordinate("j")["distance"] == pytest.approx(0.4, abs=1e-5)


@pytest.mark.parametrize(("limit", "rest"), [(0.4, 0.4), (0.0, 0.0)])
def test_a_hinge_rests_at_its_limit(limit, rest):
    simulation = one(("revolute", {**HINGE, "lower_limit": -0.1, "upper_limit": limit}), 1 / 60)
    twists: list[float] = []
    reports = closed(simulation, 0.8, lambda: twists.append(simulation.coordinate("j")["twist"]))
    assert max(twists) < limit + GAP
    assert twists[-1] == pytest.approx(rest, abs=1e-10)
    assert np.diff(energies(reports)).max() < 1e-9
    torque = simulation.reaction("j")[1]
    assert torque[1] == pytest.approx(-9.81 * 0.3 * np.cos(rest) + 0.5 * 0.3 * np.sin(rest), rel=1e-3)


def test_a_limit_lets_go():
    """Thrown up against its upper stop, a rod falls back from it."""
    simulation = one(("revolute", {**HINGE, "lower_limit": -0.2}), 1 / 120)
    simulation.set_velocity("a", [0, 0, 1.8], [0, -6.0, 0])
    twists: list[float] = []
    closed(simulation, 0.4, lambda: twists.append(simulation.coordinate("j")["twist"]))
    assert min(twists) == pytest.approx(-0.2, abs=1e-10)
    assert twists[-1] > 0.3


def test_motors_reach_their_rate_and_their_bound():
    strong = one(("revolute", {**HINGE, "motor": {"on": "twist", "target_velocity": 2.0}}), 1 / 120)
    closed(strong, 0.25)
    assert strong.coordinate("j")["twist"] == pytest.approx(0.5, abs=1e-10)
    weak = one(("revolute", {**HINGE, "motor": {"on": "twist", "target_velocity": -2.0, "max_force": 0.5}}), 1 / 240)
    free, driven = one(("revolute", HINGE), 1 / 240), []
    closed(free, 0.1)
    closed(weak, 0.1)
    inertia = (0.4**2 + 0.2**2) / 12 + 0.3**2
    driven = free.velocity("a")[1][1] - weak.velocity("a")[1][1]
    assert driven == pytest.approx(0.5 * 0.1 / inertia, rel=0.05)
    blocked = one(
        ("revolute", {**HINGE, "upper_limit": 0.3, "motor": {"on": "twist", "target_velocity": 2.0}}), 1 / 120
    )
    closed(blocked, 0.5)
    assert blocked.coordinate("j")["twist"] == pytest.approx(0.3, abs=1e-10)


def bars(scene: turnbuckle.Scene, places: list[list[float]], closing: list[float] | None = None) -> None:
    """Bars from place to place, hinged to each other and at the first place; the last one to the world at ``closing``."""
    for k, (a, b) in enumerate(zip(places[:-1], places[1:], strict=True)):
        p, q = np.array(a), np.array(b)
        angle = -np.arctan2((q - p)[2], (q - p)[0])
        scene.add_rigid(
            f"bar{k}",
            box=[float(np.linalg.norm(q - p)), 0.05, 0.05],
            mass=1.0,
            position=0.5 * (p + q),
            rotation=[0, angle, 0],
        )
        below = {"body0": f"bar{k - 1}"} if k else {}
        scene.add_joint("revolute", f"hinge{k}", body1=f"bar{k}", anchor=a, axis=[0, 1, 0], **below)
    if closing is not None:
        scene.add_joint("revolute", "closing", body1=f"bar{len(places) - 2}", anchor=closing, axis=[0, 1, 0])


def test_four_bars_and_a_slider_crank_are_loops_that_stay_closed():
    """Redundant rows (plane mechanisms in space) do no harm."""
    scene = turnbuckle.Scene("loops", dt=1 / 240, gravity=[0, 0, -9.81], contact={"jointed": False})
    bars(scene, [[0, 0, 0], [0.2, 0, 0.5], [1.1, 0, 0.7], [1.0, 0, 0]], closing=[1.0, 0, 0])
    scene.set_contact(ignore=[["bar0", "bar2"]])
    total = energies(closed(turnbuckle.Simulation(scene), 0.2))
    assert np.diff(total).max() < 1e-9
    scene = turnbuckle.Scene("crank", dt=1 / 240, gravity=[0, 0, -9.81], contact={})
    bars(scene, [[0, 0, 0], [0, 0, 0.4], [1.0, 0, 0]])
    scene.add_rigid("piston", box=[0.2, 0.2, 0.2], mass=2.0, position=[1.0, 0, 0])
    scene.add_joint("ball", "pin", body0="bar1", body1="piston", anchor=[1.0, 0, 0])
    scene.add_joint("prismatic", "slide", body1="piston", anchor=[1.0, 0, 0], axis=[1, 0, 0])
    simulation = turnbuckle.Simulation(scene)
    simulation.set_velocity("bar0", [1.0, 0, 0], [0, 5.0, 0])
    simulation.step()
    total = energies(closed(simulation, 0.25))
    assert np.diff(total).max() < 1e-9


def test_a_chain_of_twenty_boxes():
    scene = turnbuckle.Scene("chain", dt=1 / 240, gravity=[0, 0, -9.81], contact={})
    for k in range(20):
        scene.add_rigid(f"b{k}", box=[0.2, 0.05, 0.05], mass=0.2, position=[0.2 * k + 0.1, 0, 0])
        below = {"body0": f"b{k - 1}"} if k else {}
        scene.add_joint("ball", f"j{k}", body1=f"b{k}", anchor=[0.2 * k, 0, 0], **below)
    simulation = turnbuckle.Simulation(scene)
    total = energies(closed(simulation, 0.15))
    assert np.diff(total).max() < 1e-9
    assert simulation.center("b19")[2] < -0.09


def test_a_weld_is_one_body():
    """Two halves that are welded fly as the whole does."""
    ends = []
    for boxes in (
        [("whole", [0.8, 0.1, 0.2], 2.0, [0.2, 0, 0])],
        [("a", [0.4, 0.1, 0.2], 1.0, [0, 0, 0]), ("b", [0.4, 0.1, 0.2], 1.0, [0.4, 0, 0])],
    ):
        scene = turnbuckle.Scene("weld", dt=1 / 240, gravity=[0, 0, 0], contact={})
        spin = np.array([0.0, 0.0, 2.0])
        for name, size, mass, place in boxes:
            scene.add_rigid(
                name,
                box=size,
                mass=mass,
                position=place,
                angular_velocity=spin,
                velocity=np.cross(spin, np.array(place) - [0.2, 0, 0]),
            )
        scene.add_rigid("far", box=[0.1] * 3, mass=1.0, position=[0, 30, 0])
        if len(boxes) > 1:
            scene.add_joint("weld", "w", body0="a", body1="b", anchor=[0.2, 0, 0])
        simulation = turnbuckle.Simulation(scene)
        closed(simulation, 0.2)
        ends.append(simulation.velocity(boxes[0][0])[1])
    assert np.abs(ends[0] - ends[1]).max() < 0.01 * 2.0


def test_a_hinged_door_is_hit():
    """Two hinges repeat rows of each other. Momentum about their axis is kept by the blow, the gap is certified."""
    scene = turnbuckle.Scene("door", dt=1 / 240, gravity=[0, 0, 0], contact={"friction": 0.3})
    scene.add_rigid("door", box=[1.0, 0.05, 2.0], mass=10, position=[0.55, 0, 0])
    for k, z in enumerate((-0.8, 0.8)):
        scene.add_joint("revolute", f"h{k}", body1="door", anchor=[0, 0, z], axis=[0, 0, 1])
    scene.add_rigid(
        "box", box=[0.3] * 3, mass=3, position=[0.8, -0.4, 0], velocity=[0, 4.0, 0.5], rotation=[0.3, 0.2, 0.1]
    )
    simulation = turnbuckle.Simulation(scene)
    door = 10 * ((1.0 + 0.05**2) / 12 + 0.55**2)

    def momentum() -> float:
        v, w = simulation.velocity("box")
        box = 3 * (0.3**2 / 6) * w[2] + 3 * np.cross(simulation.center("box"), v)[2]
        return float(box + door * simulation.velocity("door")[1][2])

    before = momentum()
    reports = closed(simulation, 0.2)
    assert max(r.contacts for r in reports) > 0
    assert min(r.smallest_gap for r in reports if r.smallest_gap is not None) > 0.0
    assert simulation.velocity("door")[1][2] > 0.5
    assert momentum() == pytest.approx(before, rel=0.01)
    assert np.diff(energies(reports)).max() < 1e-6


def test_a_jointed_figure_falls_on_the_floor_and_comes_to_rest():
    scene = turnbuckle.Scene("figure", dt=1 / 200, gravity=[0, 0, -9.81], contact={})
    scene.add_obstacle("floor", box=[6, 6, 0.2], position=[0, 0, -0.1])
    kinds = [("ball", {}), ("revolute", {"axis": [0, 1, 0], "lower_limit": -0.6, "upper_limit": 0.6}),
             ("cone_twist", {"axis": [1, 0, 0], "cone": 0.4, "lower_limit": -0.3, "upper_limit": 0.3})]  # fmt: skip
    for k in range(5):
        scene.add_rigid(
            f"b{k}",
            box=[0.24, 0.08, 0.08],
            mass=0.5,
            position=[0.3 * k, 0, 0.15 + 0.02 * k],
            angular_velocity=[1.0, 0, 0],
        )
        if k:
            kind, more = kinds[k % 3]
            scene.add_joint(
                kind, f"j{k}", body0=f"b{k - 1}", body1=f"b{k}", anchor=[0.3 * k - 0.15, 0, 0.14 + 0.02 * k], **more
            )
    simulation = turnbuckle.Simulation(scene)
    reports = closed(simulation, 0.7)
    assert min(r.smallest_gap for r in reports if r.smallest_gap is not None) > 0.0
    assert np.diff(energies(reports)).max() < 1e-4
    speeds = [np.abs(np.concatenate(simulation.velocity(f"b{k}"))).max() for k in range(5)]
    assert max(speeds) < 0.05
    assert all(0.03 < simulation.center(f"b{k}")[2] < 0.09 for k in range(5))


def test_nails_attachments_joints_and_contact_are_one_problem():
    """A cloth is nailed at one side and attached to a hinged arm at the other; a box falls into it."""
    scene = turnbuckle.Scene("all", dt=1 / 200, gravity=[0, 0, -9.81], contact={"friction": 0.3})
    scene.add_cloth("cloth", size=[0.8, 0.6], cells=[10, 8], density=0.5, structural_stiffness=400.0,
                    shear_stiffness=200.0, bend_stiffness=1.0, damping=0.05)  # fmt: skip
    scene.add_rigid("arm", box=[0.1, 0.5, 0.1], mass=1.0, position=[0.85, 0.3, 0.0])
    scene.add_rigid("box", box=[0.2, 0.2, 0.2], mass=0.3, position=[0.4, 0.3, 0.2])
    scene.add_joint(
        "revolute", "hinge", body1="arm", anchor=[0.85, 0.3, 0.3], axis=[0, 1, 0], lower_limit=-1.0, upper_limit=1.0
    )
    scene.add_constraint("nail", "nail", points={"body": "cloth", "side": "-x"})
    ends = np.flatnonzero(np.abs(turnbuckle.Simulation(scene).positions("cloth")[:, 0] - 0.8) < 1e-9)
    scene.add_constraint(
        "attach",
        "hooks",
        points={"body": "cloth", "indices": [int(ends[2]), int(ends[5])]},
        to={"body": "arm", "nearest": "triangle"},
    )
    simulation = turnbuckle.Simulation(scene)
    side = np.flatnonzero(simulation.positions("cloth")[:, 0] < 1e-9)
    start = simulation.positions("cloth")[side].copy()

    group = simulation.state.groups["hooks"]
    assert simulation.state.follows[group.points].any()

    def exact() -> None:
        assert np.abs(simulation.positions("cloth")[side] - start).max() < GAP
        p = simulation.positions()
        for places in np.split(group.points, group.offsets[1:-1]):
            assert len(places) == 4
            corners, weights = p[places[1:]], _weights(p0[places[1:]], p0[places[0]])
            assert np.abs(p[places[0]] - weights @ corners).max() < GAP

    p0 = simulation.positions().copy()
    reports = closed(simulation, 0.35, exact)
    assert max(r.contacts for r in reports) > 3
    assert min(r.smallest_gap for r in reports if r.smallest_gap is not None) > 0.0
    assert simulation.center("box")[2] > -0.3
    assert abs(simulation.coordinate("hinge")["twist"]) > 0.01


def _weights(corners: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Of a point in the plane of a triangle, the weights of its corners."""
    return np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), np.append(p, 1.0), rcond=None)[0]


def test_reactions_carry_the_weight_and_joints_break():
    simulation = one(("ball", {"anchor": [0.3, 0, 0.05]}), 1 / 240, gravity=[0, 0, -9.81])
    closed(simulation, 0.02)
    assert simulation.reaction("j")[0] == pytest.approx([0, 0, 9.81], abs=1e-6)
    weak = one(("ball", {"anchor": [0.3, 0, 0.05], "break_force": 5.0}), 1 / 240)
    report = weak.step()
    assert report.broken == ["j"]
    weak.run(0.1)
    assert weak.center("a")[2] < -0.03


def test_joints_are_switched_added_and_follow_a_script():
    simulation = one(("revolute", HINGE), 1 / 240)
    closed(simulation, 0.05)
    simulation.switch("j", False)
    v = simulation.velocity("a")[0]
    simulation.step()
    assert simulation.velocity("a")[0] == pytest.approx(v + np.array(GRAVITY) / 240, abs=1e-6)
    simulation.add_constraint("ball", "new", body1="a", anchor=list(simulation.center("a")))
    closed(simulation, 0.1)
    scene = turnbuckle.Scene("script", dt=1 / 240, gravity=[0, 0, -9.81], contact={})
    scene.add_rigid(
        "hand",
        box=[0.1] * 3,
        mass=1.0,
        motion="trajectory",
        trajectory={"times": [0, 1], "positions": [[0, 0, 0], [1, 0, 0]], "interpolation": "linear"},
    )
    scene.add_rigid("a", box=[0.1, 0.1, 0.4], mass=1.0, position=[0, 0, -0.3])
    scene.add_joint("ball", "grip", body0="hand", body1="a", anchor=[0, 0, 0])
    carried = turnbuckle.Simulation(scene)
    closed(carried, 0.3)
    assert carried.pose("hand")[0] == pytest.approx([0.3, 0, 0], abs=1e-9)
    assert carried.center("a")[0] > 0.1
