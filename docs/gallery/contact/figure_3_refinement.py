"""
Figure 3: refinement of the constraint manifold
===============================================

A point would move from q0 to q* in a step, through a curved wall. Refinement takes linear constraints one after the other:
the tentative motion to q1 crosses the wall, what it crossed becomes a constraint; the motion to q2 obeys it and crosses another
facet; and so on until a motion crosses nothing.

This is done here with the parts of contact by themselves, on arrays: detection, solver and refinement know nothing of each other
(:doc:`/contact`).
"""

import matplotlib.pyplot as plt
import numpy as np

import turnbuckle

profile = np.array([[-1.2, 1.0], [-0.7, 0.35], [-0.3, 0.08], [0.0, 0.0], [0.3, 0.05], [0.75, 0.45], [1.2, 1.2]])
wall = np.stack(
    [np.repeat(profile[:, 0], 2), np.tile([-2.0, 2.0], len(profile)), np.repeat(profile[:, 1], 2)], axis=1
)  # the valley of the profile, pulled along y
faces = [[k, k + 2, k + 1] for k in range(0, len(wall) - 2, 2)] + [
    [k + 1, k + 2, k + 3] for k in range(0, len(wall) - 2, 2)
]
q0, q_star = np.array([-0.6, 0.0, 0.75]), np.array([0.6, 0.0, -0.5])
DELTA = 0.02  # [m], the distance that contact keeps

x = np.concatenate([[q0], wall])
fixed = np.arange(len(x)) > 0
parts = [
    turnbuckle.SurfacePart(0, np.array([0]), delta=DELTA),
    turnbuckle.SurfacePart(1, np.arange(1, len(x)), triangles=np.array(faces), delta=DELTA),
]
surfaces = turnbuckle.make_surfaces(parts, x)
detector = turnbuckle.ContactDetector(surfaces, ~fixed)
start = surfaces.positions(x)
free = np.zeros_like(x)
free[0] = q_star - q0  # in a step of 1 s

# %%
# Each call of ``solve`` answers a set of constraints with a tentative end of the step.

tentative, normals = [], []


def solve(contacts: turnbuckle.Contacts) -> np.ndarray:
    problem = turnbuckle.contact_problem(surfaces, contacts, start, free, np.ones(len(x)), 1.0, DELTA, 0.0, fixed)
    found = turnbuckle.solve_contact(problem, tolerance=1e-10)
    end = surfaces.positions(x + found.velocity.reshape(-1, 3))
    tentative.append(end[0])
    normals[:] = contacts.normal
    return end


refined = turnbuckle.refine_contacts(detector.near(start), solve, lambda end: detector.crossed(start, end), rounds=8)

figure, axes = plt.subplots(figsize=(7, 4))
axes.fill_between(profile[:, 0], profile[:, 1], -0.6, color="0.88")
axes.plot(profile[:, 0], profile[:, 1], color="0.3", lw=2)
for k, end in enumerate(tentative):
    axes.plot([q0[0], end[0]], [q0[2], end[2]], "--", color="0.6", lw=1)
    last = k == len(tentative) - 1
    name = f"$q_{k + 1}$" + (" = q*" if k == 0 else "")
    axes.plot(end[0], end[2], "o", color="tab:blue" if last else "tab:red")
    axes.annotate(name, (end[0], end[2]), textcoords="offset points", xytext=(8, -4))
axes.plot(q0[0], q0[2], "o", color="k")
axes.annotate("$q_0$", (q0[0], q0[2]), textcoords="offset points", xytext=(-20, 4))
axes.set(aspect="equal", xlim=(-1.3, 1.3), ylim=(-0.5, 1.1), xlabel="x [m]", ylabel="z [m]")
figure.tight_layout()

# %%
# Beside the paper
# ----------------

print(f"rounds: the paper's sketch 3, here {refined.rounds}")
for k, end in enumerate(tentative, 1):
    print(f"q{k} = ({end[0]:.3f}, {end[2]:.3f}) m")

# %%
# The number
# ----------
#
# The last motion crosses nothing, after no more than the five rounds of the paper. Where it ends is the best place that the
# constraints allow: it is off q* along their normals alone, pushed and never pulled.

pushes = np.linalg.lstsq(np.array(normals).T, tentative[-1] - q_star, rcond=None)[0]
print("pushes along the normals:", np.round(pushes, 4))

assert refined.clear and refined.rounds <= 5
assert len(turnbuckle.intersections(surfaces, surfaces.positions(np.concatenate([[tentative[-1]], wall])))) == 0
assert (pushes > -1e-6).all()
assert np.allclose(np.array(normals).T @ pushes, tentative[-1] - q_star, atol=1e-6)
