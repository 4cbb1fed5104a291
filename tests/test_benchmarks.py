"""The benchmarks measure what they say: tables, fits, our own curtain, a peer's protocol, the registry."""

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from turnbuckle.benchmarks import REGISTRY
from turnbuckle.benchmarks.chain import chain_table, measure_chain
from turnbuckle.benchmarks.monocycle import ride, rides_table
from turnbuckle.benchmarks.own import measure_curtain
from turnbuckle.benchmarks.peers import launch
from turnbuckle.benchmarks.peers.chain_protocol import ChainResult, ChainTask, worst_gap
from turnbuckle.benchmarks.peers.launch import Peer, run_peer
from turnbuckle.benchmarks.peers.protocol import DENSITY, Task, lumped_masses, simulate
from turnbuckle.benchmarks.plot import figure_two, scaling
from turnbuckle.benchmarks.table import Table, busy_note, publish, text
from turnbuckle.benchmarks.timing import line_fit
from turnbuckle.scenes.curtain_geometry import curtain_geometry


def test_line_fit_finds_the_line_and_shows_a_curve() -> None:
    n = np.array([1e3, 1e4, 1e5])
    a, b, misfit = line_fit(n, 0.3 + 2e-3 * n)
    assert (a, b) == (pytest.approx(0.3), pytest.approx(2e-3))
    assert np.abs(misfit).max() < 1e-12
    assert line_fit(n, 1e-3 * n**1.2)[2][-1] > 0.05  # an upward curve lies above its line at the largest size


def test_table_is_written_for_people_and_scripts(tmp_path: Path) -> None:
    table = Table("T", ["what", "n", "ms"], notes=["a note"])
    table.add("first", 11924, 1.2345)
    table.add("second", 3, None)
    with pytest.raises(ValueError, match="2 cells for 3 columns"):
        table.add("short", 1)
    publish("t", [table], Console(quiet=True), tmp_path)
    page = (tmp_path / "t.md").read_text()
    assert "| first | 11,924 | 1.23 |" in page and "| second | 3 | - |" in page and "* a note" in page
    data = json.loads((tmp_path / "t.json").read_text())
    assert data["tables"][0]["rows"] == [["first", 11924, 1.2345], ["second", 3, None]]
    assert data["machine"]["cores"] >= 1


def test_cells() -> None:
    assert [text(cell) for cell in (1234.5, 0.00012345, 12, None, "x")] == ["1234", "0.000123", "12", "-", "x"]


def test_a_busy_machine_is_said() -> None:
    assert busy_note(None) == busy_note(0.0) == []
    assert "ratios unsafe" in busy_note(1000.0)[0]


def test_our_curtain_moves_and_holds() -> None:
    own = measure_curtain(4, seconds=0.2, least=60)
    assert (own.cubes, own.constraints) == (70, 16 + 76 * 3)
    assert own.status == "ok"
    assert own.relative_gap <= 1e-12
    assert own.dropped > 1e-3  # it fell about g t^2 / 2 = 18 mm in 60 steps of 1 ms, held at the top
    assert own.ms_per_step > 0.0 and {"forces", "constraints"} <= own.stages_ms.keys()


def test_gap_is_the_worst_of_joints_and_nails() -> None:
    curtain = curtain_geometry(3, 2)
    x = curtain.vertices.copy()
    assert curtain.worst_gap(x) == 0.0
    x[curtain.pairs[0, 1]] += [0.0, 0.0, 0.01]
    assert curtain.worst_gap(x) == pytest.approx(0.01)
    x[curtain.nails[3]] += [0.03, 0.0, 0.04]
    assert curtain.worst_gap(x) == pytest.approx(0.05)


def test_masses_are_those_of_the_solid() -> None:
    curtain = curtain_geometry(2, 1, 0.1)
    assert lumped_masses(curtain).sum() == pytest.approx(DENSITY * 2 * 0.1**3)


def test_a_peer_answers_with_what_it_measured(capsys: pytest.CaptureFixture[str]) -> None:
    curtain = curtain_geometry(2)
    x = curtain.vertices.copy()

    def sink() -> None:
        x[:, 1] -= 1e-3

    simulate(Task(m=2, steps=6, dt=1e-3, iterations=1, seconds=5.0), sink, lambda: x, "sinker", "0", "not held", 2)
    answer = json.loads(capsys.readouterr().out)
    assert answer["steps"] == 6
    assert answer["gap"] == pytest.approx(7e-3)  # four steps of warm-up, three calls: the nails are as far away
    assert answer["dropped"] == pytest.approx(7e-3)


def test_a_missing_peer_is_a_line_and_a_broken_one_too(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = Peer("nobody", "no_such_package_anywhere", ("curtain_nobody",))
    assert run_peer(missing, 2, 1e-3) == "nobody skipped: pip install no_such_package_anywhere"
    broken = Peer("broken", "json", ("curtain_nobody",))
    assert "broken failed with exit code 1" in run_peer(broken, 2, 1e-3)
    monkeypatch.setattr(launch, "TIMEOUT", 0.01)
    assert "no answer" in run_peer(broken, 2, 1e-3)


def test_plots_are_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert "Plot: " in figure_two([(100, 1.0), (1000, 9.0)], 0.0, [(100, 12.0)], [], tmp_path / "a.png")
    assert "Plot: " in scaling([100, 1000], [1.0, 9.0], 0.1, 0.0089, tmp_path / "b.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000 and (tmp_path / "b.png").stat().st_size > 10_000


def test_our_chain_swings_and_stays_closed() -> None:
    own = measure_chain(10, seconds=0.0, least=30)
    assert own.status == "ok" and 0.0 < own.gap <= 1e-10 and own.moved > 0.01
    answer = ChainResult("opener", "0", 10, 30, 2.0 * own.ms_per_step, 0.01, 1.0, "not held")
    table = chain_table([own], [answer, "nobody skipped: pip install nobody"])
    assert table.rows[1][4] == pytest.approx(2.0) and "nobody skipped: pip install nobody" in table.notes


def test_gap_of_a_chain_is_that_of_its_worst_joint() -> None:
    ends, q = ChainTask(5, 0, 0.0).start()
    x = 0.5 * (ends[1:] + ends[:-1])
    assert worst_gap(x, q, ends[0], ends[-1]) < 1e-15
    x[4] += [0.0, 0.03, 0.0]
    assert worst_gap(x[:5], q, ends[0], ends[-1]) == pytest.approx(0.03)
    assert worst_gap(x[:4], q[:4], ends[0], None) < 1e-15


def test_ride_counts_iterations() -> None:
    one = ride(2, seconds=0.2)
    assert one.iterations.total() == 12 and max(one.iterations) < 200
    assert rides_table([one]).rows[0][1] == sorted(one.iterations.elements())[5]


def test_registry_names_what_can_be_measured() -> None:
    contact = {"falling_cloth", "letters", "dancer", "contact_scaling", "contact_histograms", "local_global"}
    contact |= {"contact_windows"}
    assert set(REGISTRY) == {"curtain", "constraints", "scaling", "chain", "monocycle", "ccd", "view"} | contact


def test_the_page_is_measured_without_a_browser(tmp_path: Path) -> None:
    pytest.importorskip("viser")
    (table,) = REGISTRY["view"](Console(quiet=True), tmp_path, cells=12, seconds=0.3, browser=False)
    frames = {row[0]: row[1] for row in table.rows}
    assert frames["server alone"] > frames["server and socket"] > 10.0, "one frame arrives before the next is made"
    assert (tmp_path / "view.md").exists()
