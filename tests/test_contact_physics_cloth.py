"""Cloth in contact, judged by an independent library; broken meshes; constraints beside contact; the same bits again."""

import os
from pathlib import Path

import numpy as np
import pytest
from contact_measures import centre, pushes, speed, step_well

import turnbuckle
from turnbuckle.io.checkpoint import load, save


def draped(dt: float = 0.01, over: str = "ball") -> turnbuckle.Scene:
    """A cloth that falls on a ball, or between two boxes, on a floor."""
    scene = turnbuckle.Scene("draped", dt=dt, contact={"friction": 0.4})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    cloth = {"size": [0.5, 0.5], "cells": [10, 10], "density": 0.3, "damping": 0.02, "structural_stiffness": 300.0}
    cloth |= {"shear_stiffness": 300.0, "bend_model": "hinges", "bend_stiffness": 2e-5}
    if over == "ball":
        scene.add_obstacle("ball", sphere=0.12, position=[0.01, 0.02, 0.15])
        scene.add_cloth("cloth", position=[-0.25, -0.25, 0.285], **cloth)
    else:
        scene.add_rigid("below", box=[0.2, 0.2, 0.1], position=[0.0, 0.0, 0.053])
        scene.add_cloth("cloth", position=[-0.25, -0.25, 0.11], **cloth)
        scene.add_rigid("above", box=[0.15, 0.15, 0.1], position=[0.02, 0.0, 0.21], rotation=[0.1, 0.2, 0.3])
    return scene


def digest(sim: turnbuckle.Simulation) -> bytes:
    state = sim.state
    rigid = [getattr(state.rigid, name).numpy().tobytes() for name in ("x", "q", "v", "w")]
    return b"".join([state.positions().tobytes(), state.velocities().tobytes(), *rigid])


@pytest.mark.parametrize("over", ["ball", "boxes"])
def test_no_committed_frame_intersects(over: str) -> None:
    referee = pytest.importorskip("contact_referee")
    sim = turnbuckle.Simulation(draped(over=over))
    resorts = 0
    for _ in range(60):
        report = step_well(sim, 1)[0]
        resorts += report.last_resorts
        assert not referee.intersects(sim.model.surfaces, sim.state.positions()), f"t = {report.time}"
        assert np.isfinite(sim.state.positions()).all()
    assert report.touching > 5
    assert resorts == 0
    if over == "boxes":
        assert 0.1 < centre(sim, "above")[2] < 0.18


def test_a_run_again_from_a_checkpoint_and_on_any_number_of_threads(tmp_path: Path) -> None:
    """The same bits: what contact remembers is in the checkpoint, and sums do not race."""
    found = {}
    before = os.environ.get("TURNBUCKLE_THREADS")
    try:
        for threads in ("1", "2"):
            os.environ["TURNBUCKLE_THREADS"] = threads
            sim = turnbuckle.Simulation(draped(over="boxes"))
            step_well(sim, 20)
            if threads == "1":
                save(tmp_path / "half.ckpt", sim.model, sim.state)
            step_well(sim, 15)
            found[threads] = digest(sim)
        again = turnbuckle.Simulation(draped(over="boxes"))
        load(tmp_path / "half.ckpt", again.model, again.state)
        step_well(again, 15)
    finally:
        os.environ.pop("TURNBUCKLE_THREADS")
        if before is not None:
            os.environ["TURNBUCKLE_THREADS"] = before
    assert found["1"] == found["2"]
    assert digest(again) == found["2"]


def test_needles_and_doubled_faces_carry_a_box() -> None:
    """A floor with needle triangles, a face twice, and a vertex that two others nearly meet."""
    vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 1e-4, 0], [1e-7, 1e-4, 0], [0.3, 1e-6, 0]]
    triangles = [[0, 1, 4], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 5, 4], [4, 5, 6]]
    scene = turnbuckle.Scene("broken", dt=0.01, contact={"friction": 0.5, "delta": 2e-3})
    scene.add_obstacle("floor", vertices=np.array(vertices, dtype=float), triangles=triangles)
    scene.add_rigid("box", box=[0.2, 0.2, 0.1], position=[0.02, 0.01, 0.07], rotation=[0.0, 0.0, 0.4], mass=2.0)
    sim = turnbuckle.Simulation(scene)
    step_well(sim, 60)
    assert 0.05 < centre(sim, "box")[2] < 0.0525
    assert np.linalg.norm(speed(sim, "box")) < 2e-3
    assert pushes(sim)["floor", "box"][2] == pytest.approx(2.0 * 9.81, rel=0.02)


def test_nails_stay_exact_on_cloth_that_lies_on_a_ball() -> None:
    scene = draped()
    scene.add_constraint("nail", "corners", points=[{"body": "cloth", "indices": [0, 10]}])
    sim = turnbuckle.Simulation(scene)
    held = sim.positions("cloth")[[0, 10]].copy()
    for _ in range(50):
        step_well(sim, 1)
        assert np.abs(sim.positions("cloth")[[0, 10]] - held).max() < 1e-12
    weight = 0.3 * 0.25 * 9.81
    carried = -pushes(sim).get(("cloth", "ball"), np.zeros(3))[2] - pushes(sim).get(("cloth", "floor"), np.zeros(3))[2]
    nails = sim.forces("corners").sum(axis=0)[2]
    assert carried > 0.1 * weight
    assert 0.5 * weight < carried + nails < 1.5 * weight


def test_attached_bodies_stay_together_in_contact() -> None:
    """A soft box hung on a cloth by attached points is dragged over the floor: their points agree to 1e-12."""
    scene = turnbuckle.Scene("hung", dt=0.01, contact={"friction": 0.3})
    scene.add_obstacle("floor", plane=[4.0, 4.0])
    box = {"size": [0.1, 0.1, 0.1], "cells": [1, 1, 1]}
    scene.add_solid("box", box=box, youngs_modulus=1e5, density=300.0, position=[0.0, 0.0, 0.003])
    scene.add_cloth("cloth", size=[0.3, 0.1], cells=[6, 2], position=[0.1, 0.0, 0.103], damping=0.02)
    scene.add_constraint(
        "points_to_point", "seam0",
        join=[{"body": "cloth", "nearest": [0.1, 0.0, 0.103]}, {"body": "box", "nearest": [0.1, 0.0, 0.103]}],
    )  # fmt: skip
    scene.add_constraint(
        "points_to_point", "seam1",
        join=[{"body": "cloth", "nearest": [0.1, 0.1, 0.103]}, {"body": "box", "nearest": [0.1, 0.1, 0.103]}],
    )  # fmt: skip
    sim = turnbuckle.Simulation(scene)
    for _ in range(60):
        report = step_well(sim, 1)[0]
        assert max(report.position_residual.values()) < 1e-12
    assert report.touching > 3
