"""A run that is killed and resumed has the bits of one that never stopped; checkpoints are whole, or refused."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from run_scene_example import DT, MIDDLE, digest, nail, rope, scene, spiral

import turnbuckle
from turnbuckle.io import read_recording
from turnbuckle.io.checkpoint import load, save
from turnbuckle.scene.definitions import KeyframesDef

HERE = Path(__file__).parent
SCHEMES = ["verlet", "velocity_verlet", "beeman", "rk4", "explicit_euler", "newmark", "implicit_euler"]
AT, KILLED = 10, MIDDLE + 3  # steps between two checkpoints; where the run is killed

# Each case is a process of its own, which kills itself without a chance to clean up.
_KILL = """
import os, signal, sys
import turnbuckle
from run_scene_example import scene
folder, at, killed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
for case in sys.argv[4:]:
    integrator, cells, threads = case.split(":")
    child = os.fork()
    if child == 0:
        os.environ["TURNBUCKLE_THREADS"] = threads
        end = lambda t, total, steps, worst: os.kill(os.getpid(), signal.SIGKILL) if steps == killed else None
        place = f"{folder}/{case.replace(':', '_')}"
        turnbuckle.run_scene(
            scene(integrator, int(cells)), checkpoint=f"{place}.ckpt", every=at, out=[f"{place}.npz"], progress=end
        )
        os._exit(0)
    _, status = os.waitpid(child, 0)
    print(case, os.WIFSIGNALED(status) and os.WTERMSIG(status))
"""


def environment(**more: str) -> dict[str, str]:
    path = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, **more}


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what killed runs of every scheme have left."""
    folder = tmp_path_factory.mktemp("killed")
    cases = [f"{name}:6:1" for name in SCHEMES] + ["verlet:95:2", "verlet:95:1"]
    command = [sys.executable, "-c", _KILL, str(folder), str(AT), str(KILLED), *cases]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=300)
    assert done.stdout.splitlines() == [f"{case} {int(signal.SIGKILL)}" for case in cases], done.stderr[-2000:]
    return folder


def final(result_of: dict, **options: object) -> dict[str, str]:
    """The state at the end of a run, and its report under ``result_of["result"]``."""
    seen: dict[str, turnbuckle.Simulation] = {}

    def keep(simulation: turnbuckle.Simulation, report: turnbuckle.StepReport) -> bool:
        seen["simulation"] = simulation
        return False

    result_of["result"] = turnbuckle.run_scene(stop=keep, **options)
    return digest(seen["simulation"].state)


def check_resumed(folder: Path, integrator: str, cells: int, threads: int) -> None:
    place = folder / f"{integrator}_{cells}_{threads}"
    told: dict[str, turnbuckle.RunReport] = {}
    whole = final(told, scene=scene(integrator, cells))
    begun = turnbuckle.Simulation(scene(integrator, cells))
    load(f"{place}.ckpt", begun.model, begun.state)
    groups = begun.state.groups
    assert begun.state.steps == MIDDLE
    assert groups["weak"].broken.all() and not groups["pulled"].broken.any()
    assert groups["second"].acting and not groups["first"].acting
    for name in ("late", "joint", "bead"):
        assert getattr(begun.state.tables, groups[name].kind).phase.numpy()[groups[name].rows[0]] > 0, "mid-ramp"
    resumed = final(told, scene=scene(integrator, cells), resume=f"{place}.ckpt", out=[f"{place}.npz"])
    assert resumed == whole
    result = told["result"]
    assert result.steps == round(0.12 / DT) - MIDDLE
    assert result.resumed == {"file": f"{place}.ckpt", "time": pytest.approx(MIDDLE * DT), "steps": MIDDLE}
    # What the killed run had recorded is still there, and what follows is in a file of its own.
    later = place.with_name(f"{place.name}_from_step_{MIDDLE}.npz")
    assert result.outputs == [str(later)] and any(str(later) in text for text in result.messages)
    times = read_recording(f"{place}.npz.part").times
    assert times[0] == 0.0 and MIDDLE * DT - 1 / 60 < times[-1] <= MIDDLE * DT + 1e-9
    times = read_recording(later).times
    assert times[0] == pytest.approx(MIDDLE * DT) and times[-1] == pytest.approx(0.12)


