"""The page in a real browser: mouse and keyboard on one side, the state of the simulation on the other."""

import io
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_driver import CHROMIUM, PATIENCE, chromium, cloth, in_simulation, opener, pixel, until
from PIL import Image

import turnbuckle
from turnbuckle.io import read_recording

pytest.importorskip("viser")
pytest.importorskip("playwright.sync_api")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., tuple[Any, Any]]]:
    with opener(browser) as found:
        yield found


def test_a_vertex_that_is_dragged_goes_where_the_mouse_goes(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    session = shown.source
    until(lambda: session.frame.steps > 0, "the first step")
    point = int(np.argmin(np.linalg.norm(session.frame.x - [0.5, 0.0, 1.25], axis=1)))
    start = session.frame.x[point].copy()
    x, y = pixel(shown, page, start)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20, y - 10)
    page.mouse.move(x + 60, y - 40)
    held = until(lambda: session.frame.pull, "the hand to hold")
    assert np.linalg.norm(held.place - start) < 0.3
    assert in_simulation(shown, lambda s: "hand_nail" in s.state.groups)
    (goal,) = until(lambda: _aimed(session), "the hand to follow")
    until(lambda: session.frame.pull and np.linalg.norm(session.frame.pull.place - goal) < 1e-3, "the vertex to arrive")
    taken = in_simulation(shown, lambda s: int(s.state.groups["hand_nail"].points[0]))
    at = in_simulation(shown, lambda s: s.positions()[taken].copy())
    assert np.linalg.norm(at - goal) < 1e-3
    assert np.hypot(*(np.array(pixel(shown, page, at)) - (x + 60, y - 40))) < 12.0, "it is where the mouse is"
    page.mouse.up()
    until(lambda: session.frame.pull is None, "the hand to let go")
    assert not in_simulation(shown, lambda s: "hand_nail" in s.state.groups)
    steps = session.frame.steps
    until(lambda: session.frame.steps > steps + 100, "more steps")
    assert np.linalg.norm(in_simulation(shown, lambda s: s.positions()[taken].copy()) - goal) > 5e-3


def _aimed(session: Any) -> tuple[np.ndarray] | None:
    """The target of the hand, once it no longer changes."""
    pull = session.frame.pull
    if pull is None:
        return None
    time.sleep(0.5)
    again = session.frame.pull
    return (pull.target,) if again is not None and np.array_equal(pull.target, again.target) else None


