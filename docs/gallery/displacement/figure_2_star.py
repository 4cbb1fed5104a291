"""
Figure 2: why displacements are weighted
========================================

Three solids lie in one place, each tied to a fourth, by points to point between their centres of mass. Adding up the
displacements of the three constraints moves the fourth too far, farther at each iteration. The paper weights each
displacement by 1 / max(n_i, n_j), n the number of constraints on a solid.

By the command, for any scene with joints::

    turnbuckle run SCENE --set solver=displacement --set displacement.weights=sum
"""

import matplotlib.pyplot as plt

import turnbuckle


def gap_after(iterations: int, weights: str) -> float:
    """Largest gap [m] after so many iterations of the first step, in which S0 has flown 2 cm away from the others."""
    scene = turnbuckle.Scene("star", gravity=[0, 0, 0], dt=0.02, solver="displacement")
    for option in (f"weights={weights}", "alpha=1", f"max_iterations={iterations}", "tolerance=1e-12"):
        scene.apply_set(f"displacement.{option}")
    scene.add_rigid("S0", sphere=0.1, mass=0.5, velocity=[1, 0, 0])
    for i in (1, 2, 3):
        scene.add_rigid(f"S{i}", sphere=0.1, mass=1.0)
        scene.add_joint("ball", f"P{i}", body0="S0", body1=f"S{i}", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0])
    return turnbuckle.Simulation(scene).step().position_residual["joint"]


# %%
# The gap after one, two, three ... iterations, from 2 cm:

NUMBERS = range(1, 9)
gaps = {weights: [0.02] + [gap_after(n, weights) for n in NUMBERS] for weights in ("sum", "max")}

figure, axes = plt.subplots(figsize=(7, 4))
axes.semilogy(gaps["sum"], "o--", color="tab:red", label="summed")
axes.semilogy(gaps["max"], "o-", color="tab:blue", label="weighted by 1 / max(n_i, n_j)")
axes.set(xlabel="iterations", ylabel="largest gap [m]")
axes.grid(alpha=0.3)
axes.legend()
figure.tight_layout()

# %%
# Beside the paper
# ----------------
#
# The paper says that summing "would move them farther and farther from a solution at each iteration", and proves that with
# the weights every solid moves into the convex hull of those that it is tied to. With masses 1/2, 1, 1, 1 the factors of an
# iteration follow from (20) and (21): 4/3 summed, 2/9 weighted.

factor = {weights: gap[-1] / gap[-2] for weights, gap in gaps.items()}
print(f"{'':12}{'by the paper':>14}{'here':>12}")
print(f"{'summed':12}{4 / 3:>14.6f}{factor['sum']:>12.6f}")
print(f"{'weighted':12}{2 / 9:>14.6f}{factor['max']:>12.6f}")

# %%
# The number
# ----------
#
# The gap shrinks to 2/9 an iteration.

assert abs(factor["max"] - 2 / 9) < 1e-4
assert abs(factor["sum"] - 4 / 3) < 1e-6
