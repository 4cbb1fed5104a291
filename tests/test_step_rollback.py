"""A step that fails leaves no trace, also where its first half was already done."""

from dataclasses import fields

import numpy as np
import pytest
from rigid_scene_example import bits, box, mechanisms

import turnbuckle
from turnbuckle.data.state import State
from turnbuckle.step.snapshot import VALUES

DEVICE_PARTS = ("now", "rigid", "tables", "nailed", "external")  # arrays, copied one by one
NOT_OF_A_STEP = (  # what only the user's calls between two steps change, or what each step writes before it reads
    "params", "loads", "parts", "gravity", "domains", "scene_parts", "group_count", "scene_groups", "follows", "layout",
)  # fmt: skip
HOST_PARTS = ("groups", "joints")
WRITTEN_ANEW = (".force", ".point_force", ".goal", ".goal_now", ".rate", ".acceleration", "_residual")  # in tables


class Wind:
    """A force that may be told to fail in one of its next calls."""

    def __init__(self) -> None:
        self.calls, self.fails_at = 0, 0

    def __call__(self, x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.calls == self.fails_at:
            raise KeyError("no such gust")
        return 0.1 * np.sin(10.0 * t) - 0.2 * v

    def fail_in(self, calls: int) -> None:
        self.calls, self.fails_at = 0, calls


def windy(wind: Wind) -> turnbuckle.Simulation:
    """Mechanisms of which `spin` turns so far that each step is halved, and a rope with a nail, in one wind."""
    scene = mechanisms(conflicts="solve")
    scene.add_rope("line", start=[0, 20, 0], end=[1, 20, 0], segments=4, mass=0.2, stretch_stiffness=100.0)
    scene.add_constraint("nail", "hook", points=[{"body": "line", "index": 0}], ramp={"steps": 30})
    scene.add_constraint("nail", "end", points=[{"body": "line", "index": 4}], goal={
        "times": [0.0, 0.1], "offsets": [[0, 0, 0], [0, 0, 0.1]]})  # fmt: skip
    scene.add_force("gale", callable=wind)
    return turnbuckle.Simulation(scene)


def seen(simulation: turnbuckle.Simulation) -> dict[str, str]:
    """The bits of the state without what each step writes before it reads."""
    found = bits(simulation.state)
    return {
        name: text
        for name, text in found.items()
        if not name.startswith(".params") and not (name.startswith(".tables") and name.endswith(WRITTEN_ANEW))
    }


def test_a_failure_in_the_second_half_takes_the_whole_step_back() -> None:
    wind, calm = Wind(), Wind()
    simulation, twin = windy(wind), windy(calm)
    for _ in range(20):
        assert simulation.step().halvings == twin.step().halvings == 1
    assert seen(simulation) == seen(twin)
    wind.calls = 0
    probe = windy(wind)
    probe.run(0.02)
    before = wind.calls
    probe.step()
    calls = wind.calls - before
    assert calls >= 5, "the whole step that is taken back, and two halves"
    for k in range(1, calls + 1):
        good = seen(simulation)
        wind.fail_in(k)
        report = simulation.step()
        assert report.status == "failed" and report.time == simulation.time == twin.time
        assert report.energies == simulation.state.energies
        assert "force 'gale' failed at t = " in report.messages[0] and "no such gust" in report.messages[0]
        assert report.messages[0].endswith("mend the force field")
        after = seen(simulation)
        assert {name for name in good if good[name] != after.get(name)} == set(), f"call {k} of {calls}"
    assert simulation.step().status == twin.step().status
    assert seen(simulation) == seen(twin)
    simulation.run(0.03)
    twin.run(0.03)
    assert seen(simulation) == seen(twin)


def test_no_part_of_the_state_is_forgotten() -> None:
    known = {*VALUES, *DEVICE_PARTS, *NOT_OF_A_STEP, *HOST_PARTS}
    assert {f.name for f in fields(State)} == known


@pytest.mark.parametrize(
    ("force", "what"),
    [
        (lambda x, v, t, m: x[:, 7], "force 'gust' failed at t = .*IndexError"),
        (lambda x, v, t, m: "strong", "force 'gust' failed at t = .*ValueError"),
        (lambda x, v, t, m: np.zeros(3), r"force 'gust' gave shape \(3,\), expected \(1, 3\)"),
        (lambda x, v, t, m: np.full((1, 3), np.nan), "force 'gust' is not finite .* on 'b'"),
    ],
)
def test_a_force_of_the_user_that_goes_wrong_is_named(force: object, what: str) -> None:
    scene = turnbuckle.Scene("gust", dt=1e-3, bodies=[box("b", [0, 0, 0])])
    scene.add_force("gust", body="b", callable=force)
    simulation = turnbuckle.Simulation(scene)
    with pytest.raises(turnbuckle.StepError, match=what):
        simulation.run(0.01)
    assert simulation.center("b") == pytest.approx([0, 0, 0], abs=0)


@pytest.mark.parametrize("integrator", ["newmark", "implicit_euler"])
def test_implicit_schemes_take_scenes_of_rigid_bodies_alone(integrator: str) -> None:
    scene = turnbuckle.Scene(
        "fall", dt=1e-2, gravity=[0, 0, -9.81], integrator=integrator, bodies=[box("b", [0, 0, 0])]
    )
    simulation = turnbuckle.Simulation(scene)
    simulation.run(0.5)
    assert simulation.center("b")[2] == pytest.approx(-0.5 * 9.81 * 0.25, rel=1e-12)


def test_numbers_that_are_none_are_refused() -> None:
    simulation = turnbuckle.Simulation(turnbuckle.Scene("b", dt=1e-3, bodies=[box("b", [0, 0, 0])]))
    for call in (
        lambda: simulation.set_pose("b", "here", [0, 0, 0, 1]),
        lambda: simulation.set_velocity("b", [0, 0, [1]], [0, 0, 0]),
        lambda: simulation.push("b", force={"x": 1}),
    ):
        with pytest.raises(turnbuckle.InputError, match="expected 3 finite numbers"):
            call()
