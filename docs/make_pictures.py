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
}


def draw(name: str) -> Path:
    """Run a scene and write its picture; the path."""
    options, times = SHOWN[name]
    simulation = Simulation(REGISTRY[name](**options))
    definition = simulation.scene.definition
    frames = []
    for time in times:
        until = definition.duration if time is None else time
        while simulation.time < until - 0.5 * simulation.dt:
            report = simulation.step()
            assert report.status != "failed", report.messages
        frames.append((simulation.time, simulation.positions().copy()))
    every = np.concatenate([x for _, x in frames])
    bounds = (every.min(axis=0), every.max(axis=0))
    renderer = Renderer(simulation.model.shapes, definition.up_axis, size=SIZE, bounds=bounds)
    row = np.concatenate([renderer.frame(x, f"t = {time:.2f} s") for time, x in frames], axis=1)
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"{name}.png"
    Image.fromarray(row).quantize(192).save(path, optimize=True)
    return path


if __name__ == "__main__":
    for chosen in sys.argv[1:] or SHOWN:
        print(draw(chosen))
