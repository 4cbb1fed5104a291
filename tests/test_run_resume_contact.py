"""Runs with contact that are killed and resumed have the bits of those that never stopped; other scenes are refused."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from contact_scene_example import DT, MIDDLE, SCENES, draped, pile
from rigid_scene_example import bits

import turnbuckle
from turnbuckle.io.checkpoint import load, save
from turnbuckle.step.snapshot import Snapshot

HERE = Path(__file__).parent
AT, KILLED = 20, MIDDLE + 3  # steps between two checkpoints; where the run is killed

# A process of its own, which forks one for each case; each kills itself without a chance to clean up.
_KILL = """
import os, signal, sys
import turnbuckle
from contact_scene_example import SCENES
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
    whole, _ = final(scene=SCENES[name]())
    begun = turnbuckle.Simulation(SCENES[name]())
    load(killed / f"{name}.ckpt", begun.model, begun.state)
    state = begun.state
    assert state.steps == MIDDLE and state.time == pytest.approx(MIDDLE * DT)
    assert state.contact_impulse.any() and len(state.contact_keys) == len(state.contact_impulse)
    resumed, report = final(scene=SCENES[name](), resume=killed / f"{name}.ckpt")
    assert report.status == "done" and report.steps == 50 - MIDDLE
    assert resumed == whole


@pytest.mark.parametrize(
    ("options", "fields"),
    [({"solver": "ica"}, {}), ({"solver": "anticipation"}, {}), ({"newton": 2}, {}), ({}, {"integrator": "newmark"})],
)
def test_other_solvers_and_schemes_resume_as_well(options: dict, fields: dict, tmp_path: Path) -> None:
    def made() -> turnbuckle.Scene:
        scene = pile(**options)
        for name, value in fields.items():
            scene.apply_set(f"{name}={value}")
        return scene

    first = turnbuckle.Simulation(made())
    first.run(20 * DT)
    save(tmp_path / "a.ckpt", first.model, first.state)
    second = turnbuckle.Simulation(made())
    load(tmp_path / "a.ckpt", second.model, second.state)
    for simulation in (first, second):
        simulation.run(5 * DT)
    assert bits(second.state) == bits(first.state)


def test_what_is_carried_over_matters(killed: Path) -> None:
    """Without the impulses of the last step the next one ends elsewhere, if only by the tolerance."""
    ends = []
    for keep in (True, True, False):
        simulation = turnbuckle.Simulation(draped())
        load(killed / "draped.ckpt", simulation.model, simulation.state)
        if not keep:
            simulation.state.contact_impulse = np.zeros_like(simulation.state.contact_impulse)
        simulation.step()
        ends.append(simulation.positions("cloth").copy())
    assert np.array_equal(ends[0], ends[1]) and not np.array_equal(ends[0], ends[2])
    assert np.abs(ends[0] - ends[2]).max() < 1e-4


def test_a_snapshot_brings_impulses_of_contacts_back(killed: Path) -> None:
    simulation = turnbuckle.Simulation(pile())
    load(killed / "pile.ckpt", simulation.model, simulation.state)
    before, copy = bits(simulation.state), Snapshot(simulation.state)
    simulation.run(3 * DT)
    assert bits(simulation.state) != before
    copy.restore(simulation.state)
    assert bits(simulation.state) == before


@pytest.mark.parametrize(
    ("make", "change", "what"),
    [
        (draped, {"mu": 0.5}, "its coefficients of friction differ"),
        (draped, {"delta": 5e-3}, "its distances that contact keeps differ"),
        (draped, {"solver": "ica"}, "its contact.solver: newton, here: ica"),
        (draped, {"rounds": 4}, "its contact.rounds: 5, here: 4"),
        (draped, {"shift": 0.06}, "its motions of scripted bodies differ"),
        (draped, {"bend": 2e-4}, "its hinge data differ"),
        (draped, {"limit": 0.2}, "its data of strain limits differ"),
        (draped, {"touches": "others"}, "its pairs of bodies that may touch differ"),
        (pile, {"young": 2e5}, "its data of corotational tetrahedra differ"),
    ],
)
def test_a_changed_scene_is_refused(killed: Path, make, change: dict, what: str) -> None:
    name = make.__name__
    with pytest.raises(turnbuckle.InputError, match=what):
        turnbuckle.run_scene(make(**change), resume=killed / f"{name}.ckpt")


def test_contact_switched_off_is_refused(killed: Path) -> None:
    scene = draped()
    scene.apply_set("contact=false")
    scene.apply_set("integrator=implicit_euler")
    with pytest.raises(turnbuckle.InputError, match="its contact: True, here: False|its strain limits"):
        turnbuckle.run_scene(scene, resume=killed / "draped.ckpt")
