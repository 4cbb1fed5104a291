"""A simulation in a thread of its own: commands, the hand, pins, other schemes, frames. No browser, no server."""

import os
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import turnbuckle
from turnbuckle.live.commands import Commands
from turnbuckle.live.picking import Pick, nearest, pick_ray
from turnbuckle.live.posing import Poser, checked_name
from turnbuckle.live.session import Session

WAIT = 60.0  # [s] at most, for kernels that are compiled


def hanging(**fields: Any) -> turnbuckle.Scene:
    scene = turnbuckle.Scene("hanging", **{"dt": 1e-3, "integrator": "velocity_verlet", **fields})
    scene.add_rope("rope", start=[0, 0, 1], end=[1, 0, 1], segments=10, stretch_stiffness=200.0, damping=0.05)
    scene.add_constraint("nail", "left", points={"body": "rope", "index": 0})
    scene.add_constraint("nail", "right", points={"body": "rope", "index": 10})
    return scene


def pendulum(**fields: Any) -> turnbuckle.Scene:
    scene = turnbuckle.Scene("pendulum", **{"dt": 2e-3, **fields})
    scene.add_rigid("bob", box=[0.1, 0.1, 0.4], position=[0, 0, -0.2])
    scene.add_joint("ball", "pivot", body1="bob", anchor=[0, 0, 0])
    return scene


@contextmanager
def live(scene: turnbuckle.Scene) -> Iterator[Session]:
    session = Session(scene)
    session.start()
    try:
        yield session
    finally:
        session.close()


def done(future: "Future[Any]") -> Any:
    return future.result(timeout=WAIT)


def test_commands_are_carried_out_in_order_and_one_of_a_key_is_enough() -> None:
    commands, seen = Commands(), []
    old = commands.put(lambda: seen.append("old"), key="k")
    commands.put(lambda: seen.append("a"))
    commands.put(lambda: seen.append("new"), key="k")
    wrong = commands.put(lambda: 1 / 0)
    assert commands.carry_out() == 3 and seen == ["a", "new"]
    assert old.cancelled() and isinstance(wrong.exception(), ZeroDivisionError)


def test_runs_pauses_steps_and_goes_back_to_the_start() -> None:
    with live(hanging()) as session:
        start = session.frame.x.copy()
        report = done(session.step(3))
        assert report.status == "ok" and session.frame.steps == 3 and not session.frame.running
        done(session.run())
        end = time.monotonic() + WAIT
        while session.frame.steps < 20 and time.monotonic() < end:
            time.sleep(0.01)
        done(session.pause())
        steps = done(session.do(lambda s: s.state.steps))
        assert steps >= 20
        time.sleep(0.1)
        assert done(session.do(lambda s: s.state.steps)) == steps, "it goes on though it is paused"
        done(session.reset())
        assert session.frame.steps == 0 and session.frame.time == 0.0
        assert np.array_equal(session.frame.x, start)


def test_time_goes_at_the_speed_that_is_asked_for() -> None:
    with live(hanging()) as session:
        done(session.step(2))
        done(session.set_speed(0.1))
        begin, t = done(session.do(lambda s: s.time)), time.monotonic()
        done(session.run())
        time.sleep(0.6)
        done(session.pause())
        ran, wall = done(session.do(lambda s: s.time)) - begin, time.monotonic() - t
        assert 0.02 < ran <= 0.1 * wall + 0.01
        with pytest.raises(turnbuckle.InputError, match="speed"):
            done(session.set_speed(0.0))


def test_a_command_never_waits_for_a_step() -> None:
    with live(hanging()) as session:
        done(session.step(1))
        busy = session.do(lambda s: time.sleep(0.5))
        begin = time.monotonic()
        for _ in range(100):
            session.drag([0.0, 0.0, 0.0])
        waiting = session.switch("left", False)
        assert time.monotonic() - begin < 0.2 and not waiting.done()
        done(busy)
        done(waiting)
        assert not done(session.do(lambda s: s.state.groups["left"].enabled))


