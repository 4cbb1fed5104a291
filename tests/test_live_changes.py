"""Constraints that are switched, retargeted, added, removed, ramped, broken, and that contradict each other."""

import numpy as np
import pytest

import turnbuckle as tb

SCHEMES = ["explicit_euler", "euler_cromer", "midpoint", "rk2", "verlet", "velocity_verlet", "beeman", "implicit_euler",
           "rk4", "newmark"]  # fmt: skip


def ropes(integrator: str = "verlet", count: int = 2, **more: object) -> tb.Scene:
    """Ropes of 6 points side by side, no gravity unless asked for."""
    scene = tb.Scene("ropes", dt=1e-3, integrator=integrator, **{"gravity": [0.0, 0.0, 0.0], **more})
    for k in range(count):
        scene.add_rope(
            f"r{k}", start=[0, 0.3 * k, 0], end=[1, 0.3 * k, 0], segments=5, mass=0.6, stretch_stiffness=200.0
        )
    return scene


def at(body: str, *indices: int) -> dict:
    return {"body": body, "indices": list(indices)}


@pytest.mark.parametrize("integrator", SCHEMES)
def test_a_far_nail_lands_and_stays(integrator):
    sim = tb.Simulation(ropes(integrator, 1))
    sim.add_constraint("nail", "n", points=at("r0", 0), goal=[0.0, 0.0, 0.02])
    reports = [sim.step() for _ in range(50)]
    assert reports[0].status == ("degraded" if integrator == "explicit_euler" else "ok")
    assert all(r.status == "ok" for r in reports[1:])
    np.testing.assert_allclose(sim.positions("r0")[0], [0, 0, 0.02], atol=1e-15)
    np.testing.assert_allclose(sim.velocities("r0")[0], 0.0, atol=1e-14)
    assert np.abs(sim.positions("r0")[1, 2]) > 1e-5  # the rest follows


@pytest.mark.parametrize("integrator", SCHEMES)
def test_closing_ramp_is_linear_bounded_and_does_not_overshoot(integrator):
    scene = ropes(integrator)
    ramp = {"steps": 40}
    scene.add_constraint("points_to_point", "p", zip=[at("r0", 0), at("r1", 0)], ramp=ramp)
    sim = tb.Simulation(scene)
    gaps = []
    for _ in range(60):
        report = sim.step()
        settles = integrator == "explicit_euler" and len(gaps) < 40
        assert report.status == ("degraded" if report.ramping or settles else "ok"), report.messages
        gaps.append(np.linalg.norm(sim.positions("r1")[0] - sim.positions("r0")[0]))
    late = 1 if integrator == "explicit_euler" else 0
    expected = 0.3 * np.maximum(1.0 - np.arange(1, 61) / 40, 0.0)
    np.testing.assert_allclose(gaps[late:], expected[: 60 - late], atol=1e-3 if late else 1e-12)
    assert gaps[-1] < 1e-14
    relative = sim.velocities("r1")[0] - sim.velocities("r0")[0]
    np.testing.assert_allclose(relative, 0.0, atol=1e-13)


def test_bounded_speed_takes_longer():
    scene = ropes()
    scene.add_constraint("nail", "n", points=at("r0", 0), goal=[0, 0, 0.1], ramp={"steps": 10, "max_speed": 1.0})
    sim = tb.Simulation(scene)
    z = []
    for _ in range(120):
        sim.step()
        z.append(sim.positions("r0")[0, 2])
    np.testing.assert_allclose(np.diff(z)[:98], 1e-3, rtol=1e-9)  # 1 m/s for 100 steps of 1 ms
    assert abs(z[100] - 0.1) < 1e-14


def test_the_papers_ramp_overshoots_and_arrives():
    """4.5 to the letter: j/n of a force that lands in one step closes early and swings by about half."""
    n = 64
    scene = ropes(response="paper", count=1)
    scene.add_constraint("nail", "n", points=at("r0", 0), goal=[0, 0, 0.01], ramp={"steps": n, "mode": "paper"})
    scene.add_constraint("nail", "rest", points=at("r0", 1))
    sim = tb.Simulation(scene)
    z = []
    for _ in range(n + 5):
        sim.step()
        z.append(sim.positions("r0")[0, 2])
    first = int(np.argmax(np.array(z) >= 0.01)) + 1
    assert 0.5 * 2 * n ** (1 / 3) < first < 2.0 * 2 * n ** (1 / 3)
    assert 0.013 < max(z) < 0.017
    assert abs(z[-1] - 0.01) < 1e-15


