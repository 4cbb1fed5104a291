"""Draws the pictures of the ready scenes: three frames of a run side by side, `docs/pictures/NAME.png`.

`python docs/make_pictures.py [NAME ...]`, all scenes by default.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from turnbuckle import Simulation
from turnbuckle.scenes import REGISTRY
from turnbuckle.viewer import Renderer

FOLDER = Path(__file__).parent / "pictures"
SIZE = (520, 440)  # pixels of one frame
# Parameters of each scene, and the times that are shown [s]; None: the end.
SHOWN: dict[str, tuple[dict, tuple[float | None, ...]]] = {
    "curtain": ({"m": 14, "release_at": 0.55}, (0.0, 0.5, 0.85)),
    "robot_on_ropes": ({}, (0.0, 1.0, 2.0)),
    "net_to_bridge": ({}, (1.0, 1.8, 4.0)),
    "self_assembly": ({}, (0.0, 1.1, 2.5)),
    "soft_mesh": ({}, (0.0, 0.35, None)),
    "snake": ({}, (0.0, 0.7, 1.2)),
    "otary": ({}, (0.0, 1.5, 3.0)),
    "monocycle": ({"duration": 3.0}, (0.0, 1.5, 3.0)),
    "puppet": ({}, (0.0, 1.0, 2.0)),
}
# Scenes that share a picture, a frame each: parameters and the time that is shown [s].
TOGETHER: dict[str, dict[str, tuple[dict, float]]] = {
    "loops": {"closed_chain": ({"n": 30}, 0.6), "four_bars": ({"n": 3}, 1.3), "bricard": ({}, 0.6)},
}


def run_to(simulation: Simulation, time: float) -> np.ndarray:
    """Step on to a time [s]; the positions there."""
    while simulation.time < time - 0.5 * simulation.dt:
        report = simulation.step()
        assert report.status != "failed", report.messages
    return simulation.positions().copy()


def frame(simulation: Simulation, x: np.ndarray, every: np.ndarray, title: str) -> np.ndarray:
    """A picture of the positions ``x``, the camera on all of ``every``."""
    bounds = (every.min(axis=0), every.max(axis=0))
    renderer = Renderer(simulation.model.shapes, simulation.scene.definition.up_axis, size=SIZE, bounds=bounds)
    return renderer.frame(x, title)


def draw(name: str) -> Path:
    """Run a scene, or those that share a picture, and write it; the path."""
    pictures = []
    if name in TOGETHER:
        for scene, (options, time) in TOGETHER[name].items():
            simulation = Simulation(REGISTRY[scene](**options))
            x = run_to(simulation, time)
            pictures.append(frame(simulation, x, x, f"{scene}, t = {time:.2f} s"))
    else:
        options, times = SHOWN[name]
        simulation = Simulation(REGISTRY[name](**options))
        duration = simulation.scene.definition.duration
        frames = [(t, run_to(simulation, t)) for t in (duration if time is None else time for time in times)]
        every = np.concatenate([x for _, x in frames])
        pictures = [frame(simulation, x, every, f"t = {t:.2f} s") for t, x in frames]
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"{name}.png"
    Image.fromarray(np.concatenate(pictures, axis=1)).quantize(192).save(path, optimize=True)
    return path


if __name__ == "__main__":
    for chosen in sys.argv[1:] or [*SHOWN, *TOGETHER]:
        print(draw(chosen))