def test_switches_show_in_the_state_and_in_the_readings() -> None:
    with live(hanging()) as session:
        done(session.step(5))
        reading = {r.name: r for r in session.frame.readings}["right"]
        assert reading.acting and reading.force > 0.0 and reading.residual < 1e-12
        done(session.switch("right", False))
        done(session.step(200))
        reading = {r.name: r for r in session.frame.readings}["right"]
        assert not reading.on and not reading.acting
        assert session.frame.x[10, 2] < 0.9, "the end that was let go must fall"
        with pytest.raises(turnbuckle.InputError, match="nothing"):
            done(session.switch("nothing", True))
        assert "nothing" in session.notes[-1], "what was refused is told on the page"


def test_a_vertex_follows_the_hand_and_stays_a_while_exactly_on_its_goal() -> None:
    with live(hanging()) as session:
        done(session.step(1))
        for exact in (False, True):
            x = session.frame.x
            done(session.grab(nearest(session.shapes, 0, x, x[5]), exact))
            goal = x[5] + [0.0, 0.1, 0.05]
            done(session.drag(goal))
            done(session.step(600))
            assert np.abs(session.frame.x[5] - goal).max() < 1e-6
            assert session.frame.pull is not None and np.abs(session.frame.pull.target - goal).max() == 0.0
            residual = {r.name: r for r in session.frame.readings}["hand_nail"].residual
            assert residual < 1e-12
            done(session.let_go())
            done(session.step(100))
            assert "hand_nail" not in done(session.do(lambda s: list(s.state.groups)))
            assert np.abs(session.frame.x[5] - goal).max() > 1e-3
            assert session.frame.pull is None


def test_the_way_of_the_hand_is_smooth_even_where_the_mouse_jumps() -> None:
    with live(hanging(gravity=[0, 0, 0])) as session:
        done(session.step(1))
        done(session.grab(Pick(0, 5, session.frame.x[5]), False))
        done(session.drag(session.frame.x[5] + [0.0, 0.3, 0.0]))
        places = []
        for _ in range(300):
            done(session.step(1))
            places.append(session.frame.x[5, 1])
        speed = np.diff([0.0, *places]) / 1e-3
        assert abs(speed[0]) < 0.2 and np.abs(np.diff(speed)).max() < 25.0**2 * 0.3 * 1e-3 * 1.1
        assert max(places) < 0.3 + 1e-9, "critically damped: it does not overshoot"


def test_a_nailed_point_is_not_torn_but_the_free_one_beside_it_taken() -> None:
    with live(hanging()) as session:
        done(session.step(1))
        assert "point 1 of" in done(session.grab(Pick(0, 0, session.frame.x[0])))
        done(session.let_go())


def test_a_rigid_body_is_pulled_towards_the_hand_and_its_joint_holds() -> None:
    with live(pendulum()) as session:
        done(session.step(1))
        done(session.grab(nearest(session.shapes, 0, session.frame.x, np.array([0.0, 0.0, -0.4]))))
        done(session.drag([0.5, 0.0, -0.1]))
        done(session.step(1000))
        middle = done(session.do(lambda s: s.pose("bob")[0]))
        assert 30.0 < np.degrees(np.arctan2(middle[0], -middle[2])) < 90.0
        assert done(session.do(lambda s: s.joint_residual("pivot")))[0] < 1e-10
        speed = done(session.do(lambda s: np.abs(s.velocity("bob")[1]).max()))
        assert speed < 0.1, "it comes to rest"
        done(session.let_go())
        done(session.step(1))
        assert done(session.do(lambda s: np.abs(s.state.loads.force).max())) == 0.0


def test_a_rigid_body_can_be_held_exactly() -> None:
    scene = turnbuckle.Scene("box", dt=1e-3)
    scene.add_rigid("box", box=[0.1, 0.1, 0.1], position=[0, 0, 1])
    with live(scene) as session:
        done(session.step(1))
        corner = session.frame.x[0].copy()
        done(session.grab(Pick(0, 0, corner), True))
        done(session.drag(corner + [0.0, 0.0, 0.2]))
        done(session.step(300))
        assert np.abs(session.frame.x[0] - corner - [0.0, 0.0, 0.2]).max() < 1e-9


