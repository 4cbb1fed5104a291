"""A real browser on the page: Debian's Chromium, driven by playwright, without a graphics card."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import turnbuckle

CHROMIUM = next((p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser") if Path(p).exists()), None)
ARGUMENTS = ["--no-sandbox"]
WIDE, HIGH = 1000, 640
PATIENCE = 60.0  # [s] a software renderer on a busy machine takes its time


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser of playwright."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@contextmanager
def opener(browser: Any) -> Iterator[Callable[..., tuple[Any, Any]]]:
    """Opens scenes and recordings: the view, and the page of the browser. All are closed at the end."""
    from turnbuckle.live import view

    opened: list[Any] = []

    def open_one(what: Any, **more: Any) -> tuple[Any, Any]:
        shown = view(what, open_browser=False, **more)
        opened.append(shown)
        page = browser.new_page(viewport={"width": WIDE, "height": HIGH})
        opened.append(page)
        page.goto(shown.url)
        page.get_by_role("tab", name="Export").wait_for(timeout=1e3 * PATIENCE)
        until(lambda: shown.served.viser.get_clients(), "a client")
        client = next(iter(shown.served.viser.get_clients().values()))
        until(lambda: client.camera.image_width > 0, "the camera")
        client.get_render(60, 80, timeout=PATIENCE)  # bodies are on the screen
        return shown, page

    yield open_one
    for one in reversed(opened):
        one.close()


def until(holds: Callable[[], Any], what: str, seconds: float = PATIENCE) -> Any:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = holds()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"waited {seconds:g} s for {what}")


def pixel(shown: Any, page: Any, place: np.ndarray) -> tuple[float, float]:
    """Where a place [m] is in the window."""
    client = next(iter(shown.served.viser.get_clients().values()))
    camera = client.camera
    forward = np.array(camera.look_at) - camera.position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up_direction)
    right /= np.linalg.norm(right)
    offset = np.asarray(place) - camera.position
    scale = camera.image_height / (2.0 * np.tan(0.5 * camera.fov)) / (offset @ forward)
    box = page.locator("canvas").first.bounding_box()
    x = 0.5 * camera.image_width + scale * (offset @ right)
    y = 0.5 * camera.image_height - scale * (offset @ np.cross(right, forward))
    return box["x"] + x * box["width"] / camera.image_width, box["y"] + y * box["height"] / camera.image_height


def cloth() -> turnbuckle.Scene:
    scene = turnbuckle.Scene("flag", dt=1e-3, integrator="velocity_verlet")
    scene.add_cloth(
        "cloth", size=[1, 1], cells=[8, 8], position=[0, 0, 1], rotation=[np.pi / 2, 0, 0], density=0.3,
        structural_stiffness=60.0, shear_stiffness=30.0, damping=0.02,
    )  # fmt: skip
    scene.add_constraint("nail", "top", points={"body": "cloth", "where": "z > 1.99"})
    return scene


def in_simulation(shown: Any, action: Callable[[turnbuckle.Simulation], Any]) -> Any:
    return shown.source.do(action).result(timeout=PATIENCE)
