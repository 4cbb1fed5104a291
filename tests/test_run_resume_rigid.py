"""Runs of rigid bodies and joints that are killed and resumed have the bits of those that never stopped."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rigid_scene_example import DT, MIDDLE, SCENES, bits, bowl, chain, mechanisms, mixed

import turnbuckle
from turnbuckle.io.checkpoint import load, save

HERE = Path(__file__).parent
AT, KILLED = 20, MIDDLE + 3  # steps between two checkpoints; where the run is killed

# A process of its own, which forks one for each case; each kills itself without a chance to clean up.
_KILL = """
import os, signal, sys
import turnbuckle
from rigid_scene_example import SCENES
folder, at, killed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
for name in sys.argv[4:]:
    child = os.fork()
    if child == 0:
        end = lambda t, total, steps, worst: os.kill(os.getpid(), signal.SIGKILL) if steps == killed else None
        turnbuckle.run_scene(SCENES[name](), checkpoint=f"{folder}/{name}.ckpt", every=at, progress=end)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    print(name, os.WIFSIGNALED(status) and os.WTERMSIG(status))
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what killed runs have left."""
    folder = tmp_path_factory.mktemp("killed")
    path = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-c", _KILL, str(folder), str(AT), str(KILLED), *SCENES]
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.stdout.splitlines() == [f"{name} {int(signal.SIGKILL)}" for name in SCENES], done.stderr[-2000:]
    return folder


def final(**options: object) -> tuple[dict[str, str], turnbuckle.RunReport]:
    """The state at the end of a run, and its report."""
    seen: list[turnbuckle.Simulation] = []
    result = turnbuckle.run_scene(stop=lambda simulation, report: seen.append(simulation), **options)
    return bits(seen[-1].state), result


@pytest.mark.parametrize("name", SCENES)
def test_resumed_run_has_the_same_bits(killed: Path, name: str) -> None:
    duration = 0.0997  # the last step is a short one
    whole, _ = final(scene=SCENES[name](), duration=duration)
    begun = turnbuckle.Simulation(SCENES[name]())
    load(killed / f"{name}.ckpt", begun.model, begun.state)
    state = begun.state
    assert state.steps == MIDDLE and state.time == pytest.approx(MIDDLE * DT)
    if name == "mechanisms":
        joints = state.joints
        assert joints["weak"].broken and not joints["weak"].acting
        assert joints["second"].acting and not joints["first"].acting
        assert state.dt < 0.9 * DT, "a step was halved"
        assert state.active[3 * joints["knee"].parts].any() or state.impulse.any()
        assert begun.model.rigid.trajectories and not np.array_equal(begun.pose("crane")[0], [0, 5, 0])
    resumed, report = final(scene=SCENES[name](), resume=killed / f"{name}.ckpt", duration=duration)
    assert resumed == whole
    assert report.steps == 100 - MIDDLE


@pytest.mark.parametrize(
    "options",
    [{"solver": "displacement"}, {"rigid_motion": "paper"}, {"solver": "displacement", "rigid_motion": "paper"}],
    ids=["displacement", "paper", "both"],
)
def test_other_solvers_and_motions_resume_as_well(options: dict, tmp_path: Path) -> None:
    for make in (lambda: chain(4, **options), lambda: mixed(**options)):
        first = turnbuckle.Simulation(make())
        first.run(0.01)
        save(tmp_path / "a.ckpt", first.model, first.state)
        second = turnbuckle.Simulation(make())
        load(tmp_path / "a.ckpt", second.model, second.state)
        for simulation in (first, second):
            simulation.run(0.01)
        assert bits(second.state) == bits(first.state)


def change(simulation: turnbuckle.Simulation) -> None:
    """Everything that can be changed of rigid bodies and joints in a run."""
    simulation.switch("rope", False)
    simulation.remove_constraint("drive")
    simulation.retarget("hip", -1.0)
    simulation.push("load", force=[1.0, 2.0, 0.0], torque=[0.0, 0.1, 0.0], at=[0.1, 0, 0])
    simulation.set_pose("rotor", [0.1, 1.0, 0.2], [0.0, 0.0, 0.1, 1.0])
    simulation.set_velocity("rotor", [0.0, 0.0, 0.3], [1.0, 0.0, 0.0])
    place = simulation.center("rotor")
    wire = {"points": [place + [k, 0.1 * k * k, 0] for k in (-2.0, 0.0, 1.0, 2.0)], "interpolation": "spline"}
    ends = {"body1": "rotor", "local_pos0": [0, 0, 0], "local_pos1": [0, 0, 0]}
    simulation.add_constraint("joint", "wire", curve=wire, **ends)
    floor = {"vertices": [[-9, -9, 0], [9, -9, 0], [0, 9, 0]], "triangles": [[0, 1, 2]]}
    offset = [0, 0, simulation.center("falling")[2]]
    simulation.add_constraint("joint", "table", surface=floor, **{**ends, "body1": "falling", "local_pos0": offset})
    simulation.add_constraint("ball", "gone", body1="sprung", anchor=simulation.center("sprung"))
    simulation.remove_constraint("gone")
    anchor = simulation.center("load")
    simulation.add_constraint("ball", "rope_2", body1="load", anchor=anchor, break_force=200.0, start=0.02)


def test_changes_made_in_the_run_are_kept(tmp_path: Path) -> None:
    first = turnbuckle.Simulation(mechanisms())
    first.run(0.01)
    change(first)
    save(tmp_path / "before.ckpt", first.model, first.state)  # nothing has followed the changes yet
    first.run(0.02)
    save(tmp_path / "after.ckpt", first.model, first.state)
    assert first.residuals("wire")[0] < 1e-10 and first.residuals("table")[0] < 1e-10
    again = turnbuckle.Simulation(mechanisms())
    load(tmp_path / "before.ckpt", again.model, again.state)
    again.run(0.02)
    second = turnbuckle.Simulation(mechanisms())
    second.run(0.003)  # whatever it was in before
    load(tmp_path / "after.ckpt", second.model, second.state)
    assert bits(again.state) == bits(second.state) == bits(first.state)
    for name in ("wire", "table", "rope_2"):
        given, kept = (s.state.joints[name].definition.model_dump_json() for s in (first, second))
        assert given == kept
    for simulation in (first, again, second):
        simulation.run(0.005)
        simulation.switch("rope", True)
        simulation.switch("rope_2", False)
        simulation.remove_constraint("wire")
        simulation.add_constraint("weld", "late", body0="thigh", body1="shin", anchor=[0, 0, 0])
        simulation.remove_constraint("knee")
        simulation.push("load", force=[0.0, 0.0, 0.0])
        simulation.run(0.005)
    assert bits(again.state) == bits(second.state) == bits(first.state)
    assert {"wire", "drive", "knee", "gone"}.isdisjoint(second.state.joints)


def test_callables_that_the_scene_does_not_define_are_refused_by_name(tmp_path: Path) -> None:
    simulation = turnbuckle.Simulation(mechanisms())
    ends = {"body1": "falling", "local_pos0": [0, 11, -0.5], "local_pos1": [0, 0, 0]}
    simulation.remove_constraint("weak")
    simulation.add_constraint("joint", "live", domain=bowl, **ends)
    simulation.run(0.003)
    with pytest.raises(turnbuckle.InputError, match="joint 'live'.*callable"):
        save(tmp_path / "a.ckpt", simulation.model, simulation.state)
    simulation.remove_constraint("live")
    simulation.run(0.003)
    save(tmp_path / "a.ckpt", simulation.model, simulation.state)
    other = turnbuckle.Simulation(mechanisms())
    load(tmp_path / "a.ckpt", other.model, other.state)
    for s in (simulation, other):
        s.run(0.003)
    kept, here = bits(other.state), bits(simulation.state)
    assert {name for name in here if kept[name] != here[name]} == {".domains.2"}, "what was removed"


def test_checkpoints_of_other_scenes_are_refused(tmp_path: Path) -> None:
    made = turnbuckle.Simulation(mechanisms())
    made.run(0.002)
    place = tmp_path / "a.ckpt"
    save(place, made.model, made.state)
    more = mechanisms()
    more.add_joint("ball", "another", body1="falling", anchor=[0, 11, 0])
    others = [
        (mechanisms(rigid_motion="paper"), "rigid motion: rotor, here: paper"),
        (mechanisms(solver="displacement"), "solver"),
        (more, "joints differ"),
        (chain(3), "points"),
    ]
    for assignment, words in [
        ("bodies.load.mass=2", "data of rigid bodies"),
        ("bodies.crane.trajectory.times=[0, 0.05, 0.3]", "data of rigid bodies"),
        ("constraints.knee.upper_limit=0.5", "'knee'"),
        ("constraints.bead.curve.interpolation=polyline", "'bead'"),
        ("forces[0].at=[0.1, 0, 0]", "places of forces"),
    ]:
        scene = mechanisms()
        scene.apply_set(assignment)
        others.append((scene, words))
    for other, words in others:
        simulation = turnbuckle.Simulation(other)
        before = bits(simulation.state)
        with pytest.raises(turnbuckle.InputError, match=words) as told:
            load(place, simulation.model, simulation.state)
        assert str(place) in str(told.value) and "\n" not in str(told.value)
        assert bits(simulation.state) == before


def test_bodies_that_do_not_move_stay_where_they_are_put(tmp_path: Path) -> None:
    block = {"type": "rigid", "name": "wall", "box": [1, 1, 1], "motion": "immobile"}
    simulation = turnbuckle.Simulation(turnbuckle.Scene("wall", bodies=[block]))
    simulation.run(0.003)
    simulation.set_pose("wall", [1.0, 2.0, 3.0], [0, 0, 0, 1])
    for _ in range(3):
        simulation.step()
        assert np.array_equal(simulation.pose("wall")[0], [1.0, 2.0, 3.0])
    save(tmp_path / "a.ckpt", simulation.model, simulation.state)
    other = turnbuckle.Simulation(simulation.scene)
    load(tmp_path / "a.ckpt", other.model, other.state)
    for _ in range(3):
        other.step()
        assert np.array_equal(other.pose("wall")[0], [1.0, 2.0, 3.0])