def test_pins_hold_points_and_bodies_and_come_off_again() -> None:
    with live(hanging()) as session:
        done(session.step(1))
        place = session.frame.x[5].copy()
        pick = Pick(0, 5, place)
        assert "pinned" in done(session.toggle_pin(pick))
        done(session.step(300))
        assert np.abs(session.frame.x[5] - place).max() < 1e-12 and len(session.frame.pins) == 1
        # a pin that is dragged stays where it was let go
        done(session.grab(Pick(0, 5, session.frame.x[5])))
        done(session.drag(place + [0.0, 0.1, 0.0]))
        done(session.step(600))
        done(session.let_go())
        done(session.step(200))
        assert np.abs(session.frame.x[5] - place - [0.0, 0.1, 0.0]).max() < 1e-6
        assert "unpinned" in done(session.toggle_pin(Pick(0, 5, session.frame.x[5])))
        done(session.step(200))
        assert np.abs(session.frame.x[5] - place).max() > 1e-2 and len(session.frame.pins) == 0
    with live(pendulum()) as session:
        done(session.step(1))
        corner = session.frame.x[0].copy()
        done(session.toggle_pin(Pick(0, 0, corner)))
        done(session.step(200))
        assert np.abs(session.frame.x[0] - corner).max() < 1e-9
        done(session.unpin_all())
        assert done(session.do(lambda s: list(s.state.joints))) == ["pivot"]


def test_another_scheme_goes_on_from_the_same_moment() -> None:
    with live(hanging()) as session:
        done(session.step(100))
        done(session.switch("right", False))
        done(session.toggle_pin(Pick(0, 5, session.frame.x[5])))
        done(session.step(50))
        x, t = session.frame.x.copy(), session.frame.time
        done(session.set_field("integrator", "rk4"))
        assert done(session.do(lambda s: s.model.integrator)) == "rk4"
        assert np.array_equal(session.frame.x, x) and session.frame.time == t
        assert not done(session.do(lambda s: s.state.groups["right"].enabled)) and len(session.frame.pins) == 1
        done(session.step(20))
        assert session.frame.status == "ok" and np.abs(session.frame.x - x).max() < 0.1
        with pytest.raises(turnbuckle.InputError, match="integrator"):
            done(session.set_field("integrator", "nonsense"))
        assert done(session.do(lambda s: s.model.integrator)) == "rk4", "what is refused changes nothing"


def test_gravity_and_time_step_act_at_once() -> None:
    with live(pendulum()) as session:
        done(session.step(1))
        done(session.set_gravity([0.0, 0.0, 0.0]))
        done(session.set_dt(1e-3))
        before = session.frame.time
        done(session.step(10))
        assert session.frame.time == pytest.approx(before + 0.01, abs=1e-12)
        assert done(session.do(lambda s: np.abs(s.velocity("bob")[1]).max())) < 1e-3
        with pytest.raises(turnbuckle.InputError, match="dt"):
            done(session.set_dt(-1.0))


def test_a_step_that_fails_pauses_and_says_why() -> None:
    scene = hanging(dt=0.5)
    with live(scene) as session:
        done(session.set_speed(1e6))
        done(session.run())
        end = time.monotonic() + WAIT
        while session.frame.status != "failed" and time.monotonic() < end:
            time.sleep(0.01)
        assert session.frame.status == "failed" and not session.running and session.frame.messages
        done(session.reset())
        assert session.frame.status == ""


def test_frames_are_kept_at_the_rate_of_the_scene() -> None:
    with live(hanging(frames_per_second=100.0)) as session:
        done(session.record(True))
        done(session.step(100))
        kept = done(session.record(False))
        assert len(kept) == 11 and kept[-1][0] == pytest.approx(0.1, abs=1e-9)
        assert np.array_equal(kept[-1][1], session.frame.x) and session.recording is None


def test_a_body_is_posed_by_hand_and_the_scene_is_saved(tmp_path) -> None:
    scene = pendulum()
    scene.add_rigid("second", box=[0.1, 0.1, 0.4], position=[0, 0, -0.6])
    scene.add_joint("ball", "elbow", body0="bob", body1="second", anchor=[0, 0, -0.4])
    with live(scene) as session:
        poser = Poser(session)
        done(poser.grab(nearest(session.shapes, 1, session.frame.x, np.array([0.05, 0.05, -0.8]))))
        target = np.array([0.4, 0.1, -0.5])
        done(poser.drag(target))
        done(poser.let_go())
        x = session.frame.x
        assert np.linalg.norm(x - target, axis=1).min() < 1e-6
        assert max(done(session.do(lambda s: [s.joint_residual(n)[0] for n in ("pivot", "elbow")]))) < 1e-8
        path = done(poser.save("posed.yaml", tmp_path))
        again = turnbuckle.Simulation(turnbuckle.Scene.load(path))
        assert np.abs(again.positions() - x).max() < 1e-12
        for wrong in ("../posed.yaml", "/posed.yaml", "posed.txt", "", ".yaml"):
            with pytest.raises(turnbuckle.InputError, match="save as"):
                checked_name(wrong, tmp_path)


