"""
Figure 6: time against contacts
===============================

Left: the time of a whole step of the letters of Figure 7, without friction, against the number of contacts, with the paper's full
constraint anticipation (the dense Schur complement), its iterative constraint anticipation (ICA), and our default. Right: letters
of coarser and finer tetrahedra.

Piles of a few letters are dropped here; the paper has 164. The figure at a larger size takes many minutes::

    turnbuckle bench contact_scaling
"""

import os

import matplotlib.pyplot as plt

from turnbuckle.benchmarks.contact_scaling import Series, compare, resolution

QUICK = "TURNBUCKLE_QUICK" in os.environ  # the tests run this page smaller

counts, seconds = ((1, 4), 0.9) if QUICK else ((4, 8, 16), 1.2)
names = {"newton": "newton (ours)", "ica": "ICA", "anticipation": "full anticipation"}
left = {name: Series(name) for name in names}
notes = []
for count in counts:
    notes += compare(count, across=3, seconds=seconds, every=4, limit=400, series=left)

# %%
# Right: the same piles, with friction, of letters of three resolutions.

sizes = (70, 140) if QUICK else (70, 140, 280)
right = [resolution(size, counts[-2:], across=3, mu=0.4, seconds=seconds, method="newton") for size in sizes]

figure, (a, b) = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
for name, one in left.items():
    a.plot(*zip(*sorted(zip(one.contacts, one.ms, strict=True)), strict=True), "o-", ms=4, label=names[name])
for one in right:
    b.plot(*zip(*sorted(zip(one.contacts, one.ms, strict=True)), strict=True), "o-", ms=4, label=one.name)
for axes in (a, b):
    axes.set(xlabel="contacts", yscale="log", xscale="log")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
a.set_ylabel("a whole step [ms]")
figure.tight_layout()

# %%
# Beside the paper
# ----------------
#
# The paper's graphs: ICA quasi-linear, full anticipation quadratic at best, and for ICA hardly any influence of the mesh below 140
# tetrahedra a letter. It prints no values.

print("whole steps, time ~ contacts^p; the paper: ICA about 1, full anticipation 2 at best")
for name, one in left.items():
    slope = one.slope()
    print(f"{names[name]:20} p = {'too few contacts to tell' if slope is None else f'{slope:.2f}'}")
print(*notes, sep="\n")

# %%
# At a larger size, where a machine has measured it:
#
# .. benchmark-table:: contact_scaling
#
# The number
# ----------
#
# With ours, a contact in the largest pile costs at most three times what it costs in the smallest: nothing quadratic.

pairs = sorted(zip(left["newton"].contacts, left["newton"].ms, strict=True))
few, many = (ms / n for n, ms in (pairs[0], pairs[-1]))
print(f"{pairs[0][0]:.0f} contacts: {1e3 * few:.0f} us a contact; {pairs[-1][0]:.0f}: {1e3 * many:.0f} us")

assert pairs[-1][0] > 2 * pairs[0][0]
assert many < 3 * few
