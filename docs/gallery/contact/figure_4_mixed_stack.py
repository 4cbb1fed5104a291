"""
Figure 4: a stack of everything
===============================

Rigid bodies (yellow), soft solids of corotational elements (orange) and cloth (red) are dropped on each other. Cloth is pressed
between rigid and soft bodies. All contacts of all kinds are one problem in each step.

This page runs one storey of two, and the fall alone. The whole by the command::

    turnbuckle run mixed_stack --out stack.mp4
"""

import os

import turnbuckle
from turnbuckle.scenes import REGISTRY

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page shorter, and without a film

cells, seconds = (6, 0.1) if QUICK else (16, 1.0)
scene = REGISTRY["mixed_stack"](storeys=1, cloth_cells=cells)
scene.apply_set("frames_per_second=25")
film = [] if QUICK else ["stack.png", "stack.mp4"]
result = turnbuckle.run_scene(scene, duration=seconds, out=film, picture_size=(640, 560))
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# The paper prints neither counts nor times for this scene: "no special care is needed for dealing with contact between cloth and
# solid bodies or FEM deformable models and rigid bodies".

model, _ = scene.build()
ms = result.ms_per_step
print(f"{'':24}{'paper':>10}{'here':>10}")
print(f"{'rigid bodies':24}{'none':>10}{model.rigid.count - 1:>10}")
print(f"{'tetrahedra':24}{'none':>10}{len(model.corotational.corners):>10}")
print(f"{'hinges of cloth':24}{'none':>10}{len(model.hinges.points):>10}")
print(f"{'contacts at most':24}{'none':>10}{result.contacts_max:>10}")
print(f"{'a step, ms':24}{'none':>10}{ms['total']:>10.1f}")

# %%
# The number
# ----------
#
# No edge passes through a face in any committed state.

print(f"intersections {result.intersections}, smallest gap {1e3 * result.smallest_gap:.2f} mm")

assert result.status == "done"
assert result.intersections == 0
assert result.smallest_gap > 0.0
