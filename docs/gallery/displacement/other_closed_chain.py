"""
Beyond the figures: a closed chain of any length
================================================

Boxes on ball joints between two points of the world: one loop. Iterations need the more rounds the longer a chain is; a direct
solver that goes along the graph does not, and its time grows in proportion to the length. The paper's loops are those of its
monocycle. By the command::

    turnbuckle run closed_chain --set n=100 --out chain.mp4

Other libraries on the same chain: :doc:`/benchmarks`.
"""

import os

import numpy as np

import turnbuckle
from turnbuckle.scenes import REGISTRY
from turnbuckle.scenes.closed_chain import hanging_slopes

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page shorter, and without a film

scene = REGISTRY["closed_chain"](n=30, duration=0.5 if QUICK else 4.0)
scene.apply_set("frames_per_second=25")
film = [] if QUICK else ["chain.png", "chain.mp4"]
result = turnbuckle.run_scene(scene, out=film, picture_size=(800, 500))
print(result.certificate())

# %%
# Beside the paper
# ----------------
#
# Time of a step and worst gap against the length, ten times as long each; the paper prints none.

print(f"{'boxes':>8}{'ms a step':>12}{'us a box':>12}{'worst gap, m':>14}{'the paper':>12}")
for n in (10, 100) if QUICK else (10, 100, 1000):
    found = turnbuckle.run_scene(REGISTRY["closed_chain"](n=n), duration=0.1)
    ms = found.ms_per_step["total"]
    print(f"{n:>8}{ms:>12.2f}{1e3 * ms / n:>12.1f}{found.worst_residual['joint']:>14.1e}{'none':>12}")

# %%
# The number
# ----------
#
# A chain that hangs at rest pulls at its end as statics says: with half its weight up, and along the chord with the pull that
# follows from its shape. Reactions are forces, not averages over steps.

n = 20
simulation = turnbuckle.Simulation(REGISTRY["closed_chain"](n=n, tilt=0.0))
simulation.run(0.2)
force, _ = simulation.reaction("joint_0")
expected = np.array([-hanging_slopes(n, 0.7)[1], 0.0, 0.5 * n]) * 9.81
print(f"pull of the end: {np.round(force, 6)} N; by statics {np.round(expected, 6)} N")

assert np.abs(force - expected).max() <= 1e-6 * np.linalg.norm(expected)
assert result.status == "done"
assert result.worst_residual["joint"] <= 1e-10