def test_a_switch_on_the_page_switches_the_constraint(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    session = shown.source
    until(lambda: session.frame.readings, "readings")
    page.get_by_role("tab", name="Constraints").click()
    page.get_by_text("nail x 9").wait_for(timeout=1e3 * PATIENCE)
    switch = page.get_by_label("top", exact=True)
    switch.uncheck(timeout=1e3 * PATIENCE)
    until(lambda: not in_simulation(shown, lambda s: s.state.groups["top"].enabled), "the constraint to be off")
    until(lambda: session.frame.x[:, 2].max() < 1.9, "the cloth to fall")
    switch.check(timeout=1e3 * PATIENCE)
    until(lambda: in_simulation(shown, lambda s: s.state.groups["top"].acting), "the constraint to act")


def test_buttons_run_pause_step_and_reset(open_page: Any) -> None:
    shown, page = open_page(cloth())
    session = shown.source
    page.get_by_role("button", name="Step").click()
    until(lambda: session.frame.steps == 1, "one step")
    page.get_by_role("button", name="Run", exact=True).click()
    until(lambda: session.frame.steps > 10, "steps")
    page.get_by_role("button", name="Pause").click()
    until(lambda: not session.frame.running, "the pause")
    steps = in_simulation(shown, lambda s: s.state.steps)
    page.get_by_text(f"step {steps}").wait_for(timeout=1e3 * PATIENCE)
    page.get_by_role("button", name="Reset").click()
    until(lambda: in_simulation(shown, lambda s: s.state.steps) == 0, "the start")


def test_a_click_pins_and_another_unpins(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    session = shown.source
    until(lambda: session.frame.steps > 0, "the first step")
    place = session.frame.x[int(np.argmin(np.linalg.norm(session.frame.x - [0.5, 0.0, 1.5], axis=1)))]
    page.mouse.click(*pixel(shown, page, place))
    until(lambda: len(session.frame.pins) == 1, "a pin")
    pinned = in_simulation(shown, lambda s: [g for n, g in s.state.groups.items() if n.startswith("hand_pin")][0])
    at = session.frame.pins[0]
    steps = session.frame.steps
    until(lambda: session.frame.steps > steps + 50, "more steps")
    assert np.abs(in_simulation(shown, lambda s: s.positions()[pinned.points[0]].copy()) - at).max() < 1e-12
    page.mouse.click(*pixel(shown, page, at))
    until(lambda: len(session.frame.pins) == 0, "no pin")


def test_a_rigid_body_is_dragged(open_page: Any) -> None:
    scene = turnbuckle.Scene("pendulum", dt=2e-3)
    scene.add_rigid("bob", box=[0.15, 0.15, 0.5], position=[0, 0, -0.25])
    scene.add_joint("ball", "pivot", body1="bob", anchor=[0, 0, 0])
    shown, page = open_page(scene, run=True)
    session = shown.source
    until(lambda: session.frame.steps > 0, "the first step")
    x, y = pixel(shown, page, np.array([0.0, 0.0, -0.4]))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10, y)
    page.mouse.move(x + 150, y - 30)
    until(lambda: in_simulation(shown, lambda s: abs(s.pose("bob")[0][0]) > 0.05), "the bob to swing out")
    assert in_simulation(shown, lambda s: s.joint_residual("pivot"))[0] < 1e-9
    page.mouse.up()
    until(lambda: in_simulation(shown, lambda s: not s.state.loads.force.any()), "the hand to let go")


def test_a_mechanism_is_posed_with_the_mouse_and_saved(
    open_page: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = turnbuckle.Scene("arm", dt=2e-3)
    for k, name in enumerate(("upper", "lower")):
        scene.add_rigid(name, box=[0.12, 0.12, 0.4], position=[0, 0, -0.2 - 0.4 * k])
    scene.add_joint("ball", "shoulder", body1="upper", anchor=[0, 0, 0])
    scene.add_joint("ball", "elbow", body0="upper", body1="lower", anchor=[0, 0, -0.4])
    monkeypatch.chdir(tmp_path)
    shown, page = open_page(scene)
    page.get_by_role("tab", name="Pose").click()
    page.get_by_label("Drag to pose").check(timeout=1e3 * PATIENCE)
    x, y = pixel(shown, page, np.array([0.0, 0.0, -0.7]))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10, y)
    page.mouse.move(x + 120, y - 60)
    until(lambda: in_simulation(shown, lambda s: np.linalg.norm(s.pose("lower")[0][:2])) > 0.08, "the arm to follow")
    page.mouse.up()
    for joint in ("shoulder", "elbow"):
        assert in_simulation(shown, lambda s, j=joint: s.joint_residual(j))[0] < 1e-8
    assert in_simulation(shown, lambda s: s.state.steps) == 0
    page.get_by_role("button", name="Save scene").click()
    path = tmp_path / "arm_posed.yaml"
    until(path.exists, "the file")
    saved = turnbuckle.Simulation(turnbuckle.Scene.load(path))
    assert np.abs(saved.pose("lower")[0] - in_simulation(shown, lambda s: s.pose("lower")[0])).max() < 1e-12


def test_physics_is_changed_on_the_page(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    until(lambda: shown.source.frame.steps > 0, "the first step")
    page.get_by_role("tab", name="Physics").click()
    page.get_by_label("Integrator").click()
    page.get_by_role("option", name="rk4").click()
    until(lambda: in_simulation(shown, lambda s: s.model.integrator) == "rk4", "the other scheme")
    page.get_by_text("none", exact=True).click()
    until(lambda: in_simulation(shown, lambda s: not s.state.gravity.any()), "no gravity")
    step = page.get_by_label("Time step [ms]")
    step.fill("0.5")
    step.press("Enter")
    until(lambda: in_simulation(shown, lambda s: abs(s.dt - 5e-4) < 1e-12), "the other step")


def test_a_slider_moves_through_a_recording_and_a_browser_may_close(open_page: Any, tmp_path: Path) -> None:
    path = tmp_path / "flag.npz"
    scene = cloth()
    scene.apply_set("duration=0.5")
    turnbuckle.run_scene(scene, out=[path])
    recording = read_recording(path)
    shown, page = open_page(recording)
    thumb = page.get_by_role("slider").first
    thumb.focus()
    for _ in range(5):
        thumb.press("ArrowRight")
    until(lambda: shown.source.frame.steps == 5, "the fifth frame")
    assert np.array_equal(shown.source.frame.x, recording.x(5))
    thumb.press("End")
    until(lambda: shown.source.frame.steps == len(recording) - 1, "the last frame")
    page.get_by_role("button", name="Play").click()
    until(lambda: shown.source.running, "it to play")
    page.close()
    number = shown.source.frame.number
    until(lambda: shown.source.frame.number > number + 3, "it to play on without a browser")


def test_a_browser_that_closes_in_the_middle_of_a_drag_lets_go(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    session = shown.source
    until(lambda: session.frame.steps > 0, "the first step")
    x, y = pixel(shown, page, session.frame.x[40])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20, y)
    page.mouse.move(x + 40, y)
    until(lambda: session.frame.pull is not None, "the hand to hold")
    page.close()
    until(lambda: session.frame.pull is None, "the hand to let go")
    steps = session.frame.steps
    until(lambda: session.frame.steps > steps + 50, "it to go on")


def test_pictures_films_and_pages_are_downloaded(open_page: Any, tmp_path: Path, browser: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    until(lambda: shown.source.frame.steps > 0, "the first step")
    page.get_by_role("tab", name="Export").click()
    page.get_by_role("button", name="Record", exact=True).click()
    until(lambda: len(shown.source.recording or []) > 5, "some frames")
    page.get_by_role("button", name="Stop recording").click()
    until(lambda: shown.source.recording is None, "the end")
    for button, name in (("Picture", "flag.png"), ("Web page", "flag.html")):
        with page.expect_download(timeout=1e3 * PATIENCE) as download:
            page.get_by_role("button", name=button).click()
        assert download.value.suggested_filename == name
        download.value.save_as(tmp_path / name)
    context = browser.new_context(offline=True, viewport={"width": 500, "height": 400})
    alone = context.new_page()
    wrong: list[str] = []
    alone.on("pageerror", lambda error: wrong.append(str(error)))
    alone.goto((tmp_path / "flag.html").as_uri())
    alone.locator("canvas").first.wait_for(timeout=1e3 * PATIENCE)
    alone.wait_for_function("window.__viserTestpoints?.rendererInfo.render.triangles > 100", timeout=1e3 * PATIENCE)
    time.sleep(3.0)  # it begins anew several times
    shot = Image.open(io.BytesIO(alone.screenshot(path=tmp_path / "alone.png"))).convert("RGB")
    blue = np.asarray(shot, dtype=int)[:340]
    blue = (blue[..., 2] - blue[..., 0] > 40) & (blue[..., 2] > 100)
    assert 0.02 < blue.mean() < 0.6, "the cloth is on the page"
    waiting = alone.evaluate("window.__viserMutable.messageQueue.length")
    assert waiting < 500, "frames are drawn as they come, also when it begins anew"
    context.close()
    assert not wrong


def test_a_film_for_the_eye_is_downloaded(open_page: Any, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    shown, page = open_page(cloth(), run=True)
    until(lambda: shown.source.frame.steps > 0, "the first step")
    page.get_by_role("tab", name="Export").click()
    page.get_by_role("button", name="Record", exact=True).click()
    until(lambda: len(shown.source.recording or []) > 8, "some frames")
    page.get_by_role("button", name="Stop recording").click()
    until(lambda: shown.source.recording is None, "the end")
    kept = len(shown.page.panels["export"].take())
    page.get_by_label("Film").first.click()
    page.get_by_role("option", name="mp4").click()
    with page.expect_download(timeout=1e3 * PATIENCE) as download:
        page.get_by_role("button", name="Film", exact=True).click()
    assert download.value.suggested_filename == "flag.mp4"
    download.value.save_as(tmp_path / "flag.mp4")
    frames, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "flag.mp4"))
    assert frames == kept and seconds > 0.0