@pytest.mark.parametrize("integrator", SCHEMES)
def test_resumed_run_has_the_same_bits(killed: Path, integrator: str) -> None:
    check_resumed(killed, integrator, 6, 1)


@pytest.mark.parametrize("threads", [1, 2])
def test_resumed_run_has_the_same_bits_with_threads(
    killed: Path, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TURNBUCKLE_THREADS", str(threads))
    check_resumed(killed, "verlet", 95, threads)


def test_kill_at_any_moment_leaves_a_whole_checkpoint(tmp_path: Path) -> None:
    place = tmp_path / "run.ckpt"
    code = (
        "import sys, turnbuckle\nfrom run_scene_example import scene\n"
        "turnbuckle.run_scene(scene('verlet'), duration=100.0, checkpoint=sys.argv[1], every=1)"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(place)], env=environment(), stderr=subprocess.DEVNULL)
    try:
        for wait in (0.05, 0.031, 0.017):  # at moments that have nothing to do with its steps
            last = time.monotonic() + 60
            while not place.exists() and time.monotonic() < last:
                time.sleep(0.01)
            time.sleep(wait)
            process.send_signal(signal.SIGSTOP)
            simulation = turnbuckle.Simulation(scene("verlet"))
            load(place, simulation.model, simulation.state)
            assert simulation.state.steps > 0
            place.unlink()
            process.send_signal(signal.SIGCONT)
        while not place.exists():
            assert process.poll() is None
    finally:
        process.kill()
        process.wait()


def test_changes_made_in_the_run_are_kept(tmp_path: Path) -> None:
    first = turnbuckle.Simulation(scene("verlet"))
    first.run(0.03)
    first.switch("winch", False)
    first.remove_constraint("hook")
    places = np.array([[0, 0.5, 0], [0, 0.5, 1.0]])
    first.retarget("moved", KeyframesDef(times=np.array([0.0, 1.0]), positions=places))
    points = [{"body": "c", "index": k} for k in (3, 4)]
    first.add_constraint("nail", "live", points=points, ramp={"steps": 50}, break_force=1e6)
    first.add_constraint("points_to_point", "tie", groups=[[{"body": "c", "index": 8}, {"body": "net", "index": 30}]])
    first.add_constraint("slide", "ring", points=[{"body": "a", "index": 2}], on={"body": "block", "surface": True})
    first.state.set_gravity(np.array([0.0, 1.0, -3.0]))
    first.run(0.01)
    save(tmp_path / "a.ckpt", first.model, first.state)
    second = turnbuckle.Simulation(scene("verlet"))
    load(tmp_path / "a.ckpt", second.model, second.state)
    assert digest(second.state) == digest(first.state)
    assert second.state.groups["live"].definition == first.state.groups["live"].definition
    for simulation in (first, second):
        simulation.run(0.03)
        simulation.switch("winch", True)
        simulation.add_constraint("nail", "later", points=[{"body": "net", "index": 40}])
        simulation.run(0.02)
    assert digest(second.state) == digest(first.state)
    assert not np.array_equal(first.positions("net"), turnbuckle.Simulation(scene("verlet")).positions("net"))


def test_constraints_solved_together_are_kept(tmp_path: Path) -> None:
    shared = [
        nail("n", "r", 0),
        {"type": "points_to_point", "name": "p", "groups": [[{"body": "r", "index": k} for k in (0, 1)]]},
    ]
    digests = []
    for stop in (True, False):
        simulations = [
            turnbuckle.Simulation(turnbuckle.Scene("s", conflicts="solve", bodies=[rope("r", 0.0)], constraints=shared))
        ]
        simulations[0].run(0.02)
        if stop:
            save(tmp_path / "s.ckpt", simulations[0].model, simulations[0].state)
            simulations.append(turnbuckle.Simulation(simulations[0].scene))
            load(tmp_path / "s.ckpt", simulations[1].model, simulations[1].state)
        simulations[-1].run(0.02)
        digests.append(digest(simulations[-1].state))
    assert digests[0] == digests[1]