def test_windows_switch_at_their_steps():
    scene = ropes(gravity=[0, 0, -10.0], count=1)
    scene.add_constraint("nail", "n", points=at("r0", 0), start=0.01, end=0.02)
    sim = tb.Simulation(scene)
    acting = []
    for _ in range(30):
        report = sim.step()
        acting.append(report.active.get("nail", 0))
    assert acting == [0] * 10 + [1] * 10 + [0] * 10
    assert np.abs(sim.forces("n")).max() == 0.0


def test_switch_conflict_names_both_and_changes_nothing():
    scene = ropes()
    scene.add_constraint("nail", "hold", points=at("r0", 0, 1))
    scene.add_constraint("points_to_point", "tie", zip=[at("r0", 1), at("r1", 1)], enabled=False)
    sim = tb.Simulation(scene)
    sim.step()
    with pytest.raises(tb.ConflictError, match=r"hold\[1\].*tie\[0\].*point 1 of 'r0'"):
        sim.switch("tie", True)
    assert sim.step().active == {"nail": 2}
    sim.switch("hold", False)
    sim.switch("tie", True)
    report = sim.step()
    assert report.active == {"points_to_point": 1} and report.position_residual["points_to_point"] < 1e-15
    with pytest.raises(tb.ConflictError, match="tie"):
        sim.switch("hold", True)
    with pytest.raises(tb.ConflictError, match="tie"):
        sim.add_constraint("attach", "a", points=at("r1", 1), to={"body": "r0", "elements": [[3, 4]]})
    assert sim.step().status == "ok"


def test_conflicts_are_found_when_the_scene_is_built():
    scene = ropes()
    scene.add_constraint("nail", "a", points=at("r0", 0, 1), end=1.0)
    scene.add_constraint("nail", "b", points=at("r0", 1, 2), start=0.5)
    with pytest.raises(tb.ConflictError, match=r"'a\[1\]' and 'b\[0\]'.*point 1 of 'r0'.*t = 0.5"):
        scene.build()


def test_windows_that_follow_each_other_do_not_conflict():
    scene = ropes()
    scene.add_constraint("nail", "a", points=at("r0", 0), end=0.005)
    scene.add_constraint("nail", "b", points=at("r0", 0), start=0.005, goal=[0, 0, 0.001])
    sim = tb.Simulation(scene)
    assert all(sim.step().status == "ok" for _ in range(10))
    assert sim.positions("r0")[0, 2] == 0.001


def test_retarget_and_remove():
    sim = tb.Simulation(ropes())
    sim.add_constraint("nail", "n", points=at("r0", 0))
    sim.step()
    sim.retarget("n", [0.0, 0.0, 0.003])
    assert sim.step().status == "ok"
    np.testing.assert_array_equal(sim.positions("r0")[0], [0, 0, 0.003])
    sim.retarget("n", lambda t: [0.0, 0.0, 0.003 + 0.1 * t])
    start = sim.time
    assert sim.step().status == "ok"
    np.testing.assert_allclose(sim.positions("r0")[0, 2], 0.003 + 0.1 * (start + 1e-3), atol=1e-15)
    np.testing.assert_allclose(sim.velocities("r0")[0], [0, 0, 0.1], atol=1e-9)
    now = sim.time
    sim.retarget("n", {"times": [now, now + 0.01], "positions": [[0, 0, 0.005], [0, 0, 0.006]]})
    sim.run(0.005)
    np.testing.assert_allclose(sim.positions("r0")[0, 2], 0.0055, atol=1e-12)
    sim.remove_constraint("n")
    assert sim.step().active == {}
    sim.add_constraint("nail", "n", points=at("r0", 0))  # the name is free again
    assert sim.step().active == {"nail": 1}


def test_many_added_one_by_one():
    """Tables grow; what was there stays."""
    scene = tb.Scene("cloth", gravity=[0, 0, -10.0], dt=1e-3)
    scene.add_cloth("c", size=[1, 1], cells=[9, 9], structural_stiffness=50.0, shear_stiffness=20.0)
    sim = tb.Simulation(scene)
    for k in range(30):
        sim.add_constraint("nail", f"n{k}", points=at("c", 3 * k))
        if k % 3 == 0:
            sim.add_constraint(
                "attach", f"a{k}", points=at("c", 3 * k + 1), to={"body": "c", "elements": [[3 * k + 2, 95]]}
            )
            sim.switch(f"a{k}", False)
        report = sim.step()
        assert report.status == "ok" and report.active["nail"] == k + 1
    held = sim.positions("c")[0:90:3]
    np.testing.assert_array_equal(sim.velocities("c")[0:90:3], 0.0)
    assert len(held) == 30 and np.abs(sim.velocities("c")).max() > 0.05


