"""Every joint leaves free what it should and holds the rest: a body hangs on a swinging one by each joint in turn.

Positions, speeds and reactions follow the reference with an error that falls with h^2; what is held is held to 1e-10.
"""

import itertools
import math

import numpy as np
import pytest
from mechanism import Mechanism, Z, frame_of, run
from reference import joint_rows
from reference.multibody import System

import turnbuckle

END = 0.3  # [s]
COUNTS = (24, 48, 96)
AXIS = np.array([0.3, -0.5, 0.8]) / math.sqrt(0.98)
ACROSS = frame_of(AXIS)[:, 0]
SLANTED = math.cos(0.6) * AXIS + math.sin(0.6) * ACROSS
PLACE = np.array([0.5, 0.1, 0.3])
FULL = np.array([[0.05, 0.01, -0.004], [0.01, 0.07, 0.006], [-0.004, 0.006, 0.04]])
KINDS = (
    "ball", "revolute", "universal", "prismatic", "cylindrical", "planar", "weld", "distance", "line", "plane", "angle",
    "twist", "fixed_rotation",
)  # fmt: skip


def two_bodies(kind: str) -> Mechanism:
    """A body on a ball joint of the world, and a second one on it by a joint of ``kind``."""
    mechanism = Mechanism()
    mechanism.body("base", [0.2, 0.0, 0.1], [0.4, -0.2, 0.3], 1.3, FULL, center=[0.03, -0.02, 0.05], w=[1.0, -2.0, 1.5])
    mechanism.body(
        "arm", [0.7, 0.2, 0.4], [-0.3, 0.5, 0.8], 0.8, 0.6 * FULL[::-1, ::-1], center=[-0.05, 0.04, 0.02],
        v=[0.6, -0.3, 0.4], w=[-1.2, 0.8, 2.0],
    )  # fmt: skip
    mechanism.joint("ball", "world", "base")
    pair = ("joint", "arm", "base", PLACE)
    axes = {"axis0": mechanism.direction("base", AXIS), "axis1": mechanism.direction("arm", AXIS)}
    if kind == "universal":
        mechanism.joint("universal", *pair, axis=AXIS, axis_a=ACROSS)
    elif kind == "distance":
        far = PLACE + np.array([0.1, 0.2, -0.2])
        mechanism.joint("distance", *pair, at_b=far, rows=joint_rows.distance(0.3), min=0.3, max=0.3)
    elif kind == "line":
        mechanism.joint("joint", *pair, axis=AXIS, rows=joint_rows.line, axial={"axis": axes["axis0"]})
    elif kind == "plane":
        mechanism.joint("point_to_ring", *pair, axis=AXIS, rows=joint_rows.plane)
    elif kind == "angle":
        cone = {"axis0": axes["axis0"], "axis1": mechanism.direction("arm", SLANTED), "min": 0.6, "max": 0.6}
        rows = both(joint_rows.ball, joint_rows.angle(0.6))
        mechanism.joint("joint", *pair, axis=AXIS, axis_a=SLANTED, rows=rows, angle=cone)
    elif kind == "twist":
        # also far from parallel axes the twist is that of swing and twist: the first swing is 0.6 rad, the twist nothing
        swung = frame_of(SLANTED, math.cos(0.6) * ACROSS - math.sin(0.6) * AXIS)
        rows = both(joint_rows.ball, joint_rows.twist)
        limits = {
            "axis0": axes["axis0"], "axis1": mechanism.direction("arm", SLANTED),
            "vector0": mechanism.direction("base", ACROSS), "vector1": mechanism.direction("arm", swung[:, 0]),
            "min": 0.0, "max": 0.0,
        }  # fmt: skip
        mechanism.joint("joint", *pair, axis=AXIS, axis_a=SLANTED, x_a=swung[:, 0], rows=rows, twist=limits)
    elif kind == "fixed_rotation":
        mechanism.joint("joint", *pair, rows=joint_rows.same_rotation, fixed_rotation=True)
        link = mechanism.links[-1]
        del link.fields["local_pos0"], link.fields["local_pos1"]
    else:
        mechanism.joint(kind, *pair, axis=AXIS)
    return mechanism


def both(*parts):
    """The rows of several conditions."""
    return lambda *pose: np.concatenate([part(*pose) for part in parts], axis=-1)


def errors(mechanism: Mechanism, system: System, truth: np.ndarray, n: int, **scene) -> dict[str, float]:
    simulation = mechanism.simulation(**scene)

    def held(report):
        assert "joint" in report.position_residual or "joint_rotation" in report.position_residual
        assert max(report.position_residual.values()) < 1e-10
        assert max(report.rate_residual.values()) < 1e-10

    run(simulation, END, n, held)
    # measured by the reference too, with rows of its own
    place, rate = system.residual(mechanism.state_of(simulation))
    assert place < 2e-10 and rate < 3e-10
    return mechanism.errors(simulation, truth, END, system)


@pytest.mark.parametrize("kind", KINDS)
def test_second_order_in_place_speed_and_reaction(kind):
    mechanism = two_bodies(kind)
    system = mechanism.system()
    truth = system.simulate([END], 1e-11, 1e-12)[-1]
    moved = np.linalg.norm(truth[3:6] - mechanism.parts[1].x)
    assert moved > 0.05
    seen = [errors(mechanism, system, truth, n) for n in COUNTS]
    for what in ("place", "speed", "force", "torque"):
        values = [e[what] for e in seen]
        if values[0] < 1e-9:  # nothing there: a ball joint has no torque
            continue
        for coarse, fine in itertools.pairwise(values):
            assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.35), (what, values)
    assert seen[-1]["place"] < 2e-4 and seen[-1]["speed"] < 5e-3


def test_a_body_without_joints_falls_and_turns_as_it_should():
    mechanism = Mechanism()
    mechanism.body(
        "alone", [0.2, 0.0, 0.1], [0.4, -0.2, 0.3], 1.3, FULL, center=[0.1, -0.2, 0.05], v=[1.0, 2.0, 3.0], w=5.0 * Z
    )
    system = mechanism.system()
    truth = system.simulate([END])[-1]
    simulation = mechanism.simulation()
    run(simulation, END, 24)
    seen = mechanism.errors(simulation, truth, END, system)
    assert seen["place"] < 1e-9 and seen["speed"] < 1e-9


def test_torque_that_changes_with_time_is_met_in_second_order():
    def loads(t, x, r, v, w):
        return np.array([[math.sin(5 * t), 0.3, 0.0]]), np.array([[0.0, 0.2 * math.cos(4 * t), 0.1 * t]])

    mechanism = Mechanism(loads=loads)
    mechanism.body("alone", [0.2, 0.0, 0.1], [0.4, -0.2, 0.3], 1.3, FULL, w=[2.0, -1.0, 3.0])
    system = mechanism.system()
    truth = system.simulate([END], 1e-11, 1e-12)[-1]
    seen = []
    for n in COUNTS:
        scene = mechanism.scene()
        torque = [0.0, "0.2*cos(4*t)", "0.1*t"]
        scene.add_force("shake", body="alone", expression=["sin(5*t)", 0.3, 0.0], torque=torque)
        simulation = turnbuckle.Simulation(scene)
        run(simulation, END, n)
        seen.append(mechanism.errors(simulation, truth, END, system))
    for what in ("place", "speed"):
        for coarse, fine in itertools.pairwise([e[what] for e in seen]):
            assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.35), (what, seen)