def test_open_joints_are_closed() -> None:
    scene = turnbuckle.Scene("open")
    scene.add_rigid("bob", box=[0.1, 0.1, 0.4], position=[0.3, 0, -0.2])
    scene.add_joint("ball", "pivot", body1="bob", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0.2])
    with live(scene) as session:
        done(Poser(session).assemble())
        assert "closed" in session.notes[-1]
        assert done(session.do(lambda s: s.joint_residual("pivot")))[0] < 1e-9


def test_contact_forces_carry_the_weight() -> None:
    scene = turnbuckle.Scene("resting", dt=5e-3, contact={"friction": 0.5})
    scene.add_obstacle("ground", plane=[2, 2])
    scene.add_rigid("box", box=[0.2, 0.2, 0.2], position=[0, 0, 0.103], mass=2.0)
    with live(scene) as session:
        done(session.step(60))
        arrows = session.frame.contacts
        on_box = np.where(arrows.at[:, 2:] > 1e-4, 1.0, -1.0)  # side a of a contact may be the ground
        assert (on_box * arrows.force).sum(axis=0) == pytest.approx([0.0, 0.0, 2.0 * 9.81], rel=1e-2, abs=0.1)
        assert session.frame.touching >= 3
        done(session.set_friction(0.05))
        assert done(session.do(lambda s: float(s.model.surfaces.friction[0, 1, 0]))) == pytest.approx(0.05)
        done(session.set_contact("solver", "ica"))
        assert done(session.do(lambda s: s.model.contact.solver)) == "ica"
        done(session.step(5))
        assert session.frame.status in ("ok", "degraded")


def test_a_ray_finds_the_body_in_front_and_ropes_beside_it() -> None:
    scene = pendulum()
    scene.add_rope("rope", start=[1, 0, 0], end=[1, 0, -1], segments=10, density=1.0)
    session = Session(scene)
    x, shapes = session.frame.x, session.shapes
    hit = pick_ray(shapes, x, np.array([0.01, -3.0, -0.21]), np.array([0.0, 1.0, 0.0]))
    assert hit is not None and shapes[hit.shape].name == "bob" and hit.place == pytest.approx([0.01, -0.05, -0.21])
    rope = pick_ray(shapes, x, np.array([1.004, -3.0, -0.5]), np.array([0.0, 1.0, 0.0]))
    assert rope is not None and shapes[rope.shape].name == "rope" and hit.point != rope.point
    assert pick_ray(shapes, x, np.array([5.0, -3.0, 0.0]), np.array([0.0, 1.0, 0.0])) is None


def test_gravity_stays_after_a_reset_and_is_saved() -> None:
    with live(hanging()) as session:
        done(session.set_gravity([0.0, 0.0, 1.5]))
        done(session.step(2))
        done(session.reset())
        assert done(session.do(lambda s: s.state.gravity.tolist())) == [0.0, 0.0, 1.5]
        assert session.scene.definition.gravity.tolist() == [0.0, 0.0, 1.5]


def test_forces_have_colours() -> None:
    from turnbuckle.live.paint import OFF, force_colors

    with live(hanging()) as session:
        done(session.step(300))
        done(session.switch("right", False))
        done(session.step(1))
        left, right = force_colors(session.frame.readings)
        assert tuple(right) == OFF and left[2] > left[1] + 50, "the only force is the largest: violet"


def test_the_simulation_gives_way_to_the_page() -> None:
    if not sys.platform.startswith("linux"):
        pytest.skip("threads have priorities of their own on Linux alone")
    with live(hanging()) as session:
        usual = os.getpriority(os.PRIO_PROCESS, threading.main_thread().native_id)
        own = done(session.do(lambda _: os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))
        assert own >= max(usual, 5)