@pytest.mark.parametrize("integrator", ["verlet", "rk4", "implicit_euler"])
def test_breaks_once_above_its_limit(integrator):
    """A nail under a growing pull lets go when the force passes 5 N, and never comes back."""
    scene = ropes(integrator, count=1)
    scene.add_constraint("nail", "n", points=at("r0", 0), break_force=5.0)
    scene.add_force("pull", expression=["100 * t * m / 0.6", "0", "0"])
    sim = tb.Simulation(scene)
    for _ in range(400):
        report = sim.step()
        if report.broken:
            break
    assert report.broken == ["n[0]"] and "broke: n[0]" in " ".join(report.messages)
    x = sim.positions("r0")[0].copy()
    sim.run(0.05)
    assert sim.positions("r0")[0, 0] > x[0] + 1e-4 and np.abs(sim.forces("n")).max() == 0.0
    sim.switch("n", False)
    sim.switch("n", True)
    assert sim.step().active.get("nail", 0) == 0


def test_a_ramp_does_not_break():
    scene = ropes(count=1)
    scene.add_constraint("nail", "n", points=at("r0", 0), goal=[0, 0, 0.2], ramp={"steps": 3}, break_force=20.0)
    sim = tb.Simulation(scene)
    first = sim.step()
    assert np.linalg.norm(sim.forces("n")) > 20.0 and not first.broken


@pytest.mark.parametrize("integrator", SCHEMES)
def test_conflicts_that_agree_are_met_together(integrator):
    """A closed triangle of ties on shared points, one of them redundant, and a nail in it."""
    scene = ropes(integrator, 3, conflicts="solve", gravity=[0, 0, -10.0])
    scene.add_constraint("points_to_point", "ab", zip=[at("r0", 0), at("r1", 0)])
    scene.add_constraint("points_to_point", "bc", zip=[at("r1", 0), at("r2", 0)])
    scene.add_constraint("points_to_point", "ca", zip=[at("r2", 0), at("r0", 0)])
    scene.add_constraint("nail", "n", points=at("r0", 0))
    scene.add_constraint(
        "attach", "t", points=at("r1", 5), to={"body": "r0", "elements": [[4, 5]]}, weights=[[0.5, 0.5]]
    )
    scene.add_constraint("points_to_point", "alone", zip=[at("r1", 3), at("r2", 3)])
    sim = tb.Simulation(scene)
    reports = [sim.step() for _ in range(60)]
    assert all(r.status == "ok" for r in reports[1:]), reports[-1].messages
    x = [sim.positions(f"r{k}") for k in range(3)]
    np.testing.assert_allclose(x[0][0], 0.0, atol=1e-13)
    np.testing.assert_allclose(x[1][0], 0.0, atol=1e-13)
    np.testing.assert_allclose(x[2][0], 0.0, atol=1e-13)
    np.testing.assert_allclose(x[1][5], 0.5 * (x[0][4] + x[0][5]), atol=1e-13)
    np.testing.assert_allclose(x[1][3], x[2][3], atol=1e-13)
    assert x[0][5, 2] < -1e-3
    assert max(r.momentum_error[0] for r in reports) < 1e-12


def test_conflicts_that_contradict_get_the_least_correction():
    scene = ropes(count=1, conflicts="solve")
    scene.add_constraint("nail", "low", points=at("r0", 0), goal=[0, 0, -0.01])
    scene.add_constraint("nail", "high", points=at("r0", 0), goal=[0, 0, 0.03])
    scene.add_constraint("nail", "apart", points=at("r0", 5))
    sim = tb.Simulation(scene)
    for _ in range(5):
        report = sim.step()
    assert report.status == "degraded" and "nail" in report.messages[0]
    np.testing.assert_allclose(sim.positions("r0")[0], [0, 0, 0.01], atol=1e-14)
    np.testing.assert_allclose(report.position_residual["nail"], 0.02, rtol=1e-12)
    np.testing.assert_allclose(sim.residuals("low"), 0.02, rtol=1e-12)
    assert sim.residuals("apart")[0] < 1e-15


