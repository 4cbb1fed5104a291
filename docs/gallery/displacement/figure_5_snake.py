"""
Figure 5: a flying snake
========================

Six deformable solids on five points to point, one skin over all, and a point to segment that lets the tail slide along a
rod between two stops. The fall of the snake drags the tail to the right until the stop holds it; the snake swings through and
flies back to the left, and its tail slides again.

This page runs the figure whole. The same by the command::

    turnbuckle run snake --out snake.mp4
"""

import os

import numpy as np

import turnbuckle
from turnbuckle.scenes import REGISTRY

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page without flesh and film

SLIDE = 0.55  # [m], from the middle of the rod to a stop
options = {"flesh": 0.0, "dt": 1 / 480, "duration": 1.8} if QUICK else {"duration": 2.0}
scene = REGISTRY["snake"](slide=SLIDE, **options)
scene.apply_set("frames_per_second=25")
seconds, tail = [], []


def watch(simulation: turnbuckle.Simulation, report: turnbuckle.StepReport) -> bool:
    seconds.append(simulation.time)
    tail.append(simulation.coordinate("rod_slide")["place"])
    return False


film = [] if QUICK else ["snake.png", "snake.mp4"]
result = turnbuckle.run_scene(scene, out=film, stop=watch, picture_size=(800, 500))
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# The moments under the paper's pictures, and ours. Its shapes, masses and forces are not printed, so the times need not agree;
# the story does.

t, place = np.array(seconds), np.array(tail)
right, left = t[place > SLIDE - 1e-6], t[place < -SLIDE + 1e-6]
rows = [
    ("the tail starts to slide, s", "0.2", t[np.abs(place) > 0.05][0]),
    ("stopped on the right, s", "0.76", right[0]),
    ("on its way back, s", "1.26", t[(t > right[-1]) & (place < 0.0)][0]),
    ("stopped on the left, s", "1.45", left[0]),
]
print(f"{'':30}{'paper':>10}{'here':>10}")
for what, paper, here in rows:
    print(f"{what:30}{paper:>10}{here:>10.2f}")
joints = scene.definition.constraints
print(f"{'points to point':30}{5:>10}{sum(joint.type == 'ball' for joint in joints):>10}")
print(f"{'a step, ms':30}{'none':>10}{result.ms_per_step['total']:>10.2f}")

# %%
# The number
# ----------
#
# The tail never leaves its segment, to 1e-9 m, and it comes to both stops.

beyond = np.abs(place).max() - SLIDE
print(f"the tail passed a stop by {max(beyond, 0.0):.1e} m at most")

assert result.status == "done"
assert beyond <= 1e-9
assert right[0] < left[0]
