"""
Figure 5: falling cloth
=======================

A sheet falls on its edge and lays itself in folds; folds stack on folds. As in the paper, one step of Loop subdivision smooths
what is drawn (here it is left out, so that you see what was simulated).

The paper's sheet has 2500 vertices, and runs for 4 s. This page runs 1089 vertices for 1.4 s. The whole takes minutes::

    turnbuckle run falling_cloth --set tilt=5 --set bend_stiffness=1e-5 --out cloth.mp4
"""

import os

import turnbuckle
from turnbuckle.scenes import REGISTRY

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page smaller, and without a film

cells, seconds = (8, 0.3) if QUICK else (32, 1.4)
scene = REGISTRY["falling_cloth"](cells=cells, tilt=5.0, bend_stiffness=1e-5)
scene.apply_set("frames_per_second=25")
film = [] if QUICK else ["cloth.png", "cloth.mp4"]
result = turnbuckle.run_scene(scene, duration=seconds, out=film, picture_size=(720, 520))
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# The paper: about 8 minutes for 1000 steps (a PC of 3.2 GHz, 2009), 69 % of it in the solve and 31 % in detection.

ms = result.ms_per_step
found = ms["detection"] + ms["ccd"]
both = found + ms["contact_solve"]
print(f"{'':28}{'paper':>10}{'this page':>12}")
print(f"{'vertices':28}{2500:>10}{(cells + 1) ** 2:>12}")
print(f"{'step, ms':28}{4:>10}{1e3 * scene.definition.dt:>12g}")
print(f"{'time of a step, ms':28}{480:>10}{ms['total']:>12.1f}")
print(f"{'of it in the solve':28}{'69 %':>10}{ms['contact_solve'] / both:>12.0%}")
print(f"{'of it in detection':28}{'31 %':>10}{found / both:>12.0%}")
print(f"{'contacts at most':28}{'none':>10}{result.contacts_max:>12}")

# %%
# At the paper's size, as measured:
#
# .. benchmark-table:: falling_cloth
#    :first:
#
# The number
# ----------
#
# The sheet never passes through itself: no intersections in any committed state, and a certified gap above zero.

print(f"intersections {result.intersections}, smallest gap {1e3 * result.smallest_gap:.2f} mm")

assert result.status == "done"
assert result.intersections == 0
assert result.smallest_gap > 0.0