def test_callables_that_the_scene_does_not_define_are_refused_by_name(tmp_path: Path) -> None:
    simulation = turnbuckle.Simulation(scene("verlet"))
    save(tmp_path / "a.ckpt", simulation.model, simulation.state)
    simulation.retarget("pulled", lambda t: spiral(2 * t))
    with pytest.raises(turnbuckle.InputError, match="'pulled'.*callable"):
        save(tmp_path / "a.ckpt", simulation.model, simulation.state)
    simulation.retarget("pulled", [0, 0, 0])
    simulation.add_constraint("nail", "live", points=[{"body": "c", "index": 4}], goal=spiral)
    with pytest.raises(turnbuckle.InputError, match="'live'.*callable"):
        save(tmp_path / "a.ckpt", simulation.model, simulation.state)


def test_checkpoints_of_other_scenes_are_refused(tmp_path: Path) -> None:
    place = tmp_path / "a.ckpt"
    made = turnbuckle.Simulation(scene("verlet"))
    made.run(0.01)
    save(place, made.model, made.state)
    heavier, stiffer, nailed, fewer = (scene("verlet") for _ in range(4))
    heavier.apply_set("bodies.a.mass=0.6")
    stiffer.apply_set("bodies.b.stretch_stiffness=301")
    nailed.apply_set("constraints.late.points[0].index=7")
    fewer.add_constraint("nail", "another", points=[{"body": "net", "index": 20}])
    others = [
        (scene("beeman"), "integrator: verlet, here: beeman"),
        (scene("verlet", 7), "points"),
        (scene("verlet", response="paper"), "response"),
        (heavier, "masses"),
        (stiffer, "spring data"),
        (nailed, "'late'"),
        (fewer, "constraints"),
    ]
    for other, words in others:
        simulation = turnbuckle.Simulation(other)
        before = digest(simulation.state)
        with pytest.raises(turnbuckle.InputError, match=words) as told:
            load(place, simulation.model, simulation.state)
        assert str(place) in str(told.value) and "\n" not in str(told.value)
        assert digest(simulation.state) == before
        recording = tmp_path / "kept.npz"
        recording.write_text("an older recording")
        with pytest.raises(turnbuckle.InputError, match=words):
            turnbuckle.run_scene(other, resume=place, out=[recording])
        assert recording.read_text() == "an older recording"


def test_damaged_checkpoints_are_refused(tmp_path: Path) -> None:
    place = tmp_path / "a.ckpt"
    simulation = turnbuckle.Simulation(scene("verlet"))
    simulation.run(MIDDLE * DT)
    save(place, simulation.model, simulation.state)
    good, whole = digest(simulation.state), place.read_bytes()
    random = np.random.default_rng(5)
    damaged = [whole[:n] for n in (0, 1, 100, len(whole) // 2, len(whole) - 1)]
    for at in random.integers(0, len(whole), 60):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << random.integers(0, 8)
        damaged.append(bytes(flipped))
    damaged += [b"no checkpoint at all\n" * 50]
    refused = 0
    fresh = turnbuckle.Simulation(scene("verlet"))
    begin = digest(fresh.state)
    for data in damaged:
        place.write_bytes(data)
        try:
            load(place, fresh.model, fresh.state)
        except turnbuckle.InputError as error:
            refused += 1
            assert digest(fresh.state) == begin and "\n" not in str(error)
        else:  # the bit that was flipped is one that says nothing
            assert digest(fresh.state) == good
            fresh = turnbuckle.Simulation(scene("verlet"))
    assert refused > 40
    np.savez(place.with_suffix(".npz"), x=np.zeros(3))
    for wrong in (place.with_suffix(".npz"), tmp_path / "none.ckpt", tmp_path):
        with pytest.raises(turnbuckle.InputError, match=str(wrong)):
            turnbuckle.run_scene(scene("verlet"), resume=wrong)