def test_two_sliders_meet_on_one_line():
    """Two points may slide on one rope; where they come to the same segment they are still exact with conflicts: solve."""
    scene = tb.Scene("sliders", dt=1e-3, gravity=[0, 0, -10.0], conflicts="solve")
    scene.add_rope("rail", start=[0, 0, 0], end=[1, 0, 0], segments=10, mass=1.0, stretch_stiffness=2000.0)
    scene.add_rope("a", start=[0.12, 0, 0], end=[0.12, 0, -0.2], segments=2, mass=0.2, velocity=[1.0, 0, 0])
    scene.add_rope("b", start=[0.88, 0, 0], end=[0.88, 0, -0.2], segments=2, mass=0.2, velocity=[-1.0, 0, 0])
    scene.add_constraint("nail", "ends", points=at("rail", 0, 10))
    scene.add_constraint("slide", "sa", points=at("a", 0), on={"body": "rail", "rope": True})
    scene.add_constraint("slide", "sb", points=at("b", 0), on={"body": "rail", "rope": True})
    sim = tb.Simulation(scene)
    start = sim.positions("a")[0, 0]
    for _ in range(500):
        report = sim.step()
        assert report.status == "ok", report.messages
    assert sim.positions("a")[0, 0] > start + 0.3


def test_failed_step_leaves_the_last_good_state():
    scene = ropes(count=1, integrator="euler_cromer")
    scene.add_constraint("nail", "n", points=at("r0", 0), goal=[0, 0, 0.1], ramp={"steps": 500})
    scene.add_force("bang", callable=lambda x, v, t, m: np.where(t > 0.0105, np.nan, 0.0) * np.ones((len(x), 3)))
    sim = tb.Simulation(scene)
    reports = [sim.step() for _ in range(10)]
    assert reports[-1].status == "degraded"  # ramping
    x, time, ramp = sim.positions().copy(), sim.time, sim.state.tables.nail.ramp.step.numpy().copy()
    for _ in range(2):
        failed = sim.step()
        assert failed.status == "failed" and "bang" in failed.messages[0]
    np.testing.assert_array_equal(sim.positions(), x)
    np.testing.assert_array_equal(sim.state.tables.nail.ramp.step.numpy(), ramp)
    assert sim.time == time


@pytest.mark.parametrize("dt", [0.0, -1e-3, float("nan"), float("inf")])
def test_a_step_must_go_forward(dt):
    sim = tb.Simulation(ropes())
    with pytest.raises(ValueError, match="dt must be a positive"):
        sim.step(dt)


def test_blow_up_fails_and_says_so():
    scene = ropes(count=1, gravity=[0, 0, -10.0])
    sim = tb.Simulation(scene)
    sim.state.set_positions(sim.positions() + 0.01 * np.random.default_rng(0).standard_normal((6, 3)))
    status = ""
    for _ in range(400):
        report = sim.step(0.9)
        status = report.status
        if status == "failed":
            break
    assert status == "failed" and "smaller dt" in report.messages[0]
    assert np.isfinite(sim.positions()).all()


def test_newmark_on_a_stiff_turning_rope_fails_or_stays_sane():
    """A horizontal rope of stiff springs swings down in steps that are far too long for its springs."""
    scene = tb.Scene("stiff", integrator="newmark", dt=0.01)
    scene.add_rope("r", start=[0, 0, 0], end=[1, 0, 0], segments=99, stretch_stiffness=1e5, mass=0.1)
    scene.add_constraint("nail", "n", points=at("r", 0))
    sim = tb.Simulation(scene)
    for _ in range(40):
        report = sim.step()
        if report.status == "failed":
            assert "Newton" in report.messages[0]
            break
        assert report.energies["kinetic"] < 2.0


def test_contradictions_under_implicit_schemes_have_sane_forces():
    scene = ropes("implicit_euler", 1, conflicts="solve")
    scene.add_constraint("nail", "a", points=at("r0", 0), goal=[0, 0, -0.05])
    scene.add_constraint("nail", "b", points=at("r0", 0), goal=[0, 0, 0.05])
    sim = tb.Simulation(scene)
    report = sim.run(0.02)
    assert report.status == "degraded"
    assert np.abs(sim.forces("a")).max() < 1e6
    np.testing.assert_allclose(sim.positions("r0")[0], 0.0, atol=1e-12)


def test_names_that_are_not_there():
    sim = tb.Simulation(ropes())
    with pytest.raises(tb.InputError, match="no body 'cloth'"):
        sim.positions("cloth")
    with pytest.raises(tb.InputError, match="no body 'cloth'"):
        sim.add_constraint("nail", "n", points=at("cloth", 0))
    with pytest.raises(tb.InputError, match="no constraint 'n'"):
        sim.switch("n", True)
    with pytest.raises(tb.InputError, match="unknown type 'glue'"):
        sim.add_constraint("glue", "n", points=at("r0", 0))
    with pytest.raises(tb.InputError, match=r"\(12, 3\)"):
        sim.state.set_positions(np.zeros((3, 3)))
    assert sim.step().status == "ok"
