"""
Figure 2: local against global response
=======================================

Springs and a torsional one between three points a, b, c are pushed against a wall. Moving c alone out of the wall, as local
methods do, strains the springs. A response that knows the dynamics moves b as well, and the elastic energy stays far lower.

This page runs the figure whole, three points (b is the edge of the torsional spring). The figure with its map of energies,
at three step sizes, is made by::

    turnbuckle bench local_global
"""

import matplotlib.pyplot as plt
import numpy as np

import turnbuckle
from turnbuckle.scenes import REGISTRY
from turnbuckle.scenes.local_global import (
    AWAY,
    NORMAL,
    REST,
    A,
    B,
    C,
    elastic_energy,
    moved,
    projected,
    wall_distance,
)  # fmt: skip

simulation = turnbuckle.Simulation(REGISTRY["local_global"]())

# %%
# A hand moves a at the wall, 2 cm further than where c touches, and waits until nothing moves any more.
# Beside it: where the structure would be without the wall, and with c alone moved out of the wall.

simulation.run(2.0)
solved = simulation.positions("structure")
pushed = moved(REST)
places = {
    "without the wall": pushed,
    "c alone moved (local)": projected(pushed, float(wall_distance(solved[[C]])[0])),
    "solved (global)": solved,
}

figure, axes = plt.subplots(figsize=(7, 4))
wall = REST[C] - AWAY * NORMAL + np.outer([-0.06, 0.06], [NORMAL[2], 0, -NORMAL[0]])
axes.plot(wall[:, 0], wall[:, 2], color="0.3", lw=4, label="wall")
for (name, x), style in zip(places.items(), ("k:", "r--", "b-"), strict=True):
    line = np.stack([x[A], x[B].mean(axis=0), x[C]])
    axes.plot(line[:, 0], line[:, 2], style, marker="o", label=f"{name}: {1e3 * elastic_energy(x):.2f} mJ")
for letter, at in zip("abc", np.stack([solved[A], solved[B].mean(axis=0), solved[C]]), strict=True):
    axes.annotate(letter, (at[0], at[2]), textcoords="offset points", xytext=(-4, 8))
axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
axes.legend(fontsize=8)
figure.tight_layout()

# %%
# Beside the paper
# ----------------
#
# The paper shows colours of the energy and prints no values: "a remarkably lower elastic energy".

print("points: the paper 3, here a, b (an edge) and c")
energies = {name: elastic_energy(x) for name, x in places.items()}
for name, energy in energies.items():
    print(f"{name:24s} {1e3 * energy:8.3f} mJ")

# %%
# The number
# ----------
#
# The energy of the global response over that of the local one: below a tenth.

ratio = energies["solved (global)"] / energies["c alone moved (local)"]
print(f"ratio {ratio:.3f}")

assert 0.0 < ratio < 0.1
