"""The controls of the page in a real browser: each changes the simulation, and not the page alone."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from browser_driver import CHROMIUM, PATIENCE, chromium, cloth, in_simulation, opener, pixel, until

import turnbuckle

pytest.importorskip("viser")
pytest.importorskip("playwright.sync_api")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]
WAIT = 1e3 * PATIENCE  # [ms]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., tuple[Any, Any]]]:
    with opener(browser) as found:
        yield found


def block_on_a_table() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("block", dt=5e-3, contact={"friction": 0.5})
    scene.add_obstacle("table", box=[1.0, 1.0, 0.1], position=[0, 0, -0.05])
    scene.add_rigid("block", box=[0.2, 0.2, 0.2], position=[0, 0, 0.1005], mass=2.0)
    scene.add_rigid("door", box=[0.1, 0.02, 0.3], position=[0.35, 0, 0.4], mass=1.0)
    scene.add_joint("revolute", "hinge", body1="door", anchor=[0.3, 0, 0.4], axis=[0, 0, 1])
    return scene


def choose(page: Any, label: str, option: str) -> None:
    page.get_by_label(label, exact=True).click(timeout=WAIT)
    page.get_by_role("option", name=option, exact=True).click(timeout=WAIT)


def test_friction_and_solvers_are_those_of_the_page(open_page: Any) -> None:
    shown, page = open_page(block_on_a_table(), run=True)
    session = shown.source
    until(lambda: session.frame.touching > 0, "the block to stand")
    until(lambda: len(session.frame.contacts.force) > 0, "arrows")
    time.sleep(0.5)
    weight = session.frame.contacts.force[:, 2].sum()
    assert abs(weight) == pytest.approx(2.0 * 9.81, rel=0.2), "arrows are the forces that carry the block"
    page.get_by_role("tab", name="Physics").click()
    slider = page.get_by_role("slider").first
    slider.focus()
    slider.press("Home")
    for _ in range(3):
        slider.press("ArrowRight")
    until(lambda: abs(session.scene.definition.contact.friction - 0.03) < 1e-9, "the friction")
    choose(page, "Contact", "ica")
    until(
        lambda: in_simulation(shown, lambda s: session.scene.definition.contact.solver) == "ica", "the contact solver"
    )
    choose(page, "Joints", "displacement")
    until(lambda: session.scene.definition.solver == "displacement", "the joint solver")
    steps = session.frame.steps
    until(lambda: session.frame.steps > steps + 5, "it to go on")
    assert session.frame.status == "ok", session.frame.messages
    # With hardly any friction a push moves the block for good.
    in_simulation(shown, lambda s: s.push("block", force=[3.0, 0, 0]))
    until(lambda: in_simulation(shown, lambda s: s.pose("block")[0][0]) > 0.05, "the block to slide")


def test_gravity_stays_after_a_reset_and_comes_back(open_page: Any) -> None:
    shown, page = open_page(cloth())
    session = shown.source
    page.get_by_role("tab", name="Physics").click()
    page.get_by_text("none", exact=True).click()
    until(lambda: not in_simulation(shown, lambda s: s.state.gravity.any()), "no gravity")
    page.get_by_role("tab", name="Run").click()
    page.get_by_role("button", name="Step").click()
    until(lambda: session.frame.steps == 1, "one step")
    page.get_by_role("button", name="Reset").click()
    until(lambda: session.frame.steps == 0, "the start")
    assert not in_simulation(shown, lambda s: s.state.gravity.any()), "the page says none"
    page.get_by_role("tab", name="Physics").click()
    page.get_by_text("as in the scene", exact=True).click()
    until(lambda: in_simulation(shown, lambda s: s.state.gravity[2]) == -9.81, "gravity as it was")


def test_the_speed_of_the_page_is_that_of_the_simulation(open_page: Any) -> None:
    scene = turnbuckle.Scene("slow", dt=1e-2)
    scene.add_rope("rope", start=[0, 0, 1], end=[1, 0, 1], segments=2, stretch_stiffness=50.0, damping=0.1, mass=1.0)
    scene.add_constraint("nail", "left", points={"body": "rope", "index": 0})
    shown, page = open_page(scene)
    choose(page, "Speed", "0.1x")
    until(lambda: shown.source.speed == 0.1, "the speed")
    page.get_by_role("button", name="Run", exact=True).click()
    until(lambda: shown.source.frame.steps > 0, "the first step")
    began, start = time.monotonic(), shown.source.frame.time
    time.sleep(3.0)
    assert (shown.source.frame.time - start) / (time.monotonic() - began) == pytest.approx(0.1, abs=0.03)


def test_shift_drags_exactly(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    session = shown.source
    until(lambda: session.frame.steps > 0, "the first step")
    point = int(np.argmin(np.linalg.norm(session.frame.x - [0.5, 0.0, 1.25], axis=1)))
    x, y = pixel(shown, page, session.frame.x[point])
    page.mouse.move(x, y)
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(x + 15, y)
    page.mouse.move(x + 45, y - 20)
    until(lambda: session.frame.pull is not None, "the hand to hold")
    time.sleep(1.0)
    held = in_simulation(shown, lambda s: int(s.state.groups["hand_nail"].points[0]))
    at = in_simulation(shown, lambda s: s.positions()[held].copy())
    assert np.abs(at - session.frame.pull.target).max() < 1e-12, "the vertex is where the mouse is, to rounding"
    page.mouse.up()
    page.keyboard.up("Shift")
    until(lambda: session.frame.pull is None, "the hand to let go")


def test_numbers_and_colours_of_constraints(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    page.get_by_role("tab", name="Constraints").click()
    page.get_by_text("nail x 9").wait_for(timeout=WAIT)
    row = page.locator("div", has_text="nail x 9").last
    until(lambda: "rgb(34, 150, 92)" in row.inner_html() or "rgb(34,150,92)" in row.inner_html(), "a green residual")
    reading = next(r for r in shown.source.frame.readings if r.name == "top")
    assert reading.force > 0.01 and reading.residual < 1e-12
    assert "N" in row.inner_text() and "m" in row.inner_text()
    choose(page, "Colour", "by force")
    until(lambda: shown.page.stage.color_by_force, "marks in the colours of forces")


def test_without_a_graphics_card_it_is_coarse_while_it_moves_and_sharp_when_it_stands(open_page: Any) -> None:
    shown, page = open_page(cloth(), run=True)
    wide = "document.querySelector('canvas[data-engine]').width"
    full = page.evaluate("document.querySelector('canvas[data-engine]').getBoundingClientRect().width")
    until(lambda: page.evaluate(wide) < 0.9 * full, "fewer pixels")
    shown.source.pause().result()
    until(lambda: abs(page.evaluate(wide) - full) <= 1.0, "all pixels")
