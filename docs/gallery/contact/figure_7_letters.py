"""
Figure 7: stacking deformable letters
=====================================

Rubber letters, fine triangle meshes in coarse tetrahedra, fall in layers into a box. The pile comes to rest; then the walls push
in and compress it. Steps are 30 ms.

The paper drops 164 letters and runs for 40 s. This page drops 27, and the walls push in after 2.1 s. The whole takes long::

    turnbuckle run letters --out letters.mp4
"""

import os

import turnbuckle
from turnbuckle.scenes import REGISTRY

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page smaller, and without a film

count, seconds = (4, 0.6) if QUICK else (27, 4.2)
scene = REGISTRY["letters"](count=count, across=3, press_at=2.1, press_time=2.0)
scene.apply_set("frames_per_second=16")
film = [] if QUICK else ["letters.png", "letters.mp4"]
result = turnbuckle.run_scene(scene, duration=seconds, out=film, picture_size=(640, 600))
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# The paper: just over 90 minutes for 40 s of animation (a PC of 3.2 GHz, 2009), which is 4.1 s a step.

full, _ = REGISTRY["letters"]().build()
model, _ = scene.build()
whole = sum(shape.name.startswith("letter") for shape in full.shapes)
print(f"{'':24}{'paper':>10}{'the scene':>12}{'this page':>12}")
print(f"{'letters':24}{164:>10}{whole:>12}{count:>12}")
print(f"{'tetrahedra':24}{23000:>10}{len(full.corotational.corners):>12}{len(model.corotational.corners):>12}")
print(f"{'step, ms':24}{30:>10}{1e3 * scene.definition.dt:>12g}{1e3 * scene.definition.dt:>12g}")
print(f"{'contacts at most':24}{'none':>10}{'':12}{result.contacts_max:>12}")
print(f"{'time of a step, ms':24}{4050:>10}{'':12}{result.ms_per_step['total']:>12.0f}")

# %%
# At the paper's size, where a machine has measured it:
#
# .. benchmark-table:: letters
#    :first:
#
# The number
# ----------
#
# Sharp corners and all, no edge passes through a face in any committed state.

print(f"intersections {result.intersections}, smallest gap {1e3 * result.smallest_gap:.2f} mm")

assert result.status == "done"
assert result.intersections == 0
assert result.smallest_gap > 0.0
