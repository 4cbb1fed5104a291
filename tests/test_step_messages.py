"""What steps say: once, by name, with advice that helps."""

import numpy as np
import pytest
from rigid_scene_example import ball, box

import turnbuckle
from turnbuckle.data.report import StepReport, merge_reports
from turnbuckle.solvers.displacement.options import DisplacementResult


def test_halves_of_a_step_say_the_same_once() -> None:
    first = StepReport("degraded", dt=0.1, broken=["a"])
    first.messages = [
        "joints that cannot be closed: 'b1' by 2e-01 m, 'b2' by 1e-01 m",
        "3 constraints ramp",
        "broke: a",
    ]
    second = StepReport("degraded", dt=0.1, time=0.2, broken=["b"])
    second.messages = ["joints that cannot be closed: 'b2' by 3e-01 m", "2 constraints ramp", "broke: b", "new"]
    report = merge_reports(first, second)
    expected = ["joints that cannot be closed: 'b2' by 3e-01 m", "2 constraints ramp", "new", "broke: a, b"]
    assert report.messages == expected and report.broken == ["a", "b"]
    assert (report.dt, report.time, report.halvings, report.status) == (0.2, 0.2, 1, "degraded")


def test_a_joint_of_many_parts_is_named_once() -> None:
    """Two hinges a body apart cannot both hold one body."""
    hinge = {"type": "revolute", "body1": "b", "local_pos1": [0, 0, 0], "axis": [0, 0, 1]}
    joints = [{**hinge, "name": n, "local_pos0": p} for n, p in (("here", [0, 0, 0]), ("there", [0, 0.5, 0]))]
    scene = turnbuckle.Scene("torn", dt=1e-3, gravity=[0, 0, 0], bodies=[box("b", [0, 0.2, 0])], constraints=joints)
    report = turnbuckle.Simulation(scene).step()
    assert report.status in ("degraded", "failed")
    text = " ".join(report.messages)
    assert "'here'" in text or "'there'" in text
    assert text.count("'here'") <= 1 and text.count("'there'") <= 1


def result(history: list[float]) -> DisplacementResult:
    none = np.zeros((0, 3))
    size = np.array([history[-1]])
    return DisplacementResult(none, none, none, len(history) - 1, False, ["j"], size, np.zeros(1), history)


@pytest.mark.parametrize(
    ("history", "what"),
    [
        (list(0.9 ** np.arange(100)), "allow more iterations"),
        ([*(0.5 ** np.arange(10)), *[0.5**9] * 90], "more iterations hardly help: look for joints that contradict"),
        ([1.0, 3.0, 9.0, np.inf], "the corrections diverge"),
    ],
)
def test_advice_of_the_displacement_solver(history: list[float], what: str) -> None:
    text = result(history).warning()
    assert text.startswith("displacement: ") and "'j'" in text and what in text
    assert ("allow more iterations" in text) == (what == "allow more iterations")


def test_the_displacement_solver_tells_of_speeds_that_open_joints() -> None:
    """A joint that starts 0.1 m open is closed in a step of 1 ms: what is left are speeds of 100 m/s."""
    scene = turnbuckle.Scene("blow", dt=1e-3, gravity=[0, 0, 0], solver="displacement", bodies=[box("b", [0, 0, 0])])
    scene.add_constraint(**{**ball("j", None, "b", [0, 0, 0]), "anchor": None, "local_pos0": [0.1, 0, 0],
                            "local_pos1": [0, 0, 0]})  # fmt: skip
    report = turnbuckle.Simulation(scene).step()
    assert report.rate_residual["joint"] == pytest.approx(100.0, rel=0.1)
    assert report.status == "degraded"
    assert "joints move apart: 'j' at 1e+02 m/s" in report.messages[0] and "assemble" in report.messages[0]
    closed = turnbuckle.Scene("still", dt=1e-3, solver="displacement", bodies=[box("b", [0.1, 0, 0])])
    closed.add_constraint(**ball("j", None, "b", [0, 0, 0]))
    assert turnbuckle.Simulation(closed).step().status == "ok"
