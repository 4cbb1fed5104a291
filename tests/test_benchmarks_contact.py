"""The benchmarks of contact measure what they say: small runs, the referee, the peers' scenes, options, plots."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from turnbuckle.benchmarks import contact_histograms, contact_scaling, falling_cloth, letters
from turnbuckle.benchmarks.contact_figures import histograms_figure, scaling_figure
from turnbuckle.benchmarks.contact_options import options
from turnbuckle.benchmarks.contact_protocol import ContactResult, ContactTask, run_peer, simulate
from turnbuckle.benchmarks.contact_run import ContactRun, follow
from turnbuckle.benchmarks.contact_solvers import PaperSolver, full_anticipation, plugged
from turnbuckle.benchmarks.contact_tables import peers_table, stages_table, steps_table
from turnbuckle.data.contact import ContactProblem
from turnbuckle.data.errors import InputError
from turnbuckle.scenes import REGISTRY
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.step.simulation import Simulation

pytest.importorskip("ipctk")
from turnbuckle.benchmarks.contact_referee import Referee, solid_surfaces  # noqa: E402


@pytest.fixture(scope="module")
def cloth() -> ContactRun:
    return follow(REGISTRY["falling_cloth"](cells=8), 0.24, every=10)


def test_a_run_counts_what_its_steps_report(cloth: ContactRun) -> None:
    assert len(cloth.ms) == len(cloth.time) == len(cloth.contacts) == 60
    assert cloth.points == 81 and cloth.judged == 6 and cloth.crossing == 0
    assert max(cloth.contacts) > 0 and cloth.went > 0.1  # it fell for a quarter of a second and reached the ground
    assert cloth.within(0.1, 0.2).sum() == 25
    assert not cloth.within(0.0, 1.0)[0]


def test_tables_tell_means_stages_and_ratios(cloth: ContactRun) -> None:
    windows = {"all": (0.0, 0.24), "late": (0.2, 0.24)}
    table = steps_table("T", cloth, windows, {"all": 1e-6})
    cells = {row[0]: row[1:] for row in table.rows}
    assert cells["steps"] == [59, 10]
    assert cells["mean, ms"][0] == pytest.approx(np.mean(cloth.ms[1:]))
    assert any("missed" in note for note in table.notes)
    stages = {row[0]: row[1] for row in stages_table(cloth, windows).rows}
    parts = sum(value for name, value in stages.items() if name != "total")
    assert parts == pytest.approx(stages["total"]) and stages["contact_solve"] > 0.0
    theirs = ContactResult("slow", "1", 4e-3, [3.0 * ms for ms in cloth.ms[1:31]], 3, 2, 7, 0.1, "slowly")
    beside = peers_table("T", cloth, [theirs, "nobody skipped: pip install nobody"])
    assert beside.rows[1][3] == pytest.approx(3.0)  # over the thirty steps that both have made
    assert beside.rows[1][5:8] == [3, 2, 7] and "nobody skipped: pip install nobody" in beside.notes


def test_the_referee_sees_what_crosses() -> None:
    model, state = REGISTRY["falling_cloth"](cells=4).build()
    assert model.surfaces is not None
    referee, x = Referee(model.surfaces), state.positions().copy()
    assert not referee.judge(model.surfaces.positions(x))
    x[model.mass > 0.0] -= [0.0, 0.0, 0.3]  # through the ground
    assert referee.judge(model.surfaces.positions(x))
    assert (referee.judged, referee.crossing) == (2, 1) and referee.most_edges >= 1


def test_surfaces_of_tetrahedra_are_their_boundary() -> None:
    pytest.importorskip("manifold3d")
    model, state = REGISTRY["letters"](count=2, text="AB", across=2).build()
    surfaces = solid_surfaces(model)
    assert model.surfaces is not None
    x = surfaces.positions(state.positions())
    solid = model.corotational.corners
    of_solid = np.isin(surfaces.support[surfaces.faces[:, 0], 0], solid)
    a, b, c = np.moveaxis(x[surfaces.faces[of_solid]], 1, 0)
    enclosed = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0  # closed and outward: the solids' volume
    p, q, r, s = np.moveaxis(state.positions()[solid], 1, 0)
    assert enclosed == pytest.approx(np.einsum("ij,ij->i", q - p, np.cross(r - p, s - p)).sum() / 6.0, rel=1e-9)
    assert len(surfaces.faces) - of_solid.sum() == sum(
        np.isin(model.surfaces.support[model.surfaces.faces[:, 0], 0], np.arange(s.begin, s.end)).sum()
        for s in model.scripted
    )
    assert not Referee(surfaces).judge(x)


def test_a_peer_answers_with_what_it_measured(capsys: pytest.CaptureFixture[str]) -> None:
    model, state = REGISTRY["falling_cloth"](cells=3).build()
    assert model.surfaces is not None
    x, moves = state.positions().copy(), model.mass > 0.0

    def sink() -> None:
        x[moves] -= [0.0, 0.0, 0.01]

    task = ContactTask("falling_cloth", {"cells": 3}, seconds=0.08, every=4)
    simulate(task, 4e-3, sink, x.copy, moves, model.surfaces, "sinker", "0", "not held")
    answer = ContactResult(**json.loads(capsys.readouterr().out))
    assert len(answer.ms) == 19 and answer.judged == 5
    assert answer.went == pytest.approx(0.2)
    assert answer.crossing == 4 and answer.most_edges > 0  # 0.05 m above the ground: from the eighth step on


def test_a_missing_peer_and_a_broken_one_are_lines() -> None:
    task = ContactTask("no_such_scene", {}, 0.1)
    assert run_peer("nobody", "no_such_package_anywhere", "none", task) == (
        "nobody skipped: pip install no_such_package_anywhere"
    )
    assert "broken failed with exit code 1" in run_peer("broken", "json", "no_such_script", task)


def test_newton_has_our_points_masses_and_stiffness() -> None:
    pytest.importorskip("newton")
    from turnbuckle.benchmarks.peers.newton_cloth_scene import NewtonScene

    scene = REGISTRY["falling_cloth"](cells=5)
    model, state = scene.build()
    peer = NewtonScene(model, state, iterations=3)
    assert peer.obstacles == {"ground": "ground"}
    free = model.mass > 0.0
    np.testing.assert_allclose(peer.newton.particle_mass.numpy(), model.mass[free], rtol=1e-6)
    np.testing.assert_allclose(peer.newton.spring_stiffness.numpy(), 400.0, rtol=1e-5)
    np.testing.assert_allclose(peer.newton.spring_rest_length.numpy(), model.springs.length, rtol=1e-4)
    hinges = peer.newton.edge_bending_properties.numpy()[:, 0] * peer.newton.edge_rest_length.numpy()
    np.testing.assert_allclose(hinges, 3e-5, rtol=1e-4)
    for _ in range(10):
        peer.step(0.004)
    fell = (state.positions() - peer.positions(0.04))[free].mean(axis=0)
    np.testing.assert_allclose(fell, [0.0, 0.0, 0.5 * 9.81 * 0.04 * 0.044], atol=1e-4)  # before it meets the ground


def test_walls_move_in_newton_as_in_ours() -> None:
    pytest.importorskip("newton")
    pytest.importorskip("manifold3d")
    from turnbuckle.benchmarks.peers.newton_cloth_scene import NewtonScene

    model, state = REGISTRY["letters"](count=1, across=1, press_at=0.0, press_time=0.06).build()
    peer = NewtonScene(model, state, iterations=1, substeps=2, stiffness=1e4)
    assert sorted(peer.obstacles.values()) == ["box"] * 5 and len(peer.bodies) == 4
    peer.step(0.03)
    middle = [0.5 * (x.min(axis=0) + x.max(axis=0)) for x in (wall.positions(0.03) for wall in peer.bodies)]
    np.testing.assert_allclose(peer.states[0].body_q.numpy()[:, :3], middle, atol=1e-6)


def _pile() -> ContactProblem:
    """Three masses on each other, the upper two faster than the lowest; springs between none: A is diagonal."""
    n, h = 3, 0.01
    rows = np.zeros((9, 9))
    for k in range(n):
        rows[3 * k, 3 * k + 2] = 1.0
        if k:
            rows[3 * k, 3 * k - 1] = -1.0
        rows[3 * k + 1, 3 * k], rows[3 * k + 2, 3 * k + 1] = 1.0, 1.0
    free = np.tile([0.0, 0.0, -9.81 * h], n)
    free[-1] = -1.0
    a = sp.bsr_array(np.diag(np.repeat([1.0, 2.0, 0.5], 3)), blocksize=(3, 3))
    return ContactProblem(a, free, sp.bsr_array(rows, blocksize=(3, 3)), np.zeros(n), np.zeros(n))


def test_full_anticipation_is_that_of_the_reference() -> None:
    problem = _pile()
    found = full_anticipation(problem, None, 1e-9, 500, 1e-9)
    exact = solve_anticipation(problem, tolerance=1e-12)
    assert found.converged
    np.testing.assert_allclose(found.velocity, exact.velocity, atol=1e-8)
    assert np.abs(exact.velocity - problem.free).max() > 0.5  # it stopped the upper mass
    with pytest.raises(InputError, match="without friction"):
        full_anticipation(replace(problem, friction=np.ones(3)), None, 1e-9, 10, 1e-3)


def test_the_papers_solver_moves_a_scene_as_ours_does() -> None:
    ours, theirs = (Simulation(REGISTRY["falling_cloth"](cells=6)) for _ in range(2))
    solver = theirs.stepper.solver = plugged(theirs, "ica")
    assert isinstance(solver, PaperSolver)
    for _ in range(45):
        ours.step()
        report = theirs.step()
    assert report.contacts > 0 and len(solver.outer) > 0 and sum(solver.inner) >= len(solver.inner) > 0
    assert solver.missed == 0
    assert np.abs(ours.positions() - theirs.positions()).max() < 0.02  # of 0.16 m that it fell


def test_slopes_are_those_of_powers() -> None:
    n = [10.0, 50.0, 100.0, 400.0]
    one = contact_scaling.Series("x", n, [0.3 * k**1.3 for k in n])
    assert one.slope() == pytest.approx(1.3)
    assert contact_scaling.Series("x", [30.0, 31.0, 32.0], [1.0, 2.0, 3.0]).slope() is None


def test_shares_count_up_to_the_bound() -> None:
    assert contact_histograms.share(Counter({1: 6, 3: 3, 4: 1}), 3) == pytest.approx(0.9)
    assert contact_histograms.share(Counter(), 3) is None


def test_plots_are_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    n = [30.0, 100.0, 300.0]
    series = [contact_scaling.Series(name, n, [k * x for x in n]) for k, name in enumerate(("newton", "ica"), 1)]
    assert "Plot: " in scaling_figure(series, series[:1], "newton", tmp_path / "a.png")
    bars = [("T", "rounds", Counter({1: 5, 2: 3, 30: 1}), 3, "in three or fewer")] * 4
    assert "Plot: " in histograms_figure(bars, 20, tmp_path / "b.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000 and (tmp_path / "b.png").stat().st_size > 10_000


def test_options_are_the_parameters_of_measure() -> None:
    found = options(letters.measure, ["--count", "3", "--falling", "0.5", "--no-peers"])
    assert (found["count"], found["falling"], found["peers"], found["substeps"]) == (3, 0.5, False, 4)
    assert options(contact_scaling.measure, ["--counts", "2", "4"])["counts"] == [2, 4]
    with pytest.raises(SystemExit):
        options(letters.measure, ["--no-such-option"])


def test_a_small_bench_writes_its_tables_and_plot(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    tables = falling_cloth.measure(None, tmp_path, seconds=0.04, cells=5, peers=False)
    assert not any("aim" in note for note in tables[0].notes)  # it is not the scene that the aim is for
    written = json.loads((tmp_path / "falling_cloth.json").read_text())
    assert [t["title"] for t in written["tables"]] == ["Falling cloth, 0.04 s", "Stages: mean ms a step"]
    assert (tmp_path / "falling_cloth.png").stat().st_size > 10_000
