"""
Figure 3: a robot slides along two ropes
========================================

Ten soft solids, joined at fourteen points, make a robot. The tips of its forearms slide on the triangulated surfaces of two
ropes, which are soft solids too and sag under its weight: the constraint acts on both.

This page runs the figure at the paper's size (1339 tetrahedra), whole. The same by the command::

    turnbuckle run robot_on_ropes --out robot.mp4
"""

import os

import turnbuckle
from turnbuckle.scenes import REGISTRY

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page shorter, and without a film

scene = REGISTRY["robot_on_ropes"]()
scene.apply_set("frames_per_second=25")
hand = []  # where the left hand is [m]


def watch(simulation: turnbuckle.Simulation, report: turnbuckle.StepReport) -> bool:
    hand.append(simulation.positions("left_forearm")[14].copy())
    return False


result = turnbuckle.run_scene(
    scene,
    duration=0.1 if QUICK else 2.0,
    out=[] if QUICK else ["robot.png", "robot.mp4"],
    stop=watch,
    picture_size=(800, 500),
)
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# Counts, and medians of the time of a step in milliseconds. The paper's closest point transform makes its two sliding
# points "comparatively expensive"; here a hierarchy of boxes finds the place on the surface.

counts, ms = result.counts, result.ms_per_step
rows = [
    ("tetrahedra", 1339, counts["tetrahedra"]),
    ("points to point", 14, counts["points_to_point"]),
    ("point to surface", 2, counts["slide"]),
    ("forces, ms", 0.81, ms["forces"]),
    ("constraints, ms", 1.54, ms["constraints"]),
    ("integration, ms", 1.17, ms["integration"]),
]
print(f"{'':20}{'paper':>10}{'here':>10}")
for what, paper, here in rows:
    print(f"{what:20}{paper:>10}{here:>10.4g}")

# %%
# The number
# ----------
#
# The hands are on the surfaces of the ropes, to 1e-12 of the scene's size (about 8 m), at the end of every step, while the
# robot travels down.

moved = hand[-1] - hand[0]
print(f"worst distance of a hand from its rope: {result.worst_residual['slide']:.1e} m")
print(f"the left hand went {moved[1]:.2f} m along and {-moved[2]:.2f} m down")

assert result.status == "done"
assert result.worst_residual["slide"] <= 1e-12 * 8.0
assert -moved[2] > (0.03 if QUICK else 0.3)
